"""What a user may state about an assembly; the import chooses the rest."""

from dataclasses import dataclass
from typing import Literal, final

from apo_bench.errors import require
from apo_bench.scenario.parts.limits import DENSITY

FitChoice = Literal["auto", "ask", "refuse"]
FastenerChoice = Literal["clamp", "parts"]


@final
@dataclass(frozen=True)
class AssemblyChoices:
    """The options of `apo_bench.import_assembly` and `apo-bench assembly import`."""

    up: str | None = None
    """Axis of the poses that points up, of `UPS`; None: z, or the axis with the fewest parts that cannot be grasped."""
    fixed: tuple[str, ...] = ()
    """Parts that stay in place; empty: the largest of the lowest parts."""
    order: tuple[str, ...] = ()
    """The moved parts in the wanted order; empty: any order."""
    clearance_mm: float = 0.25
    """Clearance per side of faces that fit."""
    max_overlap_mm: float = 1.0
    """Largest depth by which the faces of parts that overlap may recede."""
    fits: FitChoice = "auto"
    """`auto` gives overlapping parts play, `ask` lists them as an error, `refuse` keeps them as drawn."""
    fasteners: FastenerChoice = "clamp"
    """`clamp` leaves screws and nuts out and fixes what only they hold; `parts` treats them as parts."""
    density: float = 1000.0
    """Density of all parts, [kg/m^3]."""
    skip: tuple[str, ...] = ()
    """Names of solids that are left out."""

    @property
    def most_overlap_mm(self) -> float:
        """Largest depth by which faces recede; 0: none do."""
        return 0.0 if self.fits == "refuse" else self.max_overlap_mm


DEFAULT_CHOICES = AssemblyChoices()


def check_density(density: float) -> None:
    """Raise InputError unless a density, [kg/m^3], is one that a part may have."""
    require(
        DENSITY[0] <= density <= DENSITY[1],
        f"density must be {DENSITY[0]:g} to {DENSITY[1]:g} kg/m^3, got {density:g}.",
    )
