"""A baseline: contacts, penetration and prior as penalties, gone down by gradient.

This is how refiners of object poses make an estimate physically plausible: PhysPose (arXiv 2503.23587) and VeREFINE
(arXiv 1909.05730) pull objects to their supports and out of each other, SporeAgent (arXiv 2201.00239) scores both. The
loss, in units of stated standard deviations, is

    sum (e / PENALTY_CONTACT_M)^2 + sum (depth / PENALTY_CONTACT_M)^2 + sum |z_k|^2

with e of every contact ever made, the depth of every two boxes (of no other pieces) of parts in contact, at the time
the contact was made, and z_k = L_k^-1 xi_k. Adam (Kingma and Ba, arXiv 1412.6980) takes `ADAM_STEPS` steps in z, whose
length falls from `LENGTH` to nothing along a quarter of a cosine. It ends there, at rest or not.

Boxes of parts in contact that are inside each other, written as face contact equations.

The deepest corner v of one box behind the side n of the other has e = n D_a^-1 D_b v = -depth, the form of Eq. 26, so
the Jacobian of contacts serves here too. Of the six directions along which two boxes may part, those normal to their
sides, the shortest way out counts; cross products of edges are left aside, and so are pieces that are no boxes.

A baseline: soft contacts and a soft prior in one sum of squares, as a general solver takes them.

The cost is  sum (e / CONTACT_M)^2 + sum |z_k|^2,  with e of every contact ever made and z_k = L_k^-1 xi_k, the twist
of goal k in units of its stated covariance L_k L_k^t. It is minimised by `scipy.optimize.least_squares`: trust region
reflective (Branch, Coleman and Li, 1999), analytic Jacobian, dense, begun at what was seen, until steps, cost or
gradient are below 1e-12, or after `EVALUATIONS`. As contacts are soft they hold within about
CONTACT_M^2 / (standard deviation of the noise) only. Made for some tens of operations: matrices are dense.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Assembly, Correction, Equations, Observation
from apo_bench.assembly.equations import equations
from apo_bench.correction.checks.as_given import as_it_ends
from apo_bench.correction.solvers import Whitened
from apo_bench.correction.solvers.whitened import whitened
from apo_bench.geometry import Array, Box, pose


@final
@dataclass(frozen=True, eq=False)
class Meeting:
    """q pairs of boxes; each may be measured from either side, so every word comes forwards and backwards."""

    words: Equations
    """No equations; 2 w words: D_a^-1 D_b of each arc of the relation graph, then D_b^-1 D_a."""
    word: NDArray[np.intp]
    """(q,): the forward word of each pair."""
    centers: Array
    """(2, q, 3): of the boxes of a and of b, in the frames of their parts, [m]."""
    halves: Array
    """(2, q, 3)."""


def meeting(assembly: Assembly, system: Equations) -> Meeting:
    """Every box of one part with every box of the other, of all parts that an operation brings into contact.

    Args:
        system: All equations, in the order of `assembly.relations()`.
    """
    contacts = [r.contact for r in assembly.relations()]
    first = np.array([arc[0] for arc in assembly.arcs()], np.intp)
    pairs = [
        (w, a, b)
        for w, i in enumerate(first)
        for a in _boxes(assembly, contacts[i].manipulated.part)
        for b in _boxes(assembly, contacts[i].environment.part)
    ]
    letters = system.letters[first]
    inverse = system.inverse[first]
    words = Equations(
        start=system.start,
        letters=np.concatenate([letters, letters[:, ::-1]]),
        inverse=np.concatenate([inverse, ~inverse[:, ::-1]]),
        made=np.tile(system.made[first], 2),
        contact=np.zeros(0, dtype=np.intp),
        plane=np.zeros((0, 4)),
        vertex=np.zeros((0, 4)),
    )
    return Meeting(
        words=words,
        word=np.array([w for w, _, _ in pairs], dtype=np.intp),
        centers=np.array([[a.center for _, a, _ in pairs], [b.center for _, _, b in pairs]]).reshape(2, -1, 3),
        halves=np.array([[a.half for _, a, _ in pairs], [b.half for _, _, b in pairs]]).reshape(2, -1, 3),
    )


def _boxes(assembly: Assembly, part: str) -> list[Box]:
    return [piece for piece in assembly.solids[part].pieces if isinstance(piece, Box)]


def intruding(meetings: Meeting, goals: Array) -> Equations:
    """One equation, with e = -depth, for each two boxes that are inside each other at these goals."""
    T = _between(meetings.words, goals)[meetings.word]
    depth, axis, sign, reversed_ = _shortest(meetings, T)
    inside = np.flatnonzero(depth > 0)
    side = reversed_[inside].astype(np.intp)
    axis = axis[inside]
    sign = sign[inside]
    plane = np.zeros((len(inside), 4))
    rows = np.arange(len(inside))
    plane[rows, axis] = sign
    plane[:, 3] = -sign * meetings.centers[side, inside, axis] - meetings.halves[side, inside, axis]
    R = np.where(side[:, None, None], np.swapaxes(T[inside, :3, :3], 1, 2), T[inside, :3, :3])
    towards = sign[:, None] * R[rows, axis]
    corner = meetings.centers[1 - side, inside] - np.sign(towards) * meetings.halves[1 - side, inside]
    words = meetings.words
    return Equations(
        start=words.start,
        letters=words.letters,
        inverse=words.inverse,
        made=words.made,
        contact=meetings.word[inside] + side * (len(words.letters) // 2),
        plane=plane,
        vertex=np.column_stack([corner, np.ones(len(inside))]),
    )


def _between(words: Equations, goals: Array) -> Array:
    """D_a^-1 D_b of every arc, (w, 4, 4)."""
    half = len(words.letters) // 2
    F = np.concatenate([words.start, goals, np.eye(4)[None]])[words.letters[:half]]
    F = np.where(words.inverse[:half, :, None, None], pose.inverse(F), F)
    T = np.broadcast_to(np.eye(4), (half, 4, 4))
    for j in range(F.shape[1]):
        T = T @ F[:, j]
    return np.asarray(T)


def _shortest(meetings: Meeting, T: Array) -> tuple[Array, NDArray[np.intp], Array, NDArray[np.bool_]]:
    """Depth along the shortest way out, (q,), its axis, its sign, and whether it is a side of b that is left behind."""
    a, b = meetings.centers
    half_a, half_b = meetings.halves
    R = T[:, :3, :3]
    # Middles of b seen from a, and of a from b; a box reaches |R| half along the axes of the other one.
    way_a = np.einsum("qij,qj->qi", R, b) + T[:, :3, 3] - a
    way_b = -np.einsum("qij,qi->qj", R, way_a)
    spread = np.abs(R)
    depth_a = half_a + np.einsum("qij,qj->qi", spread, half_b) - np.abs(way_a)
    depth_b = half_b + np.einsum("qij,qi->qj", spread, half_a) - np.abs(way_b)
    depth = np.concatenate([depth_a, depth_b], axis=1)
    best = depth.argmin(axis=1)
    rows = np.arange(len(depth))
    way = np.concatenate([way_a, way_b], axis=1)[rows, best]
    return depth[rows, best], best % 3, np.where(way < 0, -1.0, 1.0), best >= 3


PENALTY_CONTACT_M = 1e-4
"""Gap or depth that costs as much as one standard deviation of noise, tuned on seeds that no table uses."""
ADAM_STEPS = 600
LENGTH = 0.2
"""Step of Adam at the beginning, in standard deviations, tuned likewise."""
_MEAN = 0.9
_SQUARE = 0.999
_TINY = 1e-8
"""Adam's memory of the gradient and of its square, as its authors recommend, and what keeps it from dividing by 0."""


def penalty(observation: Observation, *, contact_m: float = PENALTY_CONTACT_M, length: float = LENGTH) -> Correction:
    """The goals at which the descent ends.

    Args:
        contact_m: Gap or depth that costs as much as one standard deviation of noise, [m].
        length: Step of Adam at the beginning, in standard deviations.

    Returns:
        `converged` with the gap that is left in the sentence, since it is meant to be executed as it is; or `not_seen`.

    Raises:
        InputError: A covariance is not positive definite.
    """
    return as_it_ends(
        observation,
        lambda observation: _descended(observation, contact_m, length),
        f"the descent ended after {ADAM_STEPS} steps",
    )


@final
@dataclass(frozen=True, eq=False)
class Loss:
    """What is gone down, as a function of z."""

    space: Whitened
    contacts: Equations
    meetings: Meeting
    contact_m: float

    def __call__(self, z: Array) -> tuple[float, Array]:
        """The loss and its gradient, (6 n,)."""
        goals = self.space.goals(z)
        value = float(z @ z)
        gradient = 2 * z
        for system in (self.contacts, intruding(self.meetings, goals)):
            e, J = system.linearised(goals)
            value += float(e @ e) / self.contact_m**2
            gradient = gradient + 2 * (e @ self.space.pulled(z, J)) / self.contact_m**2
        return value, gradient


def loss(observation: Observation, contact_m: float = PENALTY_CONTACT_M) -> Loss:
    """The loss of an observation."""
    system = equations(observation.assembly, observation.start, observation.poses)
    return Loss(whitened(observation), system, meeting(observation.assembly, system), contact_m)


def _descended(observation: Observation, contact_m: float, length: float) -> Array:
    down = loss(observation, contact_m)
    z = np.zeros(6 * len(observation.poses))
    m = np.zeros_like(z)
    v = np.zeros_like(z)
    for t in range(1, ADAM_STEPS + 1):
        _, g = down(z)
        m = _MEAN * m + (1 - _MEAN) * g
        v = _SQUARE * v + (1 - _SQUARE) * g**2
        step = length * np.cos(0.5 * np.pi * t / ADAM_STEPS)
        z = z - step * (m / (1 - _MEAN**t)) / (np.sqrt(v / (1 - _SQUARE**t)) + _TINY)
    return down.space.goals(z)


CONTACT_M = 1e-6
"""Stated standard deviation of a contact, tuned."""
_TOLERANCE = 1e-12
EVALUATIONS = 300


def least_squares(observation: Observation, *, contact_m: float = CONTACT_M) -> Correction:
    """The goals with the least sum of squares.

    Args:
        contact_m: Standard deviation of e, [m].

    Returns:
        `converged` with the gap that is left in the sentence, or `not_seen`; `not_finite` if a number overflowed.

    Raises:
        InputError: A covariance is not positive definite.
    """
    return as_it_ends(
        observation, lambda observation: _solved(observation, contact_m), "the least sum of squares was looked for"
    )


def _solved(observation: Observation, contact_m: float) -> Array:
    from scipy.optimize import least_squares as minimised

    space = whitened(observation)
    system = equations(observation.assembly, observation.start, observation.poses)
    prior = np.eye(6 * len(observation.poses))

    def residual(z: Array) -> Array:
        return np.concatenate([system.residual(space.goals(z)) / contact_m, z])

    def jacobian(z: Array) -> Array:
        _, J = system.linearised(space.goals(z))
        return np.concatenate([space.pulled(z, J) / contact_m, prior])

    settings = {"xtol": _TOLERANCE, "ftol": _TOLERANCE, "gtol": _TOLERANCE, "max_nfev": EVALUATIONS}
    return space.goals(minimised(residual, np.zeros(len(prior)), jacobian, method="trf", **settings).x)
