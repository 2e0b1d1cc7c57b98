"""The file forms of observations and plans."""
