"""Limits and defaults of the standard deviations in observation files."""

from math import pi

import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import Array

DEVIATION_MM = 1.0  # assumed along each axis if a file states none
DEVIATION_DEG = 1.0  # assumed about each axis if a file states none
SHIFT_M = (1e-7, 10.0)  # limits of a standard deviation of position
TURN_RAD = (1e-4 * pi / 180.0, pi)  # limits of a standard deviation of rotation
"""Within these limits, rounding affects neither ranks of matrices nor gaps of contacts."""
_ROUNDING = 1e-9  # relative tolerance at the limits


def check_deviations(deviation_mm: float, deviation_deg: float) -> None:
    """Check standard deviations that a user states.

    Raises:
        InputError: One is too small, too large, or not a number.
    """
    for name, deviation, size, limits in (
        ("deviation_mm", deviation_mm, 1e-3, SHIFT_M),
        ("deviation_deg", deviation_deg, pi / 180.0, TURN_RAD),
    ):
        low, high = (x / size for x in limits)
        allowed = is_within(deviation * size, limits)
        require(allowed, f"{name} {deviation:g} was given; a number from {low:g} to {high:g} is allowed.")


def note_assumed_deviations(deviation_mm: float | None, deviation_deg: float | None) -> str:
    """Return the note on a file that states no standard deviations; None means the default."""
    mm = DEVIATION_MM if deviation_mm is None else deviation_mm
    deg = DEVIATION_DEG if deviation_deg is None else deviation_deg
    return f"a standard deviation of {mm:g} mm and {deg:g} deg per axis, assumed where the file states none"


def is_within(deviation: float, limits: tuple[float, float]) -> bool:
    """Whether a standard deviation, [m] or [rad], is within limits; False for NaN."""
    return limits[0] * (1.0 - _ROUNDING) <= deviation <= limits[1] * (1.0 + _ROUNDING)


def is_sensible(covariance: Array) -> bool:
    """Whether the standard deviations of a body twist, from its covariance (6, 6), [m, rad], are within limits."""
    deviations = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    return all(is_within(float(x), SHIFT_M if i < 3 else TURN_RAD) for i, x in enumerate(deviations))
