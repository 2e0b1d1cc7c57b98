"""Baseline correctors that `contact` is compared with: those of the paper, and other methods."""
