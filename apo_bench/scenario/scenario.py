"""A scenario: one demonstration as a recipe. Files are read by `apo_bench.scenario.file`.

How a human's error spreads: what is put against a displaced part is displaced alike, until someone sees it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, final

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Assembly, Layout, Operation, Poses, placements, touched_contacts
from apo_bench.geometry import Array, copyable, freeze, pose
from apo_bench.insertion.arrival import Attach
from apo_bench.records import Meaning, Thresholds


@final
@copyable
@dataclass(frozen=True, eq=False)
class Grasp:
    """Where the gripper holds the main part, from above or tilted."""

    point: Array
    """Centre between the fingertips, (3,), part frame, [m]."""
    across: Array
    """Unit vector along which the fingers close, (3,), part frame, horizontal when the part stands at its start."""
    half_width: float | None = None
    """Of what is held there, [m], where that is known."""
    ahead: Array | None = None
    """Unit vector along which the fingers point, (3,), part frame, square to `across`; None: straight down."""

    def __post_init__(self) -> None:
        freeze(self, point=(3,), across=(3,), ahead=(3,))


@final
@copyable
@dataclass(frozen=True, eq=False)
class Shift:
    """How far the truth of an operation may vary along a direction that no contact fixes."""

    operation: int
    """Counted from 0."""
    axis: Array
    """Unit vector, (3,), in the frame of the main part at its goal."""
    low_m: float
    high_m: float

    def __post_init__(self) -> None:
        freeze(self, axis=(3,))


@final
@copyable
@dataclass(frozen=True, eq=False)
class Turn:
    """How far the truth of an operation may turn about an axis, where no contact fixes that."""

    operation: int
    """Counted from 0."""
    axis: Array
    """Unit vector, (3,), in the frame of the main part at its goal."""
    point: Array
    """A point of the axis, (3,), in that frame, [m]."""
    low_rad: float
    high_rad: float

    def __post_init__(self) -> None:
        freeze(self, axis=(3,), point=(3,))

    def by(self, rad: float) -> Array:
        """The turn by an angle, (4, 4), in the frame of the part: T = P R P^-1 with P to the point."""
        there = pose.at(self.point)
        return there @ pose.exp(np.concatenate([np.zeros(3), rad * self.axis])) @ pose.inverse(there)


@final
@dataclass(frozen=True)
class Site:
    """The place of the assembly: a rigid planar pose, drawn uniformly per seed."""

    center_m: tuple[float, float] = (0.0, 0.0)
    spread_m: tuple[float, float] = (0.0, 0.0)
    """Half widths."""
    yaw_rad: tuple[float, float] = (0.0, 0.0)
    """Lowest and highest turn about the vertical."""


@final
@copyable
@dataclass(frozen=True, eq=False)
class Carelessness:
    """What the human gets wrong: an offset of random sign, its size uniform between two bounds."""

    operation: int
    """Counted from 0."""
    axis: Array
    """Unit vector, (3,), in the frame of the main part at its goal."""
    low_m: float
    high_m: float

    def __post_init__(self) -> None:
        freeze(self, axis=(3,))

    @property
    def rms_m(self) -> float:
        """Root mean square of the offset: E x^2 of a uniform size is (a^2 + ab + b^2) / 3."""
        a = self.low_m
        b = self.high_m
        return float(np.sqrt((a * a + a * b + b * b) / 3.0))


@final
@check_arguments
@copyable
@dataclass(frozen=True, eq=False)
class Scenario:
    """One demonstration: topology, nominal goals, and how its truth and its human vary."""

    name: str
    title: str
    paper: str
    """Where it stands in the paper."""
    human: str
    """What the human does and gets wrong, in words."""
    success: str
    """When it is right, in words."""
    assembly: Assembly
    part_files: Mapping[str, Path]
    colors: Mapping[str, tuple[float, float, float]]
    start: Poses
    """Where every part stands before the demonstration; fixed parts stay there. World frame."""
    goals: Array
    """(n, 4, 4): the nominal goals, consistent with every contact; frame of the assembly."""
    attach: tuple[Attach, ...]
    """The line of every operation, stated or found (`apo_bench.insertion`)."""
    grasps: tuple[Grasp, ...]
    site: Site
    shifts: tuple[Shift, ...]
    careless: Carelessness | None
    thresholds: Thresholds
    clearance_mm: float
    gap_mm: float
    """Largest |e| at which the contact equations count as solved."""
    success_means: Meaning = "assembled"
    """What the judge calls a success: that the finished assembly is right, or that it was made as demonstrated."""
    turns: tuple[Turn, ...] = ()
    """What may turn in each layout; drawn after the shifts."""
    follows_site: frozenset[str] = frozenset()
    """Fixed parts whose start is in the frame of the assembly, so that the site moves them too."""

    def __post_init__(self) -> None:
        freeze(self, goals=(len(self.assembly), 4, 4), start=(4, 4), part_files=None, colors=None)


NOTHING_M = 1e-9
"""A part that is displaced by less is where it should be."""
_SWEEPS = 40
_AGREED_M = 1e-12
"""Walls that are not at right angles to each other are followed in turn, so often, until all agree to within this."""

_Displaced = dict[str, Array]
"""Part -> how far it lies from its true place, (3,), world, [m]."""


class ErrorSpread(NamedTuple):
    """The error that each operation inherits from a careless one."""

    offsets: Array
    """(n, 3): how far each operation puts its main part from its goal, in the frame of that part, [m]."""
    left: tuple[str, ...]
    """Parts that the last operation would leave displaced, in the order in which they were put down."""


def spread_error(scenario: Scenario, layout: Layout, offset: Array) -> ErrorSpread:
    """Follow an error of the careless operation through the demonstration.

    A later part whose contact with a displaced one has a normal along the displacement goes along with it, by that
    component: it is guided by the face. Where no contact says otherwise a part goes to its true place. The last
    operation shows what is wrong, so it follows nothing.

    Args:
        offset: (3,), [m], in the frame of the main part of the careless operation.
    """
    assembly = scenario.assembly
    offsets = np.zeros((len(assembly), 3))
    displaced = _Displaced()
    left = ()
    if scenario.careless is None or not offset.any():
        return ErrorSpread(offsets, left)
    stages = (layout.start, *placements(assembly, layout.start, layout.goals))
    for k, operation in enumerate(assembly.operations):
        R = layout.goals[k][:3, :3]
        if k == scenario.careless.operation:
            offsets[k] = offset
        elif k < len(assembly) - 1:
            offsets[k] = R.T @ _guided(assembly, operation, stages[k + 1], displaced)
        displaced = _displaced(operation, R @ stages[k][operation.main][:3, :3].T, R @ offsets[k], displaced)
    return ErrorSpread(offsets, tuple(part for part in displaced if part != assembly.operations[-1].main))


def careless_covariance(scenario: Scenario, careless: float) -> Array:
    """(n, 6, 6) [m^2]: the mean square of each operation's error along its own direction, zero where there is none."""
    covariance = np.zeros((len(scenario.assembly), 6, 6))
    if scenario.careless is not None:
        rms = careless * scenario.careless.rms_m
        way = spread_error(scenario, Layout(scenario.goals, scenario.start), scenario.careless.axis).offsets
        covariance[:, :3, :3] = rms**2 * np.einsum("ni,nj->nij", way, way)
    return covariance


def _guided(assembly: Assembly, operation: Operation, poses: Poses, displaced: _Displaced) -> Array:
    """How far the faces of displaced parts lead a part astray, (3,), world, [m]."""
    led = np.zeros(3)
    touched = touched_contacts(assembly, operation.contacts, operation.moves, poses)
    guides = [each for each in touched if each.rests in displaced]
    for _ in range(_SWEEPS):
        for each in guides:
            led += each.normal * (each.normal @ (displaced[each.rests] - led))
        if all(abs(each.normal @ (displaced[each.rests] - led)) < _AGREED_M for each in guides):
            break
    return led


def _displaced(operation: Operation, turn: Array, error: Array, before: _Displaced) -> _Displaced:
    """What is displaced after an operation that turned its parts and put the main one `error` from its goal."""
    main = before.get(operation.main, np.zeros(3))
    after = {**before, operation.main: error}
    for part in operation.carries:
        after[part] = turn @ (before.get(part, np.zeros(3)) - main) + error
    return {part: by for part, by in after.items() if np.linalg.norm(by) > NOTHING_M}
