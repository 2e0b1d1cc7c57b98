"""Baselines that `contact` is compared with: the correctors of the paper, and other methods."""
