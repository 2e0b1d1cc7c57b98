"""What a worker is given, does and says, and who keeps count of it: the same on every executor."""
