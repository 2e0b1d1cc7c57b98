"""Kind of contact that two faces can make, and the play that their sizes leave."""

from typing import Literal

from apo_bench.geometry import Face, RoundFace

ContactKind = Literal["plane on plane", "shaft in hole", "shaft on plane", "cone in cone", "cone on rim"]
OPPOSING = -0.9
"""Largest cosine between the normals of two faces that oppose: contacts leave tilts of a few degrees."""
WALLS = 8
"""Number of planes through an axis that bound the play of a shaft: sixteen walls, whose corners lie on its circle."""
_SAME_SLOPE = 2e-3
"""Largest difference of the slopes of two cones that fit into each other, about 0.1 degrees."""


def classify_contact(a: Face | RoundFace, b: Face | RoundFace) -> ContactKind | None:
    """The kind of contact that two faces can make, in either order; None if they can make none."""
    if isinstance(a, Face) and isinstance(b, Face):
        return "plane on plane"
    if isinstance(a, Face) or isinstance(b, Face):
        wall = b if isinstance(a, Face) else a
        assert isinstance(wall, RoundFace)
        return "shaft on plane" if wall.kind == "cylinder" and not wall.hole else None
    if a.kind == "rim" or b.kind == "rim":
        rim, cone = (a, b) if a.kind == "rim" else (b, a)
        return "cone on rim" if cone.kind == "cone" and rim.hole != cone.hole else None
    if a.hole == b.hole or a.kind != b.kind:
        return None
    if a.kind == "cylinder":
        return "shaft in hole"
    return "cone in cone" if abs(abs(a.slope) - abs(b.slope)) < _SAME_SLOPE else None


def compute_geometric_play(a: Face | RoundFace, b: Face | RoundFace) -> float:
    """Radius of a hole minus that of its shaft, [m], negative where the shaft is thicker; 0 for every other contact."""
    if isinstance(a, Face) or isinstance(b, Face) or classify_contact(a, b) != "shaft in hole":
        return 0.0
    return a.radius - b.radius if a.hole else b.radius - a.radius


def compute_play_mm(a: Face | RoundFace, b: Face | RoundFace, clearance_mm: float) -> float | None:
    """How far two fit faces may be off, [mm]; None for faces that only touch.

    It is the clearance if one of them is fit, plus the radius of a hole minus that of its shaft.
    """
    fits = a.fit or b.fit
    if not fits and classify_contact(a, b) != "shaft in hole":
        return None
    return clearance_mm * fits + 1e3 * compute_geometric_play(a, b)
