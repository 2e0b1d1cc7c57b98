"""Sweeps: the trials of grids, the processes that run them, and the folder of their records."""
