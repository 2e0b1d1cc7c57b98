"""Check that every shaft has play in its hole, with the clearance of the parts."""

from apo_bench.assembly import Assembly, classify_contact, compute_geometric_play, compute_play_mm
from apo_bench.errors import require
from apo_bench.scenario.scenario import Scenario

_NO_PLAY_MM = 1e-6
"""Less play counts as none."""


def without_play(assembly: Assembly, clearance_mm: float) -> str | None:
    """Describe the first contact of a shaft without play in its hole; None if all shafts have play."""
    for contact in (contact for operation in assembly.operations for contact in operation.contacts):
        a, b = map(assembly.face_of, contact)
        if classify_contact(a, b) == "shaft in hole" and (compute_play_mm(a, b, clearance_mm) or 0.0) <= _NO_PLAY_MM:
            why = f"{1e3 * compute_geometric_play(a, b):.4g} mm per side by their sizes"
            fit = f" and {clearance_mm:g} mm of clearance" if assembly.is_fit(contact) else ", and neither is fit"
            return f"'{contact}': the shaft has no play in the hole, {why}{fit}"
    return None


def check_clearance(scenario: Scenario, clearance_mm: float) -> None:
    """Check a clearance per side that replaces the one of the scenario.

    Raises:
        InputError: A shaft would have no play in its hole.
    """
    tight = without_play(scenario.assembly, clearance_mm)
    require(tight is None, f"a clearance of {clearance_mm:g} mm was given, with which {tight}; give more.")
