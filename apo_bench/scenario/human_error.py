"""The spread of a human error to parts that are put against a displaced one."""

from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Layout, Operation, Poses, compute_placements, find_touched_contacts
from apo_bench.geometry import Array
from apo_bench.scenario.scenario import Scenario

NOTHING_M = 1e-9
"""A part that is displaced by less is where it should be."""
_SWEEPS = 40
_AGREED_M = 1e-12
"""Walls that are not at right angles to each other are followed in turn, so often, until all agree to within this."""

_Displaced = dict[str, Array]
"""Part -> how far it lies from its true place, (3,), world, [m]."""


class ErrorSpread(NamedTuple):
    """The error that each operation inherits from a wrong one."""

    offsets: Array
    """(n, 3): how far each operation puts its main part from its goal, in the frame of that part, [m]."""
    left: tuple[str, ...]
    """Parts that the last operation would leave displaced, in the order in which they were put down."""


def spread_error(scenario: Scenario, layout: Layout, offset: Array) -> ErrorSpread:
    """Follow the human error through the demonstration.

    A later part whose contact with a displaced one has a normal along the displacement goes along with it, by that
    component: it is guided by the face. Where no contact says otherwise a part goes to its true place. The last
    operation shows what is wrong, so it follows nothing.

    Args:
        offset: (3,), [m], in the frame of the main part of the wrong operation.
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
            offsets[k] = R.T @ _guided(assembly, operation, stages[k + 1], displaced)
        displaced = _displaced(operation, R @ stages[k][operation.main][:3, :3].T, R @ offsets[k], displaced)
    return ErrorSpread(offsets, tuple(part for part in displaced if part != assembly.operations[-1].main))


def compute_human_error_covariance(scenario: Scenario, human_error_scale: float) -> Array:
    """(n, 6, 6) [m^2]: the mean square of each operation's error along its own direction, zero where there is none."""
    covariance = np.zeros((len(scenario.assembly), 6, 6))
    if scenario.human_error is not None:
        rms = human_error_scale * scenario.human_error.rms_m
        way = spread_error(scenario, Layout(scenario.nominal_poses, scenario.start), scenario.human_error.axis).offsets
        covariance[:, :3, :3] = rms**2 * np.einsum("ni,nj->nij", way, way)
    return covariance


def _guided(assembly: Assembly, operation: Operation, poses: Poses, displaced: _Displaced) -> Array:
    """Return how far the faces of displaced parts guide a part off its place, (3,), world, [m]."""
    shift = np.zeros(3)
    touched = find_touched_contacts(assembly, operation.contacts, operation.moves, poses)
    guides = [each for each in touched if each.rests in displaced]
    for _ in range(_SWEEPS):
        for each in guides:
            shift += each.normal * (each.normal @ (displaced[each.rests] - shift))
        if all(abs(each.normal @ (displaced[each.rests] - shift)) < _AGREED_M for each in guides):
            break
    return shift


def _displaced(operation: Operation, turn: Array, error: Array, before: _Displaced) -> _Displaced:
    """What is displaced after an operation that turned its parts and put the main one `error` from its goal."""
    main = before.get(operation.main, np.zeros(3))
    after = {**before, operation.main: error}
    for part in operation.carries:
        after[part] = turn @ (before.get(part, np.zeros(3)) - main) + error
    return {part: by for part, by in after.items() if np.linalg.norm(by) > NOTHING_M}
