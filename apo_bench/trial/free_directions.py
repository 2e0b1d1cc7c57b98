"""Search the free directions of a plan for the nearest target poses at which no failure is predicted: the plan fits.

Free directions are the null space of the contact equations at the target poses. They are scaled by standard deviations
of the observation, so a shorter vector is a likelier plan. Failures are linearised, and the shortest vector that
repairs them is taken; this repeats until nothing fails (least distance problems: Lawson and Hanson, "Solving Least
Squares Problems", 23). If that does not converge, the search restarts at evenly spread points. A point that fits is
then moved back towards the start as far as it fits. After each move the poses are projected back onto all contacts.
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

_SAMPLES = 32
"""Evenly spread points that are measured if the search from the plan fails."""
_STARTS = 4
"""The best of those points, from which the search restarts."""
_TURNS = 5
"""Largest number of linearisations in one search."""
_STEP = 0.05
"""Step of the finite differences, in standard deviations."""
_BEYOND = 0.05
"""Margin below the limit at which a linearised repair aims, since measures are nonlinear [mm]."""
_HALVINGS = 6
"""Bisections on the way back from a point that fits."""
_EXACT_M = 1e-9
"""Contacts with a smaller gap count as closed."""
_SHORTEST = 1e-9
"""The least distance problem has no solution if the last residual is smaller."""

Excess = Callable[[Array], Array]
"""Target poses, (n, 4, 4) -> size less limit of each measure of the plan, (k,), [mm]."""
Fits = Callable[[Array], bool]
"""Whether the plan with these target poses, (n, 4, 4), fits."""


class _FixedDirections(NamedTuple):
    """The contacts that hold at given target poses, to project other poses onto them."""

    system: Equations
    compact: CompactEquations
    """`system` in compact form, for the solver."""
    exact: NDArray[np.bool_]
    """(c,): whether the contact is an equation; the others are inequalities."""
    inequalities: Inequalities
    kept: NDArray[np.bool_]
    """(c,): whether the contact holds at the given poses."""
    limits: Array
    """(c,): largest violation of each contact, [m]."""
    L: Array
    """(n, 6, 6): Cholesky factors of the covariances of the observed poses."""

    def project_to_contacts(self, goals: Array) -> Array | None:
        """The nearest poses, (n, 4, 4), at which every contact holds as well as before; None if none were found."""
        nearest = find_nearest_poses(self.compact.among(self.kept & self.exact), goals, self.L)
        off = compute_violations(self.system, self.exact, self.inequalities, nearest.poses)
        return nearest.poses if nearest.finite and (off <= self.limits)[self.kept].all() else None


@final
@dataclass(frozen=True, eq=False)
class FreeSpace:
    """Target poses that satisfy the contacts, by coordinates s, (f,), in free directions; s = 0 are the given poses."""

    poses: Array
    """(n, 4, 4), at s = 0, world frame, [m]."""
    twists: Array
    """(n, 6, f): the body twists of one standard deviation along each free direction, [m, rad]."""
    held: _FixedDirections

    def __len__(self) -> int:
        return self.twists.shape[2]

    def move_along_tangent(self, s: Array) -> Array:
        """Poses moved along free directions, (n, 4, 4); contacts hold to first order."""
        return np.asarray(self.poses @ pose.exp(self.twists @ s))

    def place(self, s: Array) -> Array | None:
        """`move_along_tangent(s)` projected back onto the contacts; None if the projection fails."""
        return self.held.project_to_contacts(self.move_along_tangent(s))


def find_free_space(observation: Observation, goals: Array) -> FreeSpace | None:
    """The directions that the contacts which hold at target poses, (n, 4, 4), leave free.

    Args:
        observation: Contacts, and the covariance of each pose; operations that were not observed have `UNKNOWN`
            instead.

    Returns:
        None if nothing is free, or if the plan is too large for the solver.

    Raises:
        InputError: A covariance is not positive definite.
    """
    held = _find_fixed_directions(observation, goals)
    nearest = find_nearest_poses(held.compact.among(held.kept & held.exact), goals, held.L)
    # B Z: twists of one standard deviation along the null space Z of the whitened equations
    known = compute_freedom(nearest.Jt)
    if known is None or not known.free.shape[1]:
        return None
    return FreeSpace(goals, unwhiten_twists(nearest.B, known.free), held)


def find_nearest_fitting_poses(space: FreeSpace, fits: Fits, excess: Excess) -> Array | None:
    """Target poses, (n, 4, 4), that fit and are as near as could be found; None if none were found.

    Args:
        fits: The final check, made only if no measure is in excess.
        excess: Size less limit of each measure.
    """
    search = _FitSearch(space, fits, excess)
    s = search.correct_by_gradient(np.zeros(len(space)))
    if s is None:
        s = search.search_samples()
    return None if s is None else space.place(search.approach_start(s))


def list_even_points(dimensions: int) -> Iterator[Array]:
    """`_SAMPLES` points, (f,), evenly spread by a normal distribution, the nearest to 0 first (Roberts' sequence)."""
    from scipy.stats import norm

    # the real root of x^(d+1) = x + 1, by fixed point iteration: Roberts takes its negative powers as steps
    root = 2.0
    for _ in range(30):
        root = (1.0 + root) ** (1.0 / (dimensions + 1))
    steps = root ** -np.arange(1.0, dimensions + 1.0)
    # multiples of the steps modulo 1, mapped to normal quantiles
    points = norm.ppf((0.5 + np.arange(1, _SAMPLES + 1)[:, None] * steps) % 1.0)
    yield from points[np.argsort((points * points).sum(axis=1), kind="stable")]


class _FitSearch(NamedTuple):
    """The search in a free space, by coordinates s, (f,)."""

    space: FreeSpace
    fits: Fits
    excess: Excess

    def fits_at_point(self, s: Array) -> bool:
        """Whether the plan fits at s, after projection onto the contacts."""
        goals = self.space.place(s)
        return goals is not None and bool((self.excess(goals) <= 0.0).all()) and self.fits(goals)

    def correct_by_gradient(self, s: Array) -> Array | None:
        """The nearest point found at which nothing fails, from s on; None if linearised repairs lead to none.

        Each step solves for the shortest vector that repairs every failure linearised so far.
        """
        rows = np.zeros((0, len(s)))
        least = np.zeros(0)
        for _ in range(_TURNS):
            G, h = self._linearised(s)
            rows = np.concatenate([rows, G])
            least = np.concatenate([least, h])
            nearest = find_shortest_above(rows, least) if len(G) else None
            if nearest is None:
                return None
            s = nearest
            if self.fits_at_point(s):
                return s
        return None

    def search_samples(self) -> Array | None:
        """A point that fits, searched from the evenly spread points with the least total excess; None if none fits."""
        points = sorted(list_even_points(len(self.space)), key=self._total_excess)
        fitting_points = (
            point if self.fits_at_point(point) else self.correct_by_gradient(point) for point in points[:_STARTS]
        )
        return next((s for s in fitting_points if s is not None), None)

    def _total_excess(self, s: Array) -> float:
        """Sum of all excesses at s."""
        return float(np.maximum(self.excess(self.space.move_along_tangent(s)), 0.0).sum())

    def approach_start(self, far: Array) -> Array:
        """A point that fits and is nearer to 0 than `far`, which fits.

        Bisection on the line to 0 gives the last point that fits. A new search starts just beyond it, where the plan
        does not fit; its result is taken if it is nearer.
        """
        inside = 1.0
        outside = 0.0
        # bisection between a point that fits and zero, which does not
        for _ in range(_HALVINGS):
            middle = (inside + outside) / 2
            inside, outside = (middle, outside) if self.fits_at_point(middle * far) else (inside, middle)
        back = inside * far
        correct_by_gradient = self.correct_by_gradient(outside * far)
        return (
            back
            if correct_by_gradient is None or correct_by_gradient @ correct_by_gradient > back @ back
            else correct_by_gradient
        )

    def _linearised(self, s: Array) -> tuple[Array, Array]:
        """(G, h) so that each measure in excess at s is repaired to first order where G s' >= h."""
        # forward differences, G_ki = -(e_k(s + d u_i) - e_k(s)) / d: e_k falls to zero where G s' >= G s + e(s)
        now = self.excess(self.space.move_along_tangent(s))
        over = now > 0.0  # only measures in excess are linearised
        ends = [self.excess(self.space.move_along_tangent(s + _STEP * axis))[over] for axis in np.eye(len(s))]
        G = -(np.array(ends).T - now[over][:, None]) / _STEP
        return G, G @ s + now[over] + _BEYOND


def find_shortest_above(G: Array, h: Array) -> Array | None:
    """The shortest x with G x >= h, (f,); None if there is none (Lawson and Hanson, LDP)."""
    from scipy.optimize import nnls

    # u >= 0 that minimises |E u - f| with E = [G^t; h^t] and f = (0, .., 0, 1); then x = -r_1..n / r_n+1 of r = E u - f
    f = np.append(np.zeros(G.shape[1]), 1.0)
    E = np.vstack([G.T, h])
    residual = E @ nnls(E, f)[0] - f
    return None if abs(residual[-1]) < _SHORTEST else np.asarray(-residual[:-1] / residual[-1])


def _find_fixed_directions(observation: Observation, goals: Array) -> _FixedDirections:
    """The contacts that hold at target poses, as equations and inequalities of the `contact` method.

    If some contact does not hold that way, all contacts are plain equations instead.
    """
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
    return _FixedDirections(
        system,
        compact,
        exact,
        inequalities,
        # kept: contacts that do not hold even as plain equations are ignored
        off <= observation.gap_m,
        limits,
        _factor_noise(observation),
    )


def _factor_noise(observation: Observation) -> Array:
    """Cholesky factors L of the observation's covariances, with `UNKNOWN` for operations that were not observed."""
    if observation.observed.all():
        return factor_noise(observation)
    covariance = np.where(observation.observed[:, None, None], observation.covariance, UNKNOWN)
    return factor_noise(
        Observation(observation.assembly, observation.start, observation.poses, covariance, observation.observed)
    )
