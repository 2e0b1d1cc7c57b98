"""Ranges of trial numbers, which are seeds: evaluation and training use ranges that do not overlap."""

FIRST_TRAINING_TRIAL = 1_000_000
"""First number of trials for training, as in `dataset make` and the pool of `APOInsert-v0`.

Smaller numbers are for evaluation: those of tracks, sweeps and results.
"""
EVALUATION_STARTS = 100_000
"""Number of seeds for evaluation episodes.

A trial that fails before its episode begins is replaced by the trial with a number larger by this, so that no two seeds
begin at the same trial.
"""
