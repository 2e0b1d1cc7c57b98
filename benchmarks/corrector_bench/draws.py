"""Synthetic observations: Gaussian around an exactly consistent truth, drawn from the covariance that is stated.

One integer seed makes one draw, whatever else is measured, so that every solver meets the same observations.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array, pose
from benchmarks.corrector_bench.problems import Problem

LEVELS = {"2/1": (2.0, 1.0), "5/3": (5.0, 3.0), "10/8": (10.0, 8.0), "20/20": (20.0, 20.0)}
"""Standard deviations in mm and degrees, per axis of the body twist."""
FACTORS = (0.3, 4.0)
"""Per part, log-uniform: what `per-part` noise multiplies a level by."""
PLACE_M = 0.05
SLIDE_M = 0.005
SLIDE_RAD = 0.09


class Draw(NamedTuple):
    """One observation and the truth behind it."""

    truth: Array
    """(n, 4, 4), world frame, [m]."""
    seen: Array
    """(n, 4, 4)."""
    covariance: Array
    """(n, 6, 6), of the body twist, [m, rad]."""


def factors(covariance: Array) -> Array:
    """L with L L^t = covariance, (*, n, 6, 6)."""
    return np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)


def draw(of: Problem, noise_level: str, seed: int, per_part: bool = False) -> Draw:
    """The observation of one seed: T_seen = T_true exp(xi), xi ~ N(0, covariance)."""
    rng = np.random.default_rng([seed, int(per_part)])
    truth = moved(of, rng)
    sigma = scales(of, noise_level, rng, per_part)
    twist = sigma * rng.standard_normal((of.n, 6))
    return Draw(truth, truth @ pose.exp(twist), sigma[:, :, None] ** 2 * np.eye(6))


def moved(of: Problem, rng: np.random.Generator) -> Array:
    """The truth somewhere else, still exactly consistent: every free motion by a random amount."""
    amount = rng.uniform(-1.0, 1.0, size=len(of.slides))
    unit = np.array([SLIDE_M] * 3 + [SLIDE_RAD] * 3)
    truth = np.array(of.goals)
    for a, slide in zip(amount, of.slides, strict=True):
        truth = truth @ pose.exp(a * unit * slide)
    x, y = rng.uniform(-PLACE_M, PLACE_M, size=2)
    place = pose.at([x, y, 0.0], [0.0, 0.0, rng.uniform(-180.0, 180.0)])
    at = list(of.together)
    truth[at] = place @ truth[at]
    return truth


def scales(of: Problem, noise_level: str, rng: np.random.Generator, per_part: bool = False) -> Array:
    """Standard deviation of every component, (n, 6), [m, rad]."""
    mm, degrees = LEVELS[noise_level]
    one = np.array([1e-3 * mm] * 3 + [np.radians(degrees)] * 3)
    parts = [operation.main for operation in of.assembly.operations]
    low, high = np.log(FACTORS)
    factor = {part: np.exp(rng.uniform(low, high)) for part in dict.fromkeys(parts)} if per_part else {}
    return np.array([factor.get(part, 1.0) * one for part in parts])
