"""File formats of observations and plans."""
