"""What a human did, without measurement error: the true poses of a trial, before and after the human error."""

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
    """The truth of a trial: the consistent poses a seed draws, before any human error."""

    poses: Array
    start: Poses

    def __post_init__(self) -> None:
        freeze(self, poses=(None, 4, 4), start=(4, 4))


@final
@check_arguments
@make_copyable
@dataclass(frozen=True, eq=False)
class Demonstration:
    """What the human did, without measurement error."""

    assembly: Assembly
    start: Poses
    poses: Array
    """(n, 4, 4): pose of each operation's main part when the hand had let go of it and it rested."""
    final: Poses
    """Where every part lay at the end: small late adjustments show here and nowhere else."""
    human_error_covariance: Array
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
        freeze(self, poses=(n, 4, 4), human_error_covariance=(n, 6, 6), start=(4, 4), final=(4, 4))
        check_parts(self.assembly, self.start, self.final)
