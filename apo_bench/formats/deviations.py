"""Standard deviations that an observation may state, and those that are assumed."""

from math import pi

import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import Array

DEVIATION_MM = 1.0
DEVIATION_DEG = 1.0
"""What is assumed where a file states no standard deviations."""
SHIFT_M = (1e-7, 10.0)
TURN_RAD = (1e-4 * pi / 180.0, pi)
"""Least and greatest standard deviation, [m] and [rad]: within these, rounding hides neither ranks nor gaps."""
_ROUNDING = 1e-9


def check_deviations(deviation_mm: float, deviation_deg: float) -> None:
    """Refuse standard deviations that make no sense.

    Raises:
        InputError: One is too small, too large, or no number.
    """
    for name, deviation, size, limits in (
        ("deviation_mm", deviation_mm, 1e-3, SHIFT_M),
        ("deviation_deg", deviation_deg, pi / 180.0, TURN_RAD),
    ):
        low, high = (x / size for x in limits)
        allowed = is_within(deviation * size, limits)
        require(allowed, f"{name} {deviation:g} was given; a number from {low:g} to {high:g} is allowed.")


def assumed_deviations(deviation_mm: float | None, deviation_deg: float | None) -> str:
    """Return the note on a file that states no standard deviations; None stands for the default."""
    mm = DEVIATION_MM if deviation_mm is None else deviation_mm
    deg = DEVIATION_DEG if deviation_deg is None else deviation_deg
    return f"a standard deviation of {mm:g} mm and {deg:g} deg per axis, assumed where the file states none"


def is_within(deviation: float, limits: tuple[float, float]) -> bool:
    """Whether a standard deviation, [m] or [rad], is between its limits; a NaN is not."""
    return limits[0] * (1.0 - _ROUNDING) <= deviation <= limits[1] * (1.0 + _ROUNDING)


def is_sensible(covariance: Array) -> bool:
    """Whether every variance of a body twist, on the diagonal of (6, 6) [m, rad], is that of such a deviation."""
    deviations = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    return all(is_within(float(x), SHIFT_M if i < 3 else TURN_RAD) for i, x in enumerate(deviations))
