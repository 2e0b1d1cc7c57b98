"""Data sets of images in BOP format: what a pose estimator gets of the demonstrations of trials."""
