"""Thresholds of the judge, stated in the scenario and repeated in every record."""

from dataclasses import dataclass
from typing import Literal, final

from apo_bench.arguments import check_arguments

Meaning = Literal["assembled", "as_demonstrated"]
"""What `success` asks for: that the finished assembly is right, or that it was also made as demonstrated."""
MEANINGS: tuple[Meaning, ...] = ("assembled", "as_demonstrated")


@final
@dataclass(frozen=True)
class Thresholds:
    """Lengths in mm, angles in degrees, as in files and records."""

    fit_margin_mm: float = 0.1
    """Strict: a fit contact may be off by the clearance plus this."""
    support_mm: float = 0.1
    """Strict: any other contact may be off by this."""
    overlap_fraction: float = 0.5
    """Strict and loose: the faces overlap by at least this part of the true overlap."""
    penetration_mm: float = 0.05
    """Strict: no two physical geoms of different parts are deeper in each other."""
    placed_part_shift_mm: float = 1.0
    """Strict: no two parts that touch slid against each other by more; as demonstrated: no part that was in place moved
    its centre by more at any later moment, or a corner at the end."""
    rest_mm_s: float = 1.0
    """Strict: every part is slower."""
    rest_deg_s: float = 2.0
    """Strict: every part turns slower."""
    loose_gap_mm: float = 5.0
    """Loose: a contact may be off by this."""
    loose_angle_deg: float = 5.0
    """Loose: the normals of touching faces may be off by this."""


@final
@check_arguments
@dataclass(frozen=True)
class Criteria:
    """The thresholds and the rule by which the judge decides; `Scene.criteria` has those of a scene."""

    thresholds: Thresholds
    """Lengths in mm, angles in degrees, speeds in mm/s and degrees/s."""
    clearance_mm: float
    """Clearance per side of the parts that were used."""
    success_means: Meaning = "assembled"
    """`assembled`: the finished assembly is right; `as_demonstrated`: each contact was also made as demonstrated."""
