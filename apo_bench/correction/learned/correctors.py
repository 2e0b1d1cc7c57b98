"""`learned-set`: a network says whose pose is grossly wrong and how wrong the others are; contacts do the rest."""

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Correction, Observation, lowered_observation, measured_rates
from apo_bench.correction.learned.network import forward, shapes
from apo_bench.correction.learned.tokens import tokens
from apo_bench.correction.robust.robust import contact_robust
from apo_bench.geometry import Array, pose
from apo_bench.resources import folder

GROSS_SCALE = 40.0
"""What was seen wrongly, where contacts alone do not say where it goes, is off by so many times what is stated."""


def learned_set(observation: Observation) -> Correction:
    """Correct an observation without any model of outliers: `contact-robust` of what the network leaves.

    Raises:
        InputError: A covariance is not positive definite.
    """
    flat = lowered_observation(observation)
    if not len(flat.goals):
        return contact_robust(flat)
    believed, gross = as_believed(flat)
    plain = replace(believed, outliers=measured_rates(0.0, 0.0), tails=None)
    found = contact_robust(replace(plain, seen=plain.seen & ~gross))
    if found.ok or not (gross & plain.seen).any():
        return found
    wide = np.where(gross, GROSS_SCALE**2, 1.0)[:, None, None]
    return contact_robust(replace(plain, covariance=plain.covariance * wide))


def as_believed(flat: Observation) -> tuple[Observation, NDArray[np.bool_]]:
    """An observation as the network believes it, and which operations it does not, (n,)."""
    said = forward(_weights(), tokens(flat))
    L = np.linalg.cholesky(flat.covariance)
    gross = np.asarray(said.gross > 0.0)
    moved = flat.goals @ pose.exp((L @ said.twist[..., None])[..., 0])
    goals = np.where((gross | ~flat.seen)[:, None, None], flat.goals, moved)
    # What operations share is within what is stated of each, so that is not made less.
    scale = np.where(gross, 1.0, np.exp(np.maximum(said.log_scale, 0.0 if flat.shared else -np.inf)))
    return replace(flat, goals=goals, covariance=flat.covariance * scale[:, None, None] ** 2), gross


@cache
def _weights() -> dict[str, Array]:
    with np.load(folder("assets") / "learned" / "set.npz", allow_pickle=False) as kept:
        return {name: kept[name].astype(np.float64) for name in shapes()}
