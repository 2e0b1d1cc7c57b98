"""The data of a scenario: parts, operations, grasps, and the variation of layout and human error."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import Array, freeze, make_copyable, pose
from apo_bench.planning.insertion.attach_line import Attach
from apo_bench.records import Meaning, Thresholds


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class Grasp:
    """The place and direction of a grasp on the main part, from above or tilted."""

    point: Array
    """Centre between the fingertips, (3,), part frame, [m]."""
    across: Array
    """Unit vector along which the fingers close, (3,), part frame, horizontal when the part stands at its start."""
    half_width: float | None = None
    """Half the width of the part there, [m]; None if unknown."""
    ahead: Array | None = None
    """Unit vector along which the fingers point, (3,), part frame, square to `across`; None: straight down."""

    def __post_init__(self) -> None:
        freeze(self, point=(3,), across=(3,), ahead=(3,))


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class Shift:
    """A variation of the true pose of an operation: a shift along a direction that no contact fixes."""

    operation: int
    """Counted from 0."""
    axis: Array
    """Unit vector, (3,), in the frame of the main part at its goal."""
    low_m: float
    high_m: float

    def __post_init__(self) -> None:
        freeze(self, axis=(3,))


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class Turn:
    """A variation of the true pose of an operation: a rotation about an axis that no contact fixes."""

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
        """The displacement (4, 4) for an angle, in the frame of the part: P R P^-1, P the translation to the point."""
        there = pose.at(self.point)
        return there @ pose.exp(np.concatenate([np.zeros(3), rad * self.axis])) @ pose.inverse(there)


@final
@dataclass(frozen=True)
class Site:
    """The range of the pose of the assembly on the table, which is drawn uniformly per seed."""

    center_m: tuple[float, float] = (0.0, 0.0)
    spread_m: tuple[float, float] = (0.0, 0.0)
    """Half widths of the range along x and y."""
    yaw_rad: tuple[float, float] = (0.0, 0.0)
    """Lowest and highest rotation about the vertical."""


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class HumanError:
    """The error of the human in one operation: an offset of random sign, with a uniform size between two bounds."""

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
@make_copyable
@dataclass(frozen=True, eq=False)
class Scenario:
    """A task of n operations: parts, contacts, nominal poses, and the variation of layout and human."""

    name: str
    """Short name, or that of the file."""
    title: str
    """The task in a few words."""
    paper: str
    """The place in the paper."""
    human: str
    """The actions and the error of the human, in words."""
    success: str
    """The condition of success, in words."""
    assembly: Assembly
    """Solids, operations and contacts, without poses."""
    part_files: Mapping[str, Path]
    """Part -> its MJCF file."""
    colors: Mapping[str, tuple[float, float, float]]
    """Part -> red, green and blue, from 0 to 1."""
    start: Poses
    """Part -> its pose before the demonstration, (4, 4), world frame, [m]; fixed parts stay there."""
    nominal_poses: Array
    """(n, 4, 4): nominal poses that satisfy every contact, frame of the assembly, [m]."""
    attach: tuple[Attach, ...]
    """The insertion axis of every operation, stated or found."""
    grasps: tuple[Grasp, ...]
    """The grasp of every operation."""
    site: Site
    """The place of the assembly on the table, drawn for each seed."""
    shifts: tuple[Shift, ...]
    """Directions that no contact determines, drawn for each seed."""
    human_error: HumanError | None
    """The error of the human at scale 1; None: the human makes none."""
    thresholds: Thresholds
    """Thresholds of the judge."""
    clearance_mm: float
    """Clearance per side of parts that fit."""
    gap_mm: float
    """Largest |e| at which the contact equations count as solved."""
    success_means: Meaning = "assembled"
    """`assembled`: the finished assembly is right; `as_demonstrated`: each contact was also made as demonstrated."""
    turns: tuple[Turn, ...] = ()
    """Rotations that no contact determines, drawn for each seed after the shifts."""
    follows_site: frozenset[str] = frozenset()
    """Fixed parts that move with the site."""
    source: Path | None = None
    """The scenario file."""

    def __post_init__(self) -> None:
        freeze(self, nominal_poses=(len(self.assembly), 4, 4), start=(4, 4), part_files=None, colors=None)
