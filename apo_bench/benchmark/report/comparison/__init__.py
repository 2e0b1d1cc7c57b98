"""The comparison of two sweeps."""
