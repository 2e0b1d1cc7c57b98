"""Noise measured of a pose estimator: from residuals to a noise file."""
