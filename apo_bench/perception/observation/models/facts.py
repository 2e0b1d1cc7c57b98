"""The level of a noise model, and the facts for its sheet."""

from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array


class NoiseLevel(NamedTuple):
    """How much noise: standard deviation per axis."""

    mm: float
    deg: float

    def sigma(self) -> Array:
        """The standard deviation of each coordinate of a body twist, (6,), [m, rad]."""
        return np.repeat([self.mm * 1e-3, np.radians(self.deg)], 3)


class Facts(NamedTuple):
    """The attribute `FACTS` of a noise model: what its sheet prints. Models that bring none have their docstring."""

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
