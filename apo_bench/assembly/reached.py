"""What a replay reached: the states of the parts, which the judge looks at, and how the replay ended."""

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
    """The physical state when an operation was over, or at the end."""

    poses: Poses
    """Every part, fixed ones too."""
    penetration_m: float
    """Deepest overlap of two physical geoms of different parts, >= 0."""
    speed_m_s: float
    """Fastest centre of a part."""
    spin_rad_s: float
    """Fastest turning part."""
    released: bool
    """Whether no hand or gripper touches a part."""

    def __post_init__(self) -> None:
        freeze(self, poses=(4, 4))


@final
@dataclass(frozen=True)
class Outcome:
    """How a replay ended, as the robot knows it, or a whole trial, as the judge knows it."""

    stage: str
    """`done`, or where it failed."""
    code: str
    """`ok`, or one of the codes in `apo_bench.records.outcomes`."""
    operation: int | None
    """Counted from 0."""
    sentence: str

    @property
    def failed(self) -> bool:
        return self.stage != "done"


@final
@dataclass(frozen=True, eq=False)
class ReachedState:
    """What the judge looks at: nothing but physics."""

    after: tuple[Snapshot | None, ...]
    """After each operation; None for one that was not finished."""
    final: Snapshot | None
    """None if the simulation became unstable."""


@final
@dataclass(frozen=True)
class SlipInHand:
    """How far a part moved in the hand since it was grasped: flat pads hold a shaft along two lines only.

    A length is that of the point between the pads, an angle any turn: rolling between them and turning about them.
    """

    operation: int
    """Counted from 0."""
    carried_m: float
    carried_rad: float
    """When the last motion, to its place, began."""
    moved_m: float
    moved_rad: float
    """When it was let go of, or the replay failed; the larger one where the grip was changed."""


@final
@dataclass(frozen=True)
class ProbingResult:
    """What a robot has found out about itself by touching, and how sure it is."""

    touches: int
    """How many touches were used."""
    refused: int
    """How many contradict the others and what is stated of the robot."""
    mm: float
    deg: float
    """How far the base is assumed to be off, at the middle of the poses."""
    sure_mm: float
    sure_deg: float
    """Standard deviations of that, as root mean squares."""


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
