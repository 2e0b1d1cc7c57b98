"""Which camera is this? Its noise, learned from observations alone: contacts tell what is wrong, nobody the truth.

Every observation is corrected by `contact-robust`; the errors in the directions that contacts fix are then known, and
the noise that makes them most likely is looked for.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.assembly.goals import Observation
from apo_bench.correction.correctors import correct
from apo_bench.correction.learning.evidence import UNITS, readings
from apo_bench.correction.learning.likelihood import LearnedNoise, Shown, learn_noise
from apo_bench.errors import InputError
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.observation.fitting.components import COMPONENTS, component_factors, view_ways
from apo_bench.observation.models.camera import Camera
from apo_bench.observation.models.fitted import ConstantError, MeasuredNoise, ViewNoise, view_frame
from apo_bench.observation.models.residuals import INLIER_MM, TURNED_DEG
from apo_bench.observation.models.tails import Split, Tail

FEWEST = 5
"""Observations below which nothing is learned."""
_GROSS = 8.0
"""An operation is taken for grossly wrong at first if its error is so many times the median."""
_LIMIT = 6.0
"""Errors are limited to so many of the largest deviation, or to those of an inlier of `noise fit`, if that is more."""


class Learned(NamedTuple):
    """What observations tell of a camera."""

    noise: LearnedNoise
    """Deviations in the order of `COMPONENTS`."""
    measured: MeasuredNoise
    """The same as a noise model."""
    camera: Camera
    operations: int
    unseen: int
    used: int
    """Observations that could be corrected."""


def learn(observations: Sequence[Observation], camera: Camera, source: str, *, constant: bool = False) -> Learned:
    """The noise of the camera that made these observations, of any assemblies.

    Args:
        camera: Where it stands, for the directions of its rays.
        source: What the noise model says it is of.
        constant: Whether the camera also has an error that is the same in all observations.

    Raises:
        InputError: Too few observations, or too few that can be corrected.
    """
    made = [(one, correct(one, "contact-robust")) for one in observations]
    usable = [(one, correction) for one, correction in made if correction.ok]
    if len(usable) < FEWEST:
        raise InputError(
            f"{len(observations)} observations were given, of which {len(usable)} can be corrected; at least {FEWEST} "
            "are needed to learn a camera's noise."
        )
    P = view_frame(camera, [correction.goals for _, correction in usable])
    errors = [pose.log(pose.inverse(c.goals) @ one.goals) / UNITS for one, c in usable]
    size = [np.sqrt(np.square(xi.reshape(-1, 2, 3)).mean(axis=2)) for xi in errors]
    seen = np.concatenate([s[one.seen] for s, (one, _) in zip(size, usable, strict=True)])
    typical = np.maximum(np.median(seen, axis=0), 1e-3)
    shown = []
    for (one, correction), s in zip(usable, size, strict=True):
        gross = frozenset(np.flatnonzero((s > _GROSS * typical).any(axis=1) | ~one.seen).tolist())
        n = len(one.goals)
        unseen = frozenset(np.flatnonzero(~one.seen).tolist())
        others = [gross ^ {k} for k in range(n) if k not in unseen]
        F = component_factors(camera, correction.goals, P)
        ways = view_ways(correction.goals, P)
        shown.append(Shown(readings(one, correction.goals, [gross, *others]), F, ways, n, unseen))
    start = [typical[0 if component.unit == "mm" else 1] for component in COMPONENTS]
    start[4:] = [0.3 * x for x in start[4:]]
    found = learn_noise(shown, start, constant)
    far = np.concatenate([s[list(one.readings[0].gross - one.unseen), 0] for s, one in zip(size, shown, strict=True)])
    operations = sum(one.n for one in shown)
    missing = sum(len(one.unseen) for one in shown)
    measured = _measured(found, far * np.sqrt(3.0), source, missing / operations, P)
    return Learned(found, measured, camera, operations, missing, len(usable))


def _measured(found: LearnedNoise, far_mm: Array, source: str, missed: float, P: Array) -> MeasuredNoise:
    across, along, tilt, about, shift, turn = (estimate.value for estimate in found.deviations)
    limit_mm = max(INLIER_MM, _LIMIT * max(across, along))
    limit_deg = max(TURNED_DEG, _LIMIT * max(tilt, about))
    far_mm = far_mm[far_mm > limit_mm]
    farthest = limit_mm * float(np.exp(2.0 * np.log(far_mm / limit_mm).mean())) if len(far_mm) else 2.0 * limit_mm
    there = any(estimate.low > 0.0 for estimate in found.deviations[4:])
    return MeasuredNoise(
        source=source,
        shift_mm=Split(Tail(across), Tail(along), limit_mm),
        turn_deg=Split(Tail(tilt), Tail(about), min(limit_deg, 180.0)),
        missed=missed,
        outliers=found.gross.value,
        farthest_mm=farthest,
        view=ViewNoise(shift, turn) if there else None,
        constant=ConstantError(found.constant * UNITS, P) if found.constant.any() else None,
    )
