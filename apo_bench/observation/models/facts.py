"""What a noise model says of itself, for its card."""

from __future__ import annotations

from typing import NamedTuple


class Facts(NamedTuple):
    """The attribute `FACTS` of a noise model: what its card prints. Models that bring none have their docstring."""

    title: str
    formula: tuple[str, ...]
    """One line each; L is the level, e are independent standard normal numbers, xi is the body twist."""
    frame: str
    parameters: tuple[str, ...]
    """`name = value unit: meaning`, one each; numbers are read from the constants that the model uses."""
    states: str
    """Which covariance an observation states, and how that compares with the errors."""
    notes: tuple[str, ...] = ()
    measured: bool = False
    """Whether a level multiplies what was measured, instead of being the deviation in mm and degrees."""
