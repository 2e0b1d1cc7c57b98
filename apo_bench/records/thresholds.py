"""Thresholds of the judge, which a scenario states and every record repeats."""

from dataclasses import dataclass
from typing import Literal, final

from apo_bench.arguments import check_arguments

Meaning = Literal["assembled", "as_demonstrated"]
"""Meaning of `success`: the finished assembly is correct, or every contact was also made as demonstrated."""
MEANINGS: tuple[Meaning, ...] = ("assembled", "as_demonstrated")


@final
@dataclass(frozen=True)
class Thresholds:
    """Thresholds in mm, degrees, mm/s and degrees/s, as in files and records; `strict` ones decide success."""

    fit_margin_mm: float = 0.1
    """Strict: largest gap of a fit contact beyond the clearance."""
    support_mm: float = 0.1
    """Strict: largest gap of any other contact."""
    overlap_fraction: float = 0.5
    """Strict and loose: smallest overlap of two faces as a share of the true overlap."""
    penetration_mm: float = 0.05
    """Strict: largest penetration of physical geoms of different parts."""
    placed_part_shift_mm: float = 1.0
    """Strict: largest sliding of two parts that touch.

    As demonstrated: largest displacement of a placed part's centre at any later moment, or of a corner at the end.
    """
    rest_mm_s: float = 1.0
    """Strict: every part moves more slowly than this."""
    rest_deg_s: float = 2.0
    """Strict: every part turns more slowly than this."""
    loose_gap_mm: float = 5.0
    """Loose: largest gap of a contact."""
    loose_angle_deg: float = 5.0
    """Loose: largest angle between the normals of touching faces."""


@final
@check_arguments
@dataclass(frozen=True)
class Criteria:
    """The thresholds and the rule by which the judge decides; `Scene.criteria` has those of a scene."""

    thresholds: Thresholds
    """Lengths in mm, angles in degrees, speeds in mm/s and degrees/s."""
    clearance_mm: float
    """Clearance per side of the parts in the trial."""
    success_means: Meaning = "assembled"
    """`assembled`: the finished assembly is right; `as_demonstrated`: each contact was also made as demonstrated."""
