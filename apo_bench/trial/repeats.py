"""How often a camera repeats what was false when it looks again, counted where there are several looks at one scene.

Looks are at one scene if they state the same parts and start, and if what is seen well in both leads to the same goals.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Observation
from apo_bench.correction.learning.evidence import UNITS
from apo_bench.correction.learning.likelihood import EstimatedNumber
from apo_bench.geometry import Array, pose
from apo_bench.io.grouping import grouped

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
