"""Observed poses of a demonstration with their stated noise: all that a corrector may use."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.arguments import check_arguments
from apo_bench.assembly.heavy_tails import Tails
from apo_bench.assembly.outlier_model import OutlierModel
from apo_bench.assembly.plan import Plan
from apo_bench.assembly.poses import Poses, check_parts
from apo_bench.assembly.shared_error import SharedError
from apo_bench.assembly.topology import Assembly
from apo_bench.errors import ArgumentError, require
from apo_bench.geometry import Array, freeze, make_copyable


@final
@check_arguments
@make_copyable
@dataclass(frozen=True, eq=False)
class Observation:
    """What was observed of a demonstration of n operations: all that a corrector may use."""

    assembly: Assembly
    """Solids, operations and contacts, without poses."""
    start: Poses
    """Part -> its pose before the first operation, (4, 4), world frame, [m]."""
    poses: Array
    """(n, 4, 4): the observed pose of the main part after each operation, world frame, [m]."""
    covariance: Array
    """(n, 6, 6), of the error of each pose as a twist in the frame of the part, [m, rad]."""
    observed: NDArray[np.bool_]
    """(n,): whether the operation was observed; the pose of an operation that was not is ignored."""
    gap_m: float = 1e-4
    """Largest |e| at which the contact equations count as solved, [m]."""
    play_m: float = 0.0
    """Clearance per side of parts that fit, [m]: how far a contact may be from nominal."""
    outliers: OutlierModel | None = None
    """How often errors are larger than `covariance` states; None if that is unknown."""
    shared: tuple[SharedError, ...] = ()
    """The part of the errors that operations have in common, included in `covariance`; empty: independent errors."""
    tails: Tails | None = None
    """The distribution of the errors; None: Gaussian."""

    def __post_init__(self) -> None:
        n = len(self.assembly)
        freeze(self, poses=(n, 4, 4), covariance=(n, 6, 6), start=(4, 4))
        check_parts(self.assembly, self.start)
        object.__setattr__(self, "shared", tuple(self.shared))
        for error in self.shared:
            if max(error.operations, default=-1) >= n:
                raise ArgumentError(
                    f"the shared error '{error.name}' names operation {max(error.operations) + 1} of {n}"
                )
        if self.tails is not None and len(self.tails.frames) != n:
            raise ArgumentError(f"tails of {len(self.tails.frames)} operations were given for {n}")
        observed = np.array(self.observed, dtype=np.bool_)
        if observed.shape != (n,):
            raise ArgumentError(f"`observed` needs shape ({n},), {observed.shape} was given")
        observed.flags.writeable = False
        object.__setattr__(self, "observed", observed)

    def plan(self) -> Plan:
        """Return the plan of the method `uncorrected`: the observed poses as targets.

        Raises:
            InputError: An operation was not observed.
        """
        require(
            self.observed.all(),
            f"operation {int(np.argmin(self.observed)) + 1} was not seen, so the observation cannot be replayed as is; "
            "observe the demonstration again.",
        )
        return Plan(self.assembly, self.start, self.poses)
