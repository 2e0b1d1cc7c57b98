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

from apo_bench.assembly.outlier_model import OutlierModel
from apo_bench.assembly.shared_error import SharedError
from apo_bench.assembly.tails import Tails
from apo_bench.assembly.topology import Assembly
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
    outliers: OutlierModel | None = None
    """How often observations of this kind are worse than they say; None if that is not known."""
    shared: tuple[SharedError, ...] = ()
    """What errors of operations have in common, all of it within `covariance`; none: they are independent."""
    tails: Tails | None = None
    """How errors are distributed; None: as a Gaussian's."""

    def __post_init__(self) -> None:
        n = len(self.assembly)
        object.__setattr__(self, "goals", frozen(self.goals, n, 4, 4))
        object.__setattr__(self, "covariance", frozen(self.covariance, n, 6, 6))
        object.__setattr__(self, "shared", tuple(self.shared))
        for one in self.shared:
            if max(one.operations, default=-1) >= n:
                raise ValueError(f"the shared error '{one.name}' names operation {max(one.operations) + 1} of {n}")
        if self.tails is not None and len(self.tails.frames) != n:
            raise ValueError(f"tails of {len(self.tails.frames)} operations were given for {n}")
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
