"""The comparison of two sweeps, trial by trial."""
