"""Correct many observations of one assembly at once: what they share is worked out once, the rest is one array."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from apo_bench.assembly.correction_record import Correction
from apo_bench.assembly.equations import Equations, equations, lies_on
from apo_bench.assembly.goals import Observation
from apo_bench.assembly.topology import Assembly
from apo_bench.correction.admitted import check_observations
from apo_bench.correction.contact import ContactCorrector, contact
from apo_bench.correction.solvers.compact import CompactEquations, compact_equations, moments
from apo_bench.correction.solvers.inequalities import demanded
from apo_bench.correction.solvers.manifold import NearestGoals
from apo_bench.correction.solvers.whitened import scales
from apo_bench.errors import InputError
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array

BATCH = 64
"""Observations that are solved together: more would leave the cache of the processor."""


def correct_many(observations: Sequence[Observation], corrector: ContactCorrector = contact) -> tuple[Correction, ...]:
    """Correct many observations of one assembly at once: as one after the other up to rounding, and faster.

    Args:
        observations: Observations of one and the same assembly with the same start poses and play.

    Raises:
        InputError: They are not, one makes no sense, or a covariance is not positive definite.
    """
    if isinstance(observations, Observation) or not isinstance(observations, Sequence):
        raise InputError("correct_many needs a list of observations; ask `correct` for one, or make a list of them.")
    if not isinstance(corrector, ContactCorrector):
        raise InputError(
            f"correct_many was given {corrector!r}; give a ContactCorrector, such as ContactCorrector('drop')."
        )
    if not observations:
        return ()
    check_observations(observations)
    for i, other in enumerate(observations, start=1):
        if other.assembly is not observations[0].assembly or not _alike(other, observations[0]):
            raise InputError(
                f"observation {i} is of another assembly, start or play than observation 1; "
                "correct those together that share them."
            )
    return tuple(
        made for i in range(0, len(observations), BATCH) for made in _chunk(observations[i : i + BATCH], corrector)
    )


def _chunk(observations: Sequence[Observation], corrector: ContactCorrector) -> list[Correction]:
    goals, L = np.array([one.goals for one in observations]), np.array([scales(one.covariance) for one in observations])
    plain = equations(observations[0].assembly, observations[0].start, observations[0].goals)
    pattern, exact, _ = demanded(plain, observations[0].assembly, observations[0].play_m)
    found = corrector.solver(compact_many(observations[0].assembly, pattern, goals).among(exact), goals, L)
    return [corrector.given(one, _one(found, i)) for i, one in enumerate(observations)]


def compact_many(assembly: Assembly, pattern: Equations, goals: Array) -> CompactEquations:
    """The compact equations of many observations, goals (b, n, 4, 4), each with the vertices that it gives itself.

    Vertices of the environment's face are the same for all; those of the manipulated face are laid onto the other one
    at each observation's own goals, which takes their centre and axes along, since it is an affine map.

    Args:
        pattern: The equations of one of them.
    """
    one = compact_equations(pattern, goals.shape[1])
    contacts = [relation.contact for relation in assembly.relations()]
    laid = np.array([lies_on(assembly, contact) for contact in contacts], dtype=np.bool_)
    points = np.array(np.broadcast_to(one.points, (len(goals), *one.points.shape)))
    if laid.any():
        some = [contact for contact, chosen in zip(contacts, laid, strict=True) if chosen]
        own = moments([assembly.face(contact.manipulated).outline for contact in some])
        back = pose.inverse(one.among(laid).words(goals))
        there = own @ np.swapaxes(back, -1, -2)
        plane = np.array([assembly.face(contact.environment).plane for contact in some])
        points[:, laid] = there
        points[:, laid, :, :3] -= (there @ plane[:, :, None]) * plane[:, None, :3]
    return replace(one, points=points)


def _alike(a: Observation, b: Observation) -> bool:
    return (
        a.play_m == b.play_m
        and a.start.keys() == b.start.keys()
        and all(np.array_equal(T, b.start[part]) for part, T in a.start.items())
    )


def _one(found: NearestGoals, i: int) -> NearestGoals:
    return NearestGoals(
        *(found.goals[i], found.z[i], found.e[i], found.Jt[i], found.B[i], found.at_rest[i], found.finite[i]),
        trace=found.trace,
    )
