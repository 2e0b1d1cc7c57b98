"""Propagate a human error: later parts that are placed against a displaced part are displaced too."""

from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Layout, Operation, Poses, compute_placements, find_touched_contacts
from apo_bench.geometry import Array
from apo_bench.scenario.scenario import Scenario

NEGLIGIBLE_M = 1e-9
"""A smaller displacement counts as none."""
_SWEEPS = 40
"""Largest number of sweeps over the guiding faces; oblique faces need several until they agree."""
_CONVERGED_M = 1e-12
"""The sweeps end when all guiding faces agree within this."""

_Displaced = dict[str, Array]
"""Part -> displacement from its true position, (3,), world, [m]."""


class ErrorSpread(NamedTuple):
    """The displacements that follow from one wrong operation."""

    offsets: Array
    """(n, 3): displacement of the main part of each operation from its goal, in the frame of that part, [m]."""
    left: tuple[str, ...]
    """Parts, other than that of the last operation, that are displaced at the end, in the order of placing."""


def spread_error(scenario: Scenario, layout: Layout, offset: Array) -> ErrorSpread:
    """Propagate the human error through the demonstration.

    A face of a displaced part guides a later part: it displaces that part by the component along the normal. Without
    such a contact a part goes to its true place. The last operation is never displaced, so that the error shows.

    Args:
        layout: The true poses.
        offset: (3,), [m], error of the wrong operation, in the frame of its main part.
    """
    assembly = scenario.assembly
    offsets = np.zeros((len(assembly), 3))
    displaced = _Displaced()
    left = ()
    if scenario.human_error is None or not offset.any():
        return ErrorSpread(offsets, left)
    stages = (layout.start, *compute_placements(assembly, layout.start, layout.poses))
    for k, operation in enumerate(assembly.operations):
        R = layout.poses[k][:3, :3]
        if k == scenario.human_error.operation:
            offsets[k] = offset
        elif k < len(assembly) - 1:
            offsets[k] = R.T @ _measure_guided_shift(assembly, operation, stages[k + 1], displaced)
        # R @ R_before^t: rotation of the main part by this operation, world.
        displaced = _displace_parts(operation, R @ stages[k][operation.main][:3, :3].T, R @ offsets[k], displaced)
    return ErrorSpread(offsets, tuple(part for part in displaced if part != assembly.operations[-1].main))


def compute_human_error_covariance(scenario: Scenario, human_error_scale: float) -> Array:
    """The covariance (n, 6, 6) [m^2] of the body twists that the human error gives each operation.

    It is the mean square of the displacement along its direction, and zero for operations without one.
    """
    covariance = np.zeros((len(scenario.assembly), 6, 6))
    if scenario.human_error is not None:
        rms = human_error_scale * scenario.human_error.rms_m
        way = spread_error(scenario, Layout(scenario.nominal_poses, scenario.start), scenario.human_error.axis).offsets
        covariance[:, :3, :3] = rms**2 * np.einsum("ni,nj->nij", way, way)
    return covariance


def _measure_guided_shift(assembly: Assembly, operation: Operation, poses: Poses, displaced: _Displaced) -> Array:
    """Return the displacement of a part that is guided by faces of displaced parts, (3,), world, [m]."""
    shift = np.zeros(3)
    touched = find_touched_contacts(assembly, operation.contacts, operation.moves, poses)
    guides = [each for each in touched if each.rests in displaced]
    # Project onto one face after the other, until all agree.
    for _ in range(_SWEEPS):
        for each in guides:
            shift += each.normal * (each.normal @ (displaced[each.rests] - shift))
        if all(abs(each.normal @ (displaced[each.rests] - shift)) < _CONVERGED_M for each in guides):
            break
    return shift


def _displace_parts(operation: Operation, turn: Array, error: Array, before: _Displaced) -> _Displaced:
    """The displaced parts after an operation.

    Args:
        turn: (3, 3), rotation of the moved parts by the operation, world.
        error: (3,), displacement of the main part from its goal, world, [m].
        before: The displaced parts before the operation.
    """
    main = before.get(operation.main, np.zeros(3))
    after = {**before, operation.main: error}
    for part in operation.carries:
        after[part] = turn @ (before.get(part, np.zeros(3)) - main) + error
    return {part: by for part, by in after.items() if np.linalg.norm(by) > NEGLIGIBLE_M}
