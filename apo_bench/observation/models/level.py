"""The level of a noise model."""

from __future__ import annotations

from typing import NamedTuple


class Level(NamedTuple):
    """How much noise: standard deviation per axis."""

    mm: float
    deg: float
