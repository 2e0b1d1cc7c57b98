"""How errors of observations are distributed: what operations share, how far tails reach, how often all is worse.

A camera that is not where it believes and a model whose origin is in the wrong place are errors that operations share.
A shared error is a twist c with a covariance, in a stated frame. It takes what was seen to the truth: as the body twist
of operation k it is A_k c, T_k = T_seen_k exp(A_k c), with

    A_k = Ad(T_seen_k^-1 P)         in a frame P of the world, which holds for errors of any size,
    A_k = Ad of a turn alone        in the axes of P, at the origin of each part (`local`),
    A_k = 1                         in the frame of each part itself (no frame).

A covariance alone says nothing of how often errors are several times as large as usual. Where an observation states its
tails (Student t across a ray and along it, of shifts and of turns), tests and regions are taken from draws of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.errors import require
from apo_bench.geometry import Array, copyable, freeze, pose


@final
@copyable
@dataclass(frozen=True, eq=False)
class SharedError:
    """A part of the errors of some operations that is the same in all of them, or correlated."""

    name: str
    """What is wrong: `camera`, or the name of a part."""
    operations: tuple[int, ...]
    """Those that share it, counted from 0."""
    covariance: Array
    """(6, 6), of the twist c, [m, rad]; a part of the covariance that each of these operations states."""
    frame: Array | None = None
    """(4, 4), P, world, [m]; none stands for the frame of each part."""
    local: bool = False
    """Whether only the axes of `frame` count, at the origin of each part."""
    correlation: Array | None = None
    """(m, m): between the twists of the m operations; none stands for one and the same twist."""

    def __post_init__(self) -> None:
        operations = tuple(int(k) for k in self.operations)
        m = len(operations)
        if m != len(set(operations)) or min(operations, default=0) < 0:
            raise ValueError(f"each operation once, counted from 0, is needed, {operations} was given")
        object.__setattr__(self, "operations", operations)
        freeze(self, covariance=(6, 6), frame=(4, 4), correlation=(m, m))

    def ways(self, goals: Array) -> Array:
        """A_k of the operations that share it, (m, 6, 6); `goals` are those that were seen, (n, 4, 4)."""
        seen = goals[list(self.operations)]
        if self.frame is None:
            return np.broadcast_to(np.eye(6), (len(seen), 6, 6))
        back = pose.inverse(seen) @ self.frame
        if self.local:
            back[:, :3, 3] = 0.0
        return pose.adjoint(back)

    def added(self, goals: Array) -> Array:
        """What it adds to the covariance of the body twists of the operations that share it, (m, 6, 6)."""
        A = self.ways(goals)
        C = A @ self.covariance @ np.swapaxes(A, 1, 2)
        return np.asarray((C + np.swapaxes(C, 1, 2)) / 2)


def joint_covariance(goals: Array, covariance: Array, shared: Sequence[SharedError]) -> Array:
    """The covariance of the body twists of all operations together, (6 n, 6 n), [m, rad].

    Args:
        goals: (n, 4, 4), those that were seen.
        covariance: (n, 6, 6), of each operation by itself.
    """
    n = len(goals)
    joint = np.zeros((n, 6, n, 6))
    six = np.arange(6)
    for error in shared:
        k = np.array(error.operations, dtype=np.intp)
        A = error.ways(goals)
        # The twists of operations k and l are A_k c and A_l c, so their covariance is A_k C A_l^t.
        between = np.einsum("kab,bc,ldc->kald", A, error.covariance, A)
        if error.correlation is not None:
            between *= error.correlation[:, None, :, None]
        joint[np.ix_(k, six, k, six)] += between
    joint[np.arange(n), :, np.arange(n)] = covariance
    whole = joint.reshape(6 * n, 6 * n)
    return np.asarray((whole + whole.T) / 2)


def first_order(m: int, correlation: float) -> NDArray[np.float64]:
    """The correlations of a first-order autoregression, (m, m)."""
    steps = np.arange(m)
    return np.asarray(correlation ** np.abs(steps[:, None] - steps))


_COLUMNS = ((0, 1), (2,), (3, 4), (5,))
"""Of an error (x, y, along; rx, ry, about): across, along, tilt, turn about."""
_ANEW = 100
_SEED = 20


@final
@copyable
@dataclass(frozen=True, eq=False)
class Tails:
    """How the errors of n operations are distributed; numbers in the order across, along, tilt, turn about."""

    frames: Array
    """(n, 3, 3): the axes of errors, in the frame of each part; the third is the one along."""
    scales: Array
    """(4,), of Student t, [m, m, rad, rad]."""
    freedom: Array
    """(4,), its degrees of freedom; 1e9 and more stand for a Gaussian."""
    variances: Array
    """(4,), of one direction of each, within the limits, [m^2, m^2, rad^2, rad^2]."""
    limits: Array
    """(2,): no shift, [m], and no turn, [rad], is longer."""
    joined: bool = False
    """Whether shift and turn are large together, by one number for all six directions."""

    def __post_init__(self) -> None:
        freeze(self, frames=(None, 3, 3), scales=(4,), freedom=(4,), variances=(4,), limits=(2,))
        for name in ("scales", "freedom", "variances", "limits"):
            if not (getattr(self, name) > 0.0).all():
                raise ValueError(f"`{name}` must be above 0, {getattr(self, name).tolist()} was given")

    def draws(self, joint: Array, count: int) -> Array:
        """Body twists of all operations, (count, n, 6), [m, rad]: the same for the same tails, so that what is computed
        of them is a function of what was seen.

        Args:
            joint: (6 n, 6 n), the covariance that is stated; what of it is not of these tails is taken for Gaussian.
        """
        n = len(self.frames)
        numbers = (tuple(getattr(self, name).tolist()) for name in ("scales", "freedom", "limits"))
        unit, plain = _unit_draws(n, count, *numbers, self.joined)
        Q = np.zeros((n, 6, 6))
        Q[:, :3, :3] = Q[:, 3:, 3:] = self.frames
        # What the stated covariance has beyond these tails is drawn as a Gaussian, by its square root V sqrt(w).
        rest = np.array(joint).reshape(n, 6, n, 6)
        own = Q @ np.diag(self.variances[[0, 0, 1, 2, 2, 3]]) @ np.swapaxes(Q, 1, 2)
        rest[np.arange(n), :, np.arange(n)] -= own
        w, V = np.linalg.eigh(rest.reshape(6 * n, 6 * n))
        gaussian = plain.reshape(count, 6 * n) @ (V * np.sqrt(np.maximum(w, 0.0))).T
        return np.asarray((Q @ unit[..., None])[..., 0] + gaussian.reshape(count, n, 6))


@lru_cache(maxsize=32)
def _unit_draws(
    n: int, count: int, scales: tuple[float, ...], freedom: tuple[float, ...], limits: tuple[float, ...], joined: bool
) -> tuple[Array, Array]:
    """Errors in their own axes, and standard normal numbers, (count, n, 6) each."""
    rng = np.random.default_rng(_SEED)

    def error(shape: tuple[int, ...]) -> Array:
        drawn = rng.standard_normal((*shape, 6))
        # Student t with nu degrees of freedom: a normal number over the root of chi^2_nu / nu.
        common = rng.chisquare(freedom[0], shape) / freedom[0] if joined else None
        for columns, scale, nu in zip(_COLUMNS, scales, freedom, strict=True):
            mixed = rng.chisquare(nu, shape) / nu if common is None else common
            drawn[..., list(columns)] *= (scale / np.sqrt(mixed))[..., None]
        return drawn

    errors = error((count, n))
    for half, limit in zip((slice(0, 3), slice(3, 6)), limits, strict=True):
        for _ in range(_ANEW):
            far = np.linalg.norm(errors[..., half], axis=-1) > limit
            if not far.any():
                break
            errors[far, half] = error((int(far.sum()),))[:, half]
    plain = rng.standard_normal((count, n, 6))
    for array in (errors, plain):
        array.setflags(write=False)
    return errors, plain


_LEAST_RATE = 1e-3
"""A rate that is measured as 0 is not known to be smaller."""


@final
@dataclass(frozen=True)
class OutlierModel:
    """Rates and breadths: stated by noise that knows them, assumed otherwise."""

    gross: float = 0.1
    """Part of the operations of which what was seen says nothing."""
    broad: float = 0.03
    """Part that is seen with `times` the stated deviation."""
    times: float = 10.0
    relation: float = 0.001
    """Part of the relations that are wrong."""
    flip: float = 0.25
    """Part of the gross ones of a part that nearly looks the same after some turns that are turned so."""
    stale: float = 0.15
    """Part of the gross ones that are where the part was before."""
    swap: float = 0.1
    """Part of the gross ones that are where another part is, which is seen here in turn."""
    shift: float = 0.2
    """Part of the gross ones that are turned rightly and too near or too far; what is left over has no name."""
    view: float = 0.02
    """How often several operations, one after the other, are displaced together."""
    repeat: float = 0.2
    """How often a later look repeats what was false in the first."""
    camera_m: tuple[float, float, float] | None = None
    """Where the camera stands, world frame, [m]: what is too near or far is so on its ray. None: in any direction."""

    def __post_init__(self) -> None:
        named = (self.flip, self.stale, self.swap, self.shift)
        rates = (self.gross, self.broad, 1.0 - self.gross - self.broad, self.relation, self.view, *named)
        require(
            all(0.0 < rate < 1.0 for rate in rates),
            f"rates of {self.gross!r} gross, {self.broad!r} broad, {self.relation!r} wrong relations, "
            f"{self.flip!r} turned, {self.stale!r} stale, {self.swap!r} exchanged, {self.shift!r} shifted, "
            f"{self.view!r} displaced together were given; all must be above 0, gross and broad together and each "
            "other one below 1.",
        )
        require(sum(named) < 1.0, f"shares of {sum(named):g} of gross observations have a name; give less than 1.")
        require(
            0.0 <= self.repeat < 1.0,
            f"repeat={self.repeat!r} was given; a later look repeats with 0 to less than 1.",
        )
        require(
            1.0 < self.times < np.inf,
            f"times={self.times!r} was given; a broad observation needs a finite number above 1.",
        )

    @property
    def surprises(self) -> tuple[float, float, float]:
        """-2 log of the probability of an inlier, a broad and a gross observation, beside that of an inlier."""
        inlier = 1.0 - self.gross - self.broad
        return 0.0, -2.0 * float(np.log(self.broad / inlier)), -2.0 * float(np.log(self.gross / inlier))

    @property
    def relation_surprise(self) -> float:
        """The same of a wrong relation, beside a right one."""
        return -2.0 * float(np.log(self.relation / (1.0 - self.relation)))


def measured_rates(gross: float, broad: float = OutlierModel.broad, times: float = OutlierModel.times) -> OutlierModel:
    """A model with rates that were measured, kept away from 0 and 1, which no number of measurements proves."""
    gross, broad = (float(np.clip(rate, _LEAST_RATE, 0.49)) for rate in (gross, broad))
    return OutlierModel(gross, broad, times)
