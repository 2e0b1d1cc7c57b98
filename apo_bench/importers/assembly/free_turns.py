"""Warn about parts whose contacts leave a turn free, although their shape, such as teeth, does not."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from apo_bench.assembly import Contact, Poses
from apo_bench.geometry import Array, Face, Solid, measure_intrusion, pose
from apo_bench.importers.assembly.order_search import Placement

_TURNS_DEG = (1.0, 2.0, 4.0, 7.0)  # turns that are tried in both directions
_DEEP_M = 1e-4
"""Parts that overlap by more than this after a turn block it."""
_PARALLEL = 1.0 - 1e-6  # cosine of parallel axes


def list_meshing_parts(
    solids: Mapping[str, Solid], poses: Poses, order: Sequence[Placement], base: Sequence[str]
) -> Iterator[str]:
    """Yield a note for each part that may turn by its contacts, and is blocked by another part in both directions.

    Args:
        base: The parts that are there before the first operation.
    """
    there = list(base)
    for placing in order:
        main = placing.moves[0]
        axis = _find_free_axis(solids, poses, placing.contacts)
        if axis is not None and len(placing.moves) == 1:
            for other in there:
                blocked = [_find_block_deg(solids, poses, main, other, axis, sign) for sign in (-1.0, 1.0)]
                if None not in blocked:
                    yield (
                        f"'{main}' may turn about its axis by its contacts, but meets '{other}' after "
                        f"{max(each or 0.0 for each in blocked):g} degrees: no contact states this angle, so no method "
                        "corrects it, and a predicted success does not count it"
                    )
        there += [part for part in placing.moves if part not in there]


def _find_free_axis(
    solids: Mapping[str, Solid], poses: Poses, contacts: Sequence[Contact]
) -> tuple[Array, Array] | None:
    """Return a point and the direction of the axis about which contacts leave a part free, (3,) each, world; None if
    they do not."""
    axes = list[tuple[Array, Array]]()
    normals = list[Array]()
    for contact in contacts:
        of = contact.environment
        face, T = solids[of.part].face(of.face), poses[of.part]
        if isinstance(face, Face):
            if contact.manipulated.face in solids[contact.manipulated.part].rounds:
                return None  # a shaft on a plane
            normals.append(T[:3, :3] @ face.normal)
        else:
            axes.append((pose.apply(T, face.point[None])[0], T[:3, :3] @ face.axis))
    if not axes:
        return None
    point, way = axes[0]
    off = [np.linalg.norm(np.cross(other - point, way)) for other, _ in axes]
    is_parallel = all(abs(each @ way) > _PARALLEL for each in (*normals, *(each for _, each in axes)))
    return (point, way) if is_parallel and max(off) < _DEEP_M else None


def _find_block_deg(
    solids: Mapping[str, Solid], poses: Poses, part: str, other: str, axis: tuple[Array, Array], sign: float
) -> float | None:
    """Return the first turn after which a part is inside another one, [deg]; None if it turns freely, or is inside it
    as it stands.

    Args:
        axis: A point and the direction, (3,) each, world.
        sign: Sense of the turn.
    """
    point, way = axis

    def depth(deg: float) -> float:
        R = Rotation.from_rotvec(np.radians(sign * deg) * way).as_matrix()
        T = pose.rigid(R, point - R @ point) @ poses[part]
        return measure_intrusion(solids[part], T, solids[other], poses[other])

    if depth(0.0) > _DEEP_M:
        return None
    return next((deg for deg in _TURNS_DEG if depth(deg) > _DEEP_M), None)
