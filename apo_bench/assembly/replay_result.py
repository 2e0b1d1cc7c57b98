"""Result of a replay: the states of the parts, which the judge checks, and how the replay ended."""

from dataclasses import dataclass
from typing import final

from apo_bench.arguments import check_arguments
from apo_bench.assembly.plan import Step
from apo_bench.assembly.poses import Poses
from apo_bench.geometry import freeze, make_copyable


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class Snapshot:
    """The physical state after an operation, or at the end."""

    poses: Poses
    """World poses of all parts, fixed ones too, [m]."""
    penetration_m: float
    """Deepest penetration of two physical geoms of different parts, >= 0."""
    speed_m_s: float
    """Largest speed of the centre of a part."""
    spin_rad_s: float
    """Largest angular speed of a part."""
    released: bool
    """Whether no hand or gripper touches a part."""

    def __post_init__(self) -> None:
        freeze(self, poses=(4, 4))


@final
@dataclass(frozen=True)
class Outcome:
    """How a replay ended, as known to the robot, or a whole trial, as known to the judge."""

    stage: str
    """`done`, or the stage that failed."""
    code: str
    """`ok`, or one of the codes in `apo_bench.records.outcomes`."""
    operation: int | None
    """The operation that failed, counted from 0, or None."""
    sentence: str
    """The outcome in words."""

    @property
    def failed(self) -> bool:
        """Whether any stage failed."""
        return self.stage != "done"


@final
@dataclass(frozen=True, eq=False)
class ReachedState:
    """The input of the judge: physical states only."""

    after: tuple[Snapshot | None, ...]
    """After each operation; None for one that was not finished."""
    final: Snapshot | None
    """None if the simulation became unstable."""


@final
@dataclass(frozen=True)
class SlipInHand:
    """How far a part moved in the hand since it was grasped; pads hold a shaft along two lines only, so it may roll.

    Lengths are those of the point between the pads; angles count any rotation, rolling between the pads too.
    """

    operation: int
    """Counted from 0."""
    carried_m: float
    """Slip when the last motion, to its place, began."""
    carried_rad: float
    """The rotation at that time."""
    moved_m: float
    """Slip when the part was released, or the replay failed; the larger one if the grip was changed."""
    moved_rad: float
    """The rotation at that time."""


@final
@dataclass(frozen=True)
class ProbingResult:
    """The calibration error of a robot as estimated by contact probing, with its uncertainty."""

    touches: int
    """Number of touches that were used."""
    refused: int
    """Number of touches that contradict the others and the stated errors of the robot."""
    mm: float
    """Estimated displacement of the base, at the middle of the poses, [mm]."""
    deg: float
    """Estimated rotation of the base, [deg]."""
    sure_mm: float
    """Standard deviation of the displacement, root of the summed variances, [mm]."""
    sure_deg: float
    """Standard deviation of the rotation, root of the summed variances, [deg]."""


@final
@check_arguments
@dataclass(frozen=True, eq=False)
class ReplayResult:
    """What a replay reached, and how it ended."""

    reached: ReachedState
    """The poses and states of the parts after each operation and at the end, for the judge."""
    outcome: Outcome
    """Stage, code, operation and sentence of the end, as the robot knows it."""
    peak_force_n: float
    """Largest net contact force on a part that the robot held (the gripper's own forces excluded), behind a low-pass
    filter of 20 ms, [N]."""
    sim_time_s: float
    """Simulated time, [s]."""
    timeline: tuple[tuple[Step, float], ...] = ()
    """Each finished step of the schedule with the simulated time of its end, [s]."""
    in_hand: tuple[SlipInHand, ...] = ()
    """How far each grasped part slipped in the gripper; the controller does not know it."""
    probing: ProbingResult | None = None
    """The estimate of the calibration error; None without probing."""
