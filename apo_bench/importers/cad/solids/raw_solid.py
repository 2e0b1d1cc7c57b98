"""A solid of a CAD file with its mesh, its faces and all places of its copies, [mm]."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple, final

import numpy as np
from scipy.spatial.transform import Rotation

from apo_bench.geometry import Array
from apo_bench.importers.cad.solids.mesh import Mesh
from apo_bench.importers.cad.solids.region import Region

Rgb = tuple[float, float, float]
"""Red, green and blue, 0 to 1."""
_SAME_SHAPE = 2e-6
"""Solids have the same shape if their corners agree within this share of their size."""


class SolidPlace(NamedTuple):
    """The pose of one copy of a solid in a file."""

    name: str
    T: Array
    """(4, 4), frame of the file from frame of the solid, [mm]."""
    color: Rgb | None = None
    held: bool = False
    """Whether a fastener that is no part of the scenario holds this copy."""


@final
@dataclass(frozen=True, eq=False)
class RawSolid:
    """One solid of a file, with all of its copies."""

    name: str
    mesh: Mesh
    places: tuple[SolidPlace, ...]
    """The places of its copies."""
    repairs: tuple[str, ...] = ()
    """Repairs of the mesh, one phrase each."""
    regions: tuple[Region, ...] = ()
    """Its faces; empty until they are found."""

    def named(self) -> Mapping[str, Region]:
        """Return the named regions by name."""
        return {region.name: region for region in self.regions if region.name}


def merge_copies(solids: Iterable[RawSolid]) -> list[RawSolid]:
    """Return the solids of different shape, each with the places of all copies."""
    different: list[RawSolid] = []
    for new in solids:
        for i, old in enumerate(different):
            T = _transform_onto(old.mesh, new.mesh)
            if T is not None:
                more = (place._replace(T=place.T @ T) for place in new.places)
                different[i] = replace(old, places=(*old.places, *more))
                break
        else:
            different.append(new)
    return different


def _transform_onto(a: Mesh, b: Mesh) -> Array | None:
    """Return the pose, (4, 4), that moves mesh a onto mesh b; None if they differ in shape or order of triangles."""
    are_many = len(a.corners) == len(b.corners) and len(a.triangles) == len(b.triangles)
    if not are_many or abs(a.volume - b.volume) > 1e-4 * abs(a.volume):
        return None
    p = a.corners[a.triangles].reshape(-1, 3)
    q = b.corners[b.triangles].reshape(-1, 3)
    P = p - p.mean(axis=0)
    Q = q - q.mean(axis=0)
    R = Rotation.align_vectors(Q, P)[0].as_matrix()
    if np.abs(P @ R.T - Q).max() > _SAME_SHAPE * max(a.extent, float(np.abs(q).max())):
        return None
    T = np.eye(4)
    T[:3, :3] = np.where(np.abs(R) < 1e-7, 0.0, R)  # rounding noise becomes exact zeros
    T[:3, 3] = q.mean(axis=0) - T[:3, :3] @ p.mean(axis=0)
    return T
