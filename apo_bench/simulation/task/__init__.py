"""One operation under somebody else's control: where it starts, the arm between two actions, and how it ends."""
