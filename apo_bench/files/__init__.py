"""The file forms of demonstrations, observations and plans."""
