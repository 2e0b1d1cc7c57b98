"""Data to learn from: pairs of observation and truth."""

from apo_bench.benchmark.datasets.drawing import Pairs, endless_pairs, pairs

__all__ = ("Pairs", "endless_pairs", "pairs")
