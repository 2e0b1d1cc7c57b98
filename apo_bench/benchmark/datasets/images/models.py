"""Models of the objects in BOP format: meshes in mm with colours and normals, sizes and symmetries."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.benchmark.datasets.images.printed_marks import ObjectMarks
from apo_bench.formats.bop_images import MODELS_INFO
from apo_bench.geometry import (
    Array,
    Piece,
    Solid,
    build_union_mesh,
    collect_corners,
    find_revolution,
    find_symmetries,
    pose,
    shrink_pieces,
)
from apo_bench.io import write_file
from apo_bench.simulation.sensor.photographs import PrintedMark

_FOLDERS = "models", "models_eval"
_FINEST = 0.08
"""Longest edge of a mesh for evaluation, relative to the diameter: errors are means over vertices."""


@final
@dataclass(frozen=True)
class ImageObject:
    """A shape and a colour that one or several parts have."""

    file: str
    """The file of its parts."""
    clearance_mm: float
    """Clearance per side, by which the part is smaller than nominal."""
    color: tuple[float, ...]
    """Red, green and blue, from 0 to 1."""
    solid: Solid = field(compare=False)
    """The shape in the file."""

    @property
    def pieces(self) -> tuple[Piece, ...]:
        """Convex pieces of the part as it is made, frame of the part, [m]."""
        return shrink_pieces(self.solid, 1e-3 * self.clearance_mm)

    @property
    def offset(self) -> Array:
        """The pose of the model in the frame of the part, (4, 4), [m]: the middle of its bounding box."""
        corners = collect_corners(self.pieces)[0]
        return pose.at((corners.min(axis=0) + corners.max(axis=0)) / 2)


def make_model(each: ImageObject) -> Any:
    """The mesh of an object, a `trimesh.Trimesh` in mm, with flat faces of one colour."""
    mesh = build_union_mesh(each.pieces)
    mesh.apply_transform(pose.inverse(each.offset))
    mesh.apply_scale(1e3)
    mesh.unmerge_vertices()  # each face has its own corners, and so its own normals
    mesh.visual.vertex_colors = _as_bytes(each.color)
    return mesh


def _as_bytes(color: tuple[float, ...]) -> NDArray[np.uint8]:
    """A colour from 0 to 1 as red, green, blue and opacity from 0 to 255."""
    return np.append(np.round(255.0 * np.array(color)), 255).astype(np.uint8)


def add_marks(mesh: Any, marks: Iterable[PrintedMark], offset: Array) -> Any:
    """The mesh of an object, in mm, with its marks, whose frame is that of the part.

    Args:
        offset: Pose of the model in the frame of the part, (4, 4), [m].
    """
    import trimesh

    boxes = []
    for mark in marks:
        box = trimesh.creation.box(2.0 * mark.half, pose.inverse(offset) @ mark.T)
        box.apply_scale(1e3)
        box.unmerge_vertices()
        box.visual.vertex_colors = _as_bytes(mark.color)
        boxes.append(box)
    return trimesh.util.concatenate([mesh, *boxes])


def measure_diameter(points: Array) -> float:
    """The largest distance between two of n points, (n, 3), in their unit."""
    from scipy.spatial import ConvexHull
    from scipy.spatial.distance import pdist

    return float(pdist(points[ConvexHull(points).vertices]).max())


def make_info_entry(each: ImageObject, vertices: Array) -> dict[str, Any]:
    """The entry of `models_info.json`: diameter, bounding box and symmetries, in mm and the frame of the model.

    Args:
        vertices: (n, 3), of the model, [mm].
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    entry: dict[str, Any] = {"diameter": measure_diameter(vertices)}
    entry |= {f"min_{axis}": float(value) for axis, value in zip("xyz", low, strict=True)}
    entry |= {f"size_{axis}": float(value) for axis, value in zip("xyz", high - low, strict=True)}
    if len(symmetries := find_symmetries(each.solid)) > 1:
        discrete = pose.inverse(each.offset) @ symmetries[1:] @ each.offset
        discrete[:, :3, 3] *= 1e3
        entry["symmetries_discrete"] = discrete.reshape(-1, 16).tolist()
    if (revolution := find_revolution(each.solid)) is not None:
        offset = 1e3 * pose.apply(pose.inverse(each.offset), revolution.point[None])[0]
        entry["symmetries_continuous"] = [{"axis": revolution.axis.tolist(), "offset": offset.tolist()}]
    return entry


def write_models(objects: Mapping[int, ImageObject], marks: ObjectMarks, out: Path) -> None:
    """Write the folders `models`, and `models_eval` with finer meshes, and their `models_info.json`.

    Args:
        marks: Those of the meshes in `models`. Symmetries are those of the shapes.
    """
    described = {}
    for folder in _FOLDERS:
        (out / folder).mkdir(parents=True, exist_ok=True)
    for number, each in objects.items():
        mesh = make_model(each)
        described[str(number)] = make_info_entry(each, mesh.vertices)
        fine = mesh.subdivide_to_size(_FINEST * described[str(number)]["diameter"])
        fine.merge_vertices(merge_norm=True)  # so that each counts once in a mean
        shown = add_marks(mesh, marks.get(number, ()), each.offset)
        for folder, form in zip(_FOLDERS, (shown, fine), strict=True):
            content = form.export(file_type="ply", vertex_normal=True)
            write_file(out / folder / f"obj_{number:06d}.ply", content)
    for folder in _FOLDERS:
        write_file(out / folder / MODELS_INFO, json.dumps(described, indent=1))
