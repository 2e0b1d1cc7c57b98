"""Free directions of a plan: what contacts do not fix is chosen so that the plan fits, as near as possible to before.

Directions that contacts leave free are the null space of their equations at the goals, in standard deviations of what
was seen, so a shorter vector is a likelier plan. What would fail is linearised there, and the shortest vector that
mends it is taken, again until nothing fails (least distance problems: Lawson and Hanson, "Solving Least Squares
Problems", 23). Where that leads nowhere, it is begun at points of an even spread. From what fits the way back is gone
as far as it fits. After each move the goals are put back onto all contacts.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Equations, Observation, build_contact_equations
from apo_bench.correction.robust.hypotheses import UNKNOWN
from apo_bench.correction.solvers import (
    CompactEquations,
    Inequalities,
    build_compact_equations,
    compute_freedom,
    compute_violations,
    factor_noise,
    find_nearest_poses,
    list_contact_demands,
    unwhiten_twists,
)
from apo_bench.geometry import Array, pose

_TRIED = 32
_BEGUN = 4
"""Places that are looked at where linearising leads nowhere, and how many of them are begun with."""
_TURNS = 5
"""So often what fails is linearised."""
_STEP = 0.05
"""Of a derivative, in standard deviations."""
_BEYOND = 0.05
"""What fails is mended by this more than asked for, since it bends."""
_HALVINGS = 6
_EXACT_M = 1e-9
"""Contacts that hold this well hold as before."""
_SHORTEST = 1e-9

Excess = Callable[[Array], Array]
"""Goals, (n, 4, 4) -> by how much each measure of a plan is too large, (k,)."""
Fits = Callable[[Array], bool]
"""Whether a plan with these goals, (n, 4, 4), fits."""


class _Held(NamedTuple):
    """The contacts that hold at goals, and what puts other goals back onto them."""

    system: Equations
    compact: CompactEquations
    exact: NDArray[np.bool_]
    inequalities: Inequalities
    kept: NDArray[np.bool_]
    limits: Array
    """(c,): how far each contact may be off, [m]."""
    L: Array

    def put_back(self, goals: Array) -> Array | None:
        """The nearest goals at which every contact holds as well as before; None if none were found."""
        nearest = find_nearest_poses(self.compact.among(self.kept & self.exact), goals, self.L)
        off = compute_violations(self.system, self.exact, self.inequalities, nearest.poses)
        return nearest.poses if nearest.finite and (off <= self.limits)[self.kept].all() else None


@final
@dataclass(frozen=True, eq=False)
class FreeSpace:
    """Goals that satisfy the contacts as well as some do, by coordinates s in free directions; there s is 0."""

    poses: Array
    """(n, 4, 4), world frame, [m]."""
    twists: Array
    """(n, 6, f): the body twists of one standard deviation along each free direction, [m, rad]."""
    held: _Held

    def __len__(self) -> int:
        return self.twists.shape[2]

    def tangent(self, s: Array) -> Array:
        """Goals moved along free directions, (n, 4, 4); contacts hold to first order."""
        return np.asarray(self.poses @ pose.exp(self.twists @ s))

    def place(self, s: Array) -> Array | None:
        """The same, put back onto the contacts; None if that cannot be."""
        return self.held.put_back(self.tangent(s))


def free_space(observation: Observation, goals: Array) -> FreeSpace | None:
    """What the contacts that hold at goals, (n, 4, 4), leave free; None if that is nothing, or too much.

    Args:
        observation: Contacts, and how uncertain each goal is; of what was not seen `UNKNOWN`.

    Raises:
        InputError: A covariance is not positive definite.
    """
    held = _held(observation, goals)
    nearest = find_nearest_poses(held.compact.among(held.kept & held.exact), goals, held.L)
    # B Z: twists of one standard deviation along the null space Z of the whitened equations
    known = compute_freedom(nearest.Jt)
    if known is None or not known.free.shape[1]:
        return None
    return FreeSpace(goals, unwhiten_twists(nearest.B, known.free), held)


def nearest_fitting(space: FreeSpace, fits: Fits, excess: Excess) -> Array | None:
    """Goals that fit, (n, 4, 4), as near as could be found; None if none were found.

    Args:
        fits: The last word; only asked where nothing is in excess.
        excess: As long as a number of it is above zero, that measure is too large.
    """
    search = _Search(space, fits, excess)
    s = search.mended(np.zeros(len(space)))
    if s is None:
        s = search.elsewhere()
    return None if s is None else space.place(search.nearer(s))


def even_points(dimensions: int) -> Iterator[Array]:
    """Points (f,) spread evenly as a normal distribution is, the nearest first (Roberts' sequence)."""
    from scipy.stats import norm

    # the real root of x^(d+1) = x + 1, by fixed point iteration: Roberts takes its negative powers as steps
    root = 2.0
    for _ in range(30):
        root = (1.0 + root) ** (1.0 / (dimensions + 1))
    steps = root ** -np.arange(1.0, dimensions + 1.0)
    points = norm.ppf((0.5 + np.arange(1, _TRIED + 1)[:, None] * steps) % 1.0)
    yield from points[np.argsort((points * points).sum(axis=1), kind="stable")]


class _Search(NamedTuple):
    space: FreeSpace
    fits: Fits
    excess: Excess

    def fits_at(self, s: Array) -> bool:
        goals = self.space.place(s)
        return goals is not None and bool((self.excess(goals) <= 0.0).all()) and self.fits(goals)

    def mended(self, s: Array) -> Array | None:
        """The nearest point at which what fails at s, linearised, does not; again from there until it fits."""
        rows = np.zeros((0, len(s)))
        least = np.zeros(0)
        for _ in range(_TURNS):
            G, h = self._linearised(s)
            rows = np.concatenate([rows, G])
            least = np.concatenate([least, h])
            nearest = shortest_above(rows, least) if len(G) else None
            if nearest is None:
                return None
            s = nearest
            if self.fits_at(s):
                return s
        return None

    def elsewhere(self) -> Array | None:
        """A point that fits, begun with at those of an even spread at which least is in excess."""
        points = sorted(even_points(len(self.space)), key=self._much)
        fitting_points = (point if self.fits_at(point) else self.mended(point) for point in points[:_BEGUN])
        return next((s for s in fitting_points if s is not None), None)

    def _much(self, s: Array) -> float:
        return float(np.maximum(self.excess(self.space.tangent(s)), 0.0).sum())

    def nearer(self, far: Array) -> Array:
        """From a point that fits back towards zero as far as it fits, and from there to the nearest that is found."""
        inside = 1.0
        outside = 0.0
        # bisection between a point that fits and zero, which does not
        for _ in range(_HALVINGS):
            middle = (inside + outside) / 2
            inside, outside = (middle, outside) if self.fits_at(middle * far) else (inside, middle)
        back = inside * far
        mended = self.mended(outside * far)
        return back if mended is None or mended @ mended > back @ back else mended

    def _linearised(self, s: Array) -> tuple[Array, Array]:
        """Of each measure that is in excess at s: G s' >= h mends it."""
        # forward differences, G_ki = -(e_k(s + d u_i) - e_k(s)) / d: e_k falls to zero where G s' >= G s + e(s)
        now = self.excess(self.space.tangent(s))
        over = now > 0.0
        ends = [self.excess(self.space.tangent(s + _STEP * axis))[over] for axis in np.eye(len(s))]
        G = -(np.array(ends).T - now[over][:, None]) / _STEP
        return G, G @ s + now[over] + _BEYOND


def shortest_above(G: Array, h: Array) -> Array | None:
    """The shortest x with G x >= h, (f,); None if there is none (Lawson and Hanson, LDP)."""
    from scipy.optimize import nnls

    # u >= 0 that minimises |E u - f| with E = [G^t; h^t] and f = (0, .., 0, 1); then x = -r_1..n / r_n+1 of r = E u - f
    f = np.append(np.zeros(G.shape[1]), 1.0)
    E = np.vstack([G.T, h])
    residual = E @ nnls(E, f)[0] - f
    return None if abs(residual[-1]) < _SHORTEST else np.asarray(-residual[:-1] / residual[-1])


def _held(observation: Observation, goals: Array) -> _Held:
    """The contacts that hold as they are demanded of `contact`, or as equations where some do not hold so."""
    assembly = observation.assembly
    plain = build_contact_equations(assembly, observation.start, goals)
    system, exact, inequalities = list_contact_demands(plain, assembly, observation.play_m)
    off = compute_violations(system, exact, inequalities, goals)
    if (off > observation.gap_m).any():
        none = np.zeros(0)
        system = plain
        exact = np.ones_like(exact)
        inequalities = Inequalities(plain.among(~exact), none, none)
        off = compute_violations(system, exact, inequalities, goals)
    limits = np.maximum(off, _EXACT_M)
    compact = build_compact_equations(system, len(assembly))
    return _Held(
        system,
        compact,
        exact,
        inequalities,
        off <= observation.gap_m,
        limits,
        _factor(observation),
    )


def _factor(observation: Observation) -> Array:
    """L of the observation, as if everything had been seen."""
    if observation.observed.all():
        return factor_noise(observation)
    covariance = np.where(observation.observed[:, None, None], observation.covariance, UNKNOWN)
    return factor_noise(
        Observation(observation.assembly, observation.start, observation.poses, covariance, observation.observed)
    )
