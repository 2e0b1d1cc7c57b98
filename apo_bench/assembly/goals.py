"""The numbers that flow, under different names by role, so that a plan cannot be mixed up with the truth.

Goals are one pose per operation, shape (n, 4, 4), world frame, [m]. Parts that start somewhere known have a
`start` pose; for a fixed part that is where it stays.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly.topology import Assembly, Contact
from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array, frozen
from apo_bench.geometry.records import copyable

Poses = Mapping[str, Array]
"""Part name -> pose (4, 4) in the world, [m]."""


def frozen_poses(poses: Poses) -> Poses:
    """A read-only copy."""
    return MappingProxyType({name: frozen(T, 4, 4) for name, T in poses.items()})


@final
@copyable
@dataclass(frozen=True, eq=False)
class Layout:
    """The truth of a trial: the consistent goals a seed draws, before any human error."""

    goals: Array
    start: Poses

    def __post_init__(self) -> None:
        object.__setattr__(self, "goals", frozen(self.goals, None, 4, 4))
        object.__setattr__(self, "start", frozen_poses(self.start))


@final
@copyable
@dataclass(frozen=True, eq=False)
class Demonstration:
    """What the human did, without measurement error."""

    assembly: Assembly
    start: Poses
    goals: Array
    """(n, 4, 4): pose of each operation's main part when the hand had let go of it and it rested."""
    final: Poses
    """Where every part lay at the end: small late adjustments show here and nowhere else."""
    careless: Array
    """(n, 6, 6) covariance [m, rad] that the human's carelessness adds, body frame of each main part."""
    code: str = "ok"
    """`ok`, or `demonstration_failed`."""
    why: str = ""
    """What the judge found wrong, in words."""
    gap_m: float = 1e-4
    """Largest |e| at which the contact equations count as solved, [m]; what observes it passes it on."""
    play_m: float = 0.0
    """Clearance per side of the parts that fit, [m]; what observes it passes it on."""

    def __post_init__(self) -> None:
        n = len(self.assembly)
        object.__setattr__(self, "goals", frozen(self.goals, n, 4, 4))
        object.__setattr__(self, "careless", frozen(self.careless, n, 6, 6))
        object.__setattr__(self, "start", frozen_poses(self.start))
        object.__setattr__(self, "final", frozen_poses(self.final))


@final
@copyable
@dataclass(frozen=True, eq=False)
class Observation:
    """What was seen: all a corrector may use."""

    assembly: Assembly
    start: Poses
    goals: Array
    """(n, 4, 4)."""
    covariance: Array
    """(n, 6, 6), of the body twist by which each goal is wrong, [m, rad]."""
    seen: NDArray[np.bool_]
    """(n,): whether the operation was seen at all."""
    gap_m: float = 1e-4
    """Largest |e| at which the contact equations count as solved, [m]."""
    play_m: float = 0.0
    """How far from nominal a contact of parts that fit may really be: their clearance per side, [m]."""

    def __post_init__(self) -> None:
        n = len(self.assembly)
        object.__setattr__(self, "goals", frozen(self.goals, n, 4, 4))
        object.__setattr__(self, "covariance", frozen(self.covariance, n, 6, 6))
        object.__setattr__(self, "start", frozen_poses(self.start))
        seen = np.array(self.seen, dtype=np.bool_)
        if seen.shape != (n,):
            raise ValueError(f"`seen` needs shape ({n},), {seen.shape} was given")
        seen.flags.writeable = False
        object.__setattr__(self, "seen", seen)

    def plan(self) -> Plan:
        """What was seen, as it is: the plan of the method `none`.

        Raises:
            InputError: An operation was not seen.
        """
        if not self.seen.all():
            raise InputError(
                f"operation {int(np.argmin(self.seen)) + 1} was not seen, so the observation cannot be replayed as is; "
                "observe the demonstration again."
            )
        return Plan(self.assembly, self.start, self.goals)


class Step(NamedTuple):
    """One entry of a schedule: do an operation (counted from 0), or undo it."""

    operation: int
    undo: bool = False


def once_each(n: int) -> tuple[Step, ...]:
    """The plain schedule: every operation once, in order."""
    return tuple(Step(k) for k in range(n))


@final
@copyable
@dataclass(frozen=True, eq=False)
class Plan:
    """What the robot is asked to do."""

    assembly: Assembly
    start: Poses
    goals: Array
    """(n, 4, 4): where every operation puts its main part in the end."""
    schedule: tuple[Step, ...] = field(default=())
    """Empty stands for: every operation once, in order."""
    targets: Array = field(default_factory=lambda: np.zeros((0, 4, 4)))
    """(steps, 4, 4): the motion parameter that was in force at each step of the schedule; of an undo step, the one
    that it undoes. Empty stands for: those of `goals`."""

    def __post_init__(self) -> None:
        n = len(self.assembly)
        object.__setattr__(self, "goals", frozen(self.goals, n, 4, 4))
        object.__setattr__(self, "start", frozen_poses(self.start))
        if not self.schedule:
            object.__setattr__(self, "schedule", once_each(n))
        filled = self.goals[[step.operation for step in self.schedule]]
        targets = self.targets if len(self.targets) else filled
        object.__setattr__(self, "targets", frozen(targets, len(self.schedule), 4, 4))


class Iterate(NamedTuple):
    """One turn of a solver, kept for the reader and the plots."""

    gap_m: float
    """Largest |e| before the step."""
    rank: int
    step: float
    """Length of the scaled step, [m]."""


class Try(NamedTuple):
    """One trial of the iterative correction (Section 4.2)."""

    step: int
    """The operation that had just been observed, counted from 0."""
    free: tuple[int, ...]
    """The operations whose motion parameters were free, most recent first."""
    gap_m: float
    """Largest |e| over the equations of the trial, after solving."""


class Suspect(NamedTuple):
    """A relation, and how well everything else fits without it."""

    relation: str
    """R1, R2, ... as in the relation graph: all contacts of one operation between one pair of parts; or one of them."""
    contacts: tuple[Contact, ...]
    made: int
    """The operation that made it, counted from 0."""
    chi_square: float
    """Squared Mahalanobis length of the correction when its equations are left out."""
    freedom: int
    """Rank of the equations that are left."""
    p_value: float


@final
@dataclass(frozen=True)
class Consistency:
    """The chi-square test of a correction: is it larger than the stated noise explains?"""

    chi_square: float
    """Squared Mahalanobis length of the correction, what is left of contradictory contacts added."""
    freedom: int
    """Degrees of freedom: the rank of the contact equations at the solution."""
    p_value: float
    level: float
    """The test fails if the p-value is below."""
    suspects: tuple[Suspect, ...] = ()
    """Every relation, the most suspect first; looked for only if the test fails."""

    @property
    def passes(self) -> bool:
        return self.p_value >= self.level

    @property
    def ambiguous(self) -> tuple[Suspect, ...]:
        """The ambiguity set: relations without any one of which the test would pass."""
        return tuple(suspect for suspect in self.suspects if suspect.p_value >= self.level)


@final
@copyable
@dataclass(frozen=True, eq=False)
class Correction:
    """What a corrector returns: the goals, and what happened."""

    goals: Array
    status: str
    """`converged`, or one of the endings in `apo_bench.records.outcomes`."""
    sentence: str
    freed: tuple[int, ...]
    """Operations whose motion parameters were free, counted from 0, most recent first."""
    gap_before_m: float
    gap_after_m: float
    rank: int
    trace: tuple[Iterate, ...] = ()
    tried: tuple[Try, ...] = ()
    """Every set of motion parameters that was tried, in order."""
    schedule: tuple[Step, ...] = ()
    """What to do and undo, in order; empty stands for: every operation once."""
    targets: Array | None = None
    """(steps, 4, 4) as in `Plan`; None stands for `goals` throughout."""
    test: Consistency | None = None
    """Whether the stated noise explains the correction; None of correctors that do not ask."""
    test_after: Consistency | None = None
    """The test without the contacts that were left out; None if none was."""
    covariance: Array | None = None
    """(n, 6, 6), of the body twist by which each corrected goal may still be wrong, [m, rad]; None if unknown.
    Contacts that are walls are not counted, so with walls it is an upper bound."""
    dropped: tuple[str, ...] = ()
    """Relations that were left out, since the test named them, or single contacts: `R3: stick.py on castle1.spy`."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "goals", frozen(self.goals, None, 4, 4))
        if self.covariance is not None:
            object.__setattr__(self, "covariance", frozen(self.covariance, len(self.goals), 6, 6))
        if self.targets is not None:
            object.__setattr__(self, "targets", frozen(self.targets, len(self.schedule), 4, 4))

    @property
    def ok(self) -> bool:
        return self.status == "converged"

    def plan(self, observation: Observation) -> Plan:
        """What the robot is to do after this correction of `observation`.

        Raises:
            InputError: The correction did not converge, so its goals are not meant to be executed.
        """
        if not self.ok:
            raise InputError(
                f"the correction ended as {self.status} ({self.sentence}), which no robot should carry out; look at "
                "`correction.ok` first."
            )
        targets = np.zeros((0, 4, 4)) if self.targets is None else self.targets
        return Plan(observation.assembly, observation.start, self.goals, self.schedule, targets)


@final
@copyable
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
        object.__setattr__(self, "poses", frozen_poses(self.poses))


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
class Reached:
    """What the judge looks at: nothing but physics."""

    after: tuple[Snapshot | None, ...]
    """After each operation; None for one that was not finished."""
    final: Snapshot | None
    """None if the simulation became unstable."""


@final
@dataclass(frozen=True, eq=False)
class ReplayResult:
    """One replay: what was reached and how it went."""

    reached: Reached
    outcome: Outcome
    peak_force_n: float
    """Largest net contact force on a part that the robot held (the gripper's own forces excluded)."""
    sim_seconds: float
    timeline: tuple[tuple[Step, float], ...] = ()
    """Each step that was finished, with the simulated time at which it was over, [s]."""
