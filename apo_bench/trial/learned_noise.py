"""Which camera is this? Its noise, learned from observations alone: contacts tell what is wrong, nobody the truth.

Every observation is corrected by `contact-robust`; the errors in the directions that contacts fix are then known, and
the noise that makes them most likely is looked for.

How often a camera repeats what was false when it looks again, counted where there are several looks at one scene.

Looks are at one scene if they state the same parts and start, and if what is seen well in both leads to the same goals.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Observation
from apo_bench.correction.correctors import correct
from apo_bench.correction.learning.likelihood import (
    UNITS,
    EstimatedNumber,
    LearnedNoise,
    ObservedErrors,
    learn_noise,
    readings,
)
from apo_bench.errors import require
from apo_bench.geometry import Array, pose
from apo_bench.io import grouped
from apo_bench.observation.fitting.fit import COMPONENTS, component_factors, view_ways
from apo_bench.observation.models import (
    INLIER_MM,
    TURNED_DEG,
    Camera,
    ConstantError,
    MeasuredNoise,
    Split,
    Tail,
    ViewNoise,
    view_frame,
)

_AS_FAR = 10.0
"""[mm] and [deg]: goals of one scene, each corrected by itself, are no farther apart per axis."""
_PRIOR = 0.5
"""Of either kind, as if it had been counted before (Jeffreys): nothing is certain."""


class JudgedLook(NamedTuple):
    """An observation, what it was corrected to, and what of it is false."""

    seen: Observation
    goals: Array
    """(n, 4, 4), corrected, world frame, [m]."""
    false: frozenset[int]
    """Operations, counted from 0, that were seen, and seen where their part is not."""


class Repeats(NamedTuple):
    """Views that were false and were looked at again."""

    repeated: int
    looked: int

    @property
    def rate(self) -> EstimatedNumber | None:
        """How often the next look repeats what was false, with its 95 % interval; None where none was looked at."""
        from scipy.special import betaincinv

        if not self.looked:
            return None
        yes, no = self.repeated + _PRIOR, self.looked - self.repeated + _PRIOR
        low, high = betaincinv(yes, no, [0.025, 0.975])
        return EstimatedNumber(yes / (yes + no), float(low), float(high))


def repeats(looks: Sequence[JudgedLook], near: Array) -> Repeats:
    """Count what the next look at a scene repeats, in the order that looks are given.

    Args:
        near: (2,), [mm] and [deg] per axis: views that differ by less are the same but for noise.
    """
    again = [
        bool((_sizes(one.seen.goals[k], other.seen.goals[k]) < near).all())
        for alike in grouped((_scene(look.seen), look) for look in looks).values()
        for one, other in pairwise(alike)
        if _is_same(one, other)
        for k in sorted(one.false)
        if other.seen.seen[k]
    ]
    return Repeats(sum(again), len(again))


def _scene(seen: Observation) -> tuple[tuple[str, bytes], ...]:
    return tuple((part, T.tobytes()) for part, T in seen.start.items())


def _is_same(one: JudgedLook, other: JudgedLook) -> bool:
    """Whether what is seen well in both looks leads to the same goals."""
    both = one.seen.seen & other.seen.seen
    well = [k for k in np.flatnonzero(both) if k not in one.false | other.false]
    return bool(well) and all((_sizes(one.goals[k], other.goals[k]) < _AS_FAR).all() for k in well)


def _sizes(T: Array, other: Array) -> Array:
    """How far two poses are apart, root mean square per axis, (2,), [mm] and [deg]."""
    xi = pose.log((pose.inverse(T) @ other)[None])[0] / UNITS
    return np.asarray(np.sqrt(np.square(xi.reshape(2, 3)).mean(axis=1)))


FEWEST_OBSERVATIONS = 5
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
    repeats: Repeats
    """What was false and was looked at again, where several observations are of one scene."""


def learn(observations: Sequence[Observation], camera: Camera, source: str, *, constant: bool = False) -> Learned:
    """The noise of the camera that made these observations, of any assemblies.

    Args:
        camera: Where it stands, for the directions of its rays.
        source: What the noise model says it is of.
        constant: Whether the camera also has an error that is the same in all observations.

    Raises:
        InputError: Too few observations, or too few that can be corrected.
    """
    corrections = [(observation, correct(observation, "contact-robust")) for observation in observations]
    usable = [(observation, correction) for observation, correction in corrections if correction.ok]
    require(
        len(usable) >= FEWEST_OBSERVATIONS,
        f"{len(observations)} observations were given, of which {len(usable)} can be corrected; at least "
        f"{FEWEST_OBSERVATIONS} are needed to learn a camera's noise.",
    )
    P = view_frame(camera, [correction.goals for _, correction in usable])
    # errors that the correction took away, log(T_corrected^-1 T_seen); of each the size in mm and in degrees, (n, 2)
    errors = [pose.log(pose.inverse(c.goals) @ observation.goals) / UNITS for observation, c in usable]
    sizes = [np.sqrt(np.square(xi.reshape(-1, 2, 3)).mean(axis=2)) for xi in errors]
    of_seen = np.concatenate([size[observation.seen] for size, (observation, _) in zip(sizes, usable, strict=True)])
    typical = np.maximum(np.median(of_seen, axis=0), 1e-3)
    evidence = []
    for (observation, correction), size in zip(usable, sizes, strict=True):
        # which operations are grossly wrong is not known: a first guess, and each that differs from it in one
        gross = frozenset(np.flatnonzero((size > _GROSS * typical).any(axis=1) | ~observation.seen).tolist())
        n = len(observation.goals)
        unseen = frozenset(np.flatnonzero(~observation.seen).tolist())
        others = [gross ^ {k} for k in range(n) if k not in unseen]
        F = component_factors(camera, correction.goals, P)
        ways = view_ways(correction.goals, P)
        evidence.append(ObservedErrors(readings(observation, correction.goals, [gross, *others]), F, ways, n, unseen))
    # the likelihood is climbed from what is typical; errors of a whole view are taken for smaller at first
    start = [typical[0 if component.unit == "mm" else 1] for component in COMPONENTS]
    start[4:] = [0.3 * x for x in start[4:]]
    learned = learn_noise(evidence, start, constant)
    gross_of = [list(each.readings[0].gross - each.unseen) for each in evidence]
    far = np.concatenate([size[gross, 0] for size, gross in zip(sizes, gross_of, strict=True)])
    looks = [
        JudgedLook(observation, correction.goals, frozenset(gross))
        for (observation, correction), gross in zip(usable, gross_of, strict=True)
    ]
    operations = sum(each.n for each in evidence)
    missing = sum(len(each.unseen) for each in evidence)
    # a size is a mean per axis: sqrt(3) of it is the length of the shift
    measured = _measured(learned, far * np.sqrt(3.0), source, missing / operations, P)
    return Learned(learned, measured, camera, operations, missing, len(usable), repeats(looks, _GROSS * typical))


def _measured(learned: LearnedNoise, far_mm: Array, source: str, missed: float, P: Array) -> MeasuredNoise:
    across, along, tilt, about, shift, turn = (estimate.value for estimate in learned.deviations)
    limit_mm = max(INLIER_MM, _LIMIT * max(across, along))
    limit_deg = max(TURNED_DEG, _LIMIT * max(tilt, about))
    far_mm = far_mm[far_mm > limit_mm]
    # the distances of outliers are taken for log-uniform from the limit on: the mean logarithm is half of the farthest
    farthest = limit_mm * float(np.exp(2.0 * np.log(far_mm / limit_mm).mean())) if len(far_mm) else 2.0 * limit_mm
    there = any(estimate.low > 0.0 for estimate in learned.deviations[4:])
    return MeasuredNoise(
        source=source,
        shift_mm=Split(Tail(across), Tail(along), limit_mm),
        turn_deg=Split(Tail(tilt), Tail(about), min(limit_deg, 180.0)),
        missed=missed,
        outliers=learned.gross.value,
        farthest_mm=farthest,
        view=ViewNoise(shift, turn) if there else None,
        constant=ConstantError(learned.constant * UNITS, P) if learned.constant.any() else None,
    )
