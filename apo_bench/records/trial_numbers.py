"""Trial numbers for evaluation and for training."""

FIRST_TRAINING_TRIAL = 1_000_000
"""Trials from here on are for training: `dataset make` and the pool of `APOInsert-v0` begin here. Smaller numbers are
for evaluation: those of tracks, sweeps and results."""
EVALUATION_STARTS = 100_000
"""Seeds of episodes for evaluation. A trial that fails before its episode begins is replaced by the one that is so many
numbers further, so that no two seeds begin at the same trial."""
