"""Models of the objects in BOP format: meshes in mm with colours and normals, sizes and symmetries."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, final

import numpy as np

from apo_bench.formats.bop_images import MODELS_INFO
from apo_bench.geometry import (
    Array,
    Solid,
    build_union_mesh,
    collect_corners,
    find_revolution,
    find_symmetries,
    pose,
    shrink_pieces,
)
from apo_bench.io import write_file

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
    def offset(self) -> Array:
        """The pose of the model in the frame of the part, (4, 4), [m]: the middle of its bounding box."""
        corners = collect_corners(shrink_pieces(self.solid, 1e-3 * self.clearance_mm))[0]
        return pose.at((corners.min(axis=0) + corners.max(axis=0)) / 2)


def make_model(each: ImageObject) -> Any:
    """The mesh of an object, a `trimesh.Trimesh` in mm, with flat faces of one colour."""
    mesh = build_union_mesh(shrink_pieces(each.solid, 1e-3 * each.clearance_mm))
    mesh.apply_transform(pose.inverse(each.offset))
    mesh.apply_scale(1e3)
    mesh.unmerge_vertices()  # each face has its own corners, and so its own normals
    mesh.visual.vertex_colors = np.append(np.round(255.0 * np.array(each.color)), 255).astype(np.uint8)
    return mesh


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


def write_models(objects: Mapping[int, ImageObject], out: Path) -> None:
    """Write the folders `models`, and `models_eval` with finer meshes, and their `models_info.json`."""
    described = {}
    for folder in _FOLDERS:
        (out / folder).mkdir(parents=True, exist_ok=True)
    for number, each in objects.items():
        mesh = make_model(each)
        described[str(number)] = make_info_entry(each, mesh.vertices)
        fine = mesh.subdivide_to_size(_FINEST * described[str(number)]["diameter"])
        fine.merge_vertices(merge_norm=True)  # so that each counts once in a mean
        for folder, form in zip(_FOLDERS, (mesh, fine), strict=True):
            content = form.export(file_type="ply", vertex_normal=True)
            write_file(out / folder / f"obj_{number:06d}.ply", content)
    for folder in _FOLDERS:
        write_file(out / folder / MODELS_INFO, json.dumps(described, indent=1))
