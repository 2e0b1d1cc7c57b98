"""Noise models fitted to the residuals of a pose estimator."""
