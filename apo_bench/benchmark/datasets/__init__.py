"""Data for learning: pairs of observation and truth."""

from apo_bench.benchmark.datasets.training_pairs import Pairs, draw_endless_pairs, draw_pairs

__all__ = ("Pairs", "draw_endless_pairs", "draw_pairs")
