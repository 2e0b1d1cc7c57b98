"""Adjustment of p-values for many comparisons: of a hundred true nulls, five are below 0.05 by chance."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TypeVar

from apo_bench.errors import InputError, unknown

ADJUSTMENTS = ("holm", "bh", "none")
"""Holm's bounds the chance of one false alarm or more, Benjamini and Hochberg's the share of false alarms."""
DEFAULT = "holm"

K = TypeVar("K", bound=Hashable)


def adjusted(p: Mapping[K, float], how: str = DEFAULT) -> dict[K, float]:
    """The p-values of a family of tests, raised so that each can be held against the level of the whole family.

    `holm`: S. Holm, A simple sequentially rejective multiple test procedure, Scandinavian Journal of Statistics 6
    (1979), 65-70. `bh`: Y. Benjamini and Y. Hochberg, Controlling the false discovery rate, Journal of the Royal
    Statistical Society B 57 (1995), 289-300. `none` leaves them alone.

    Raises:
        InputError: There is no such adjustment.
    """
    if how not in ADJUSTMENTS:
        raise InputError(unknown("adjustment", how, ADJUSTMENTS))
    if how == "none" or not p:
        return dict(p)
    from statsmodels.stats.multitest import multipletests

    found = multipletests(list(p.values()), method={"holm": "holm", "bh": "fdr_bh"}[how])[1]
    return dict(zip(p, map(float, found), strict=True))
