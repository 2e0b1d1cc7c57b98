"""Draw coloured marks on the surfaces of parts, so that a pose estimator can tell their faces apart."""

from collections.abc import Mapping, Sequence

import numpy as np

from apo_bench.geometry import Array, Piece, build_union_mesh, measure_depth_inside, pose
from apo_bench.simulation.sensor.photographs import PrintedMark

_TRIES = 150
"""Places that are tried; marks that would reach beyond an edge are left out."""
_EXPONENTS = -2.0, -1.0
"""Powers of 10 of half the length and half the width of a mark, relative to the diagonal of the part."""
_HEIGHT_M = 5e-5  # of a mark above the surface; later marks cover earlier ones
_SIDES = np.array([(0.0, 0.0), (-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)])

ObjectMarks = Mapping[int, Sequence[PrintedMark]]
"""Number of an object -> its marks."""


def draw_marks(pieces: tuple[Piece, ...], rng: np.random.Generator) -> tuple[PrintedMark, ...]:
    """Draw marks on the flat parts of the surface of a union of pieces."""
    from trimesh.sample import sample_surface

    mesh = build_union_mesh(pieces)
    points, triangles = sample_surface(mesh, _TRIES, seed=rng)
    marks = []
    for k, (point, normal) in enumerate(zip(points, mesh.face_normals[triangles], strict=True)):
        along = np.cross(normal, rng.standard_normal(3))
        along /= np.linalg.norm(along)
        T = pose.rigid(np.column_stack([along, np.cross(normal, along), normal]), point)
        sides = mesh.scale * 10.0 ** rng.uniform(*_EXPONENTS, 2)
        height = _HEIGHT_M * (1.0 + k / _TRIES)
        color = tuple(rng.uniform(0.0, 1.0, 3).tolist())
        if _lies_on_surface(pieces, pose.apply(T, np.column_stack([_SIDES * sides, np.zeros(len(_SIDES))])), normal):
            marks.append(PrintedMark(T, np.array([*sides, height]), color))
    return tuple(marks)


def _lies_on_surface(pieces: tuple[Piece, ...], points: Array, normal: Array) -> bool:
    """Whether points, (k, 3), are on a surface with this normal: inside just below, outside just above."""
    below, above = (_is_inside(pieces, points + height * normal) for height in (-_HEIGHT_M, _HEIGHT_M))
    return bool(below.all() and not above.any())


def _is_inside(pieces: tuple[Piece, ...], points: Array) -> Array:
    """Which points, (k, 3), are inside one of the pieces, (k,)."""
    return np.asarray(np.max([measure_depth_inside(piece, points) for piece in pieces], axis=0) > 0.0)
