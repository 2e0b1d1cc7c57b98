"""Measurements over many trials: sweeps, statistics, reports, scores, data sets."""
