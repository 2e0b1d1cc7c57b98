"""The noise level, and the facts that the sheet of a noise model prints."""

from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array


class NoiseLevel(NamedTuple):
    """The noise level: standard deviation per axis."""

    mm: float
    """Of the position."""
    deg: float
    """Of the rotation vector."""

    def sigma(self) -> Array:
        """The standard deviation of each coordinate of a body twist, (6,), [m, rad]."""
        return np.repeat([self.mm * 1e-3, np.radians(self.deg)], 3)


class Facts(NamedTuple):
    """The attribute `FACTS` of a noise model, which its sheet prints; without it the sheet prints the docstring."""

    title: str
    formula: tuple[str, ...]
    """One line each; L is the level, e are independent standard normal numbers, xi is the body twist."""
    frame: str
    parameters: tuple[str, ...]
    """One `name = value unit: meaning` per parameter; the numbers come from the constants of the model."""
    states: str
    """The covariance that an observation states, and how it compares with the errors."""
    notes: tuple[str, ...] = ()
    measured: bool = False
    """True if the level is a factor on measured errors; False if it is the deviation in mm and degrees."""
