"""Sweeps: the trials of grids, the processes that run them, the folder of their records."""
