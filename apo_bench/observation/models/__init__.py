"""Noise models, one a file: what a camera makes of the true poses."""
