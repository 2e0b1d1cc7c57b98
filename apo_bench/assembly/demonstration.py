"""True poses of a trial, without measurement error: the intended layout, and the demonstration after human error."""

from dataclasses import dataclass
from typing import final

from apo_bench.arguments import check_arguments
from apo_bench.assembly.poses import Poses, check_parts
from apo_bench.assembly.topology import Assembly
from apo_bench.geometry import Array, freeze, make_copyable


@final
@check_arguments
@make_copyable
@dataclass(frozen=True, eq=False)
class Layout:
    """The true poses of a trial before any human error; every contact of the scenario holds."""

    poses: Array
    """(n, 4, 4): the target of the main part of each operation, world frame, [m]."""
    start: Poses
    """Part -> its pose before the first operation, (4, 4), world frame, [m]."""

    def __post_init__(self) -> None:
        freeze(self, poses=(None, 4, 4), start=(4, 4))


@final
@check_arguments
@make_copyable
@dataclass(frozen=True, eq=False)
class Demonstration:
    """The true poses of a demonstration of n operations, without measurement error."""

    assembly: Assembly
    """Solids, operations and contacts, without poses."""
    start: Poses
    """Part -> its pose before the first operation, (4, 4), world frame, [m]."""
    poses: Array
    """(n, 4, 4): the pose of the main part of each operation, released and at rest, world frame, [m]."""
    final: Poses
    """Part -> its pose at the end, (4, 4); late adjustments by the human show only here."""
    human_error_covariance: Array
    """(n, 6, 6): covariance of the human error, as a twist in the frame of each main part, [m, rad]."""
    code: str = "ok"
    """`ok`, or `demonstration_failed`."""
    why: str = ""
    """The fault that the judge found, in words; empty if there is none."""
    gap_m: float = 1e-4
    """Largest |e| at which the contact equations count as solved, [m]; observations of it have the same."""
    play_m: float = 0.0
    """Clearance per side of the parts that fit, [m]; observations of it have the same."""

    def __post_init__(self) -> None:
        n = len(self.assembly)
        freeze(self, poses=(n, 4, 4), human_error_covariance=(n, 6, 6), start=(4, 4), final=(4, 4))
        check_parts(self.assembly, self.start, self.final)
