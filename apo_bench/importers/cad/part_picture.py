"""Draw a part with the names of its faces, from two directions."""

from collections.abc import Container
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.geometry import Array
from apo_bench.importers.cad.solids import RawSolid
from apo_bench.io import save_figure, use_figure_style

_VIEWS = ((28.0, -55.0), (-28.0, 125.0))
"""Elevation and azimuth, [deg]."""
_FLAT, _ROUND, _REFUSED, _NAMELESS = "#8fb3d9", "#e0b070", "#d98f8f", "#cfcfcf"  # colors of faces by kind


@use_figure_style()
def draw_part(raw: RawSolid, refused: Container[str], title: str, path: Path) -> None:
    """Write a PNG: flat faces blue, round faces orange, named faces that can make no contact red.

    Args:
        refused: Names of the faces that can make no contact.
    """
    from matplotlib.figure import Figure

    colors = np.full(len(raw.mesh.triangles), _NAMELESS)
    for name, region in raw.named().items():
        colors[region.triangles] = _REFUSED if name in refused else _ROUND if region.is_round else _FLAT
    figure = Figure(figsize=(12.0, 6.0), layout="constrained")
    figure.suptitle(title)
    for k, view in enumerate(_VIEWS, start=1):
        axes = figure.add_subplot(1, 2, k, projection="3d", xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]")
        _draw_view(axes, raw, colors, *view)
    save_figure(figure, path)


def _draw_view(axes: Any, raw: RawSolid, colors: Array, elevation: float, azimuth: float) -> None:
    """Draw the triangles that face the viewer, and the name of each face at its most visible triangle.

    Args:
        colors: Color of each triangle, (t,).
        elevation, azimuth: Direction of the viewer, [deg].
    """
    mesh = raw.mesh
    e, a = np.radians([elevation, azimuth])
    viewer = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    height = mesh.across @ viewer  # twice the visible area of each triangle; positive if it faces the viewer
    points = mesh.corners[mesh.triangles]
    for color in np.unique(colors[height > 0.0]).tolist():
        triangles = mesh.triangles[(colors == color) & (height > 0.0)]
        axes.plot_trisurf(*mesh.corners.T, triangles=triangles, color=color, linewidth=0.0, antialiased=False)
    box = {"facecolor": "white", "alpha": 0.6, "edgecolor": "none", "pad": 1.0}
    for name, region in raw.named().items():
        largest = region.triangles[int(height[region.triangles].argmax())]
        if height[largest] > 0.0:
            at = points[largest].mean(axis=0) + 0.02 * mesh.extent * viewer
            axes.text(*at, name, ha="center", fontsize=9, zorder=1000, bbox=box)
    axes.set_aspect("equal")
    axes.view_init(elevation, azimuth)
