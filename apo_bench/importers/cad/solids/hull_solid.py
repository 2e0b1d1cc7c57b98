"""The convex hull of corners as a solid, for solids whose surface is open or crosses itself."""

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from apo_bench.errors import InputError
from apo_bench.geometry import Array
from apo_bench.importers.cad.solids.mesh import Mesh
from apo_bench.importers.cad.solids.raw_solid import RawSolid, SolidPlace


def make_hull_solid(name: str, corners: Array, places: tuple[SolidPlace, ...], why: str) -> RawSolid:
    """Return the hull of corners, (k, 3), as a solid without faces.

    Args:
        why: Why the solid itself cannot be used, a sentence.

    Raises:
        InputError: The corners lie in a plane.
    """
    try:
        hull = ConvexHull(corners)
    except (QhullError, ValueError) as error:
        raise InputError(f"{name}: {why}") from error
    # Orient the triangles outwards.
    triangles = hull.simplices.astype(np.int64)
    a, b, c = corners[triangles].swapaxes(0, 1)
    inwards = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0.0
    triangles[inwards] = triangles[inwards, ::-1]
    whole = Mesh(corners, triangles)
    return RawSolid(
        name, whole.part(np.arange(len(triangles))), places, (f"its convex hull stands for it: {why.rstrip('.')}",)
    )
