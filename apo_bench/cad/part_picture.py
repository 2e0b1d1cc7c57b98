"""A picture of a part with the names of its faces, from two sides."""

from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.cad.solids.raw_solid import RawSolid
from apo_bench.geometry import Array
from apo_bench.io import default_looks, save_figure

_VIEWS = ((28.0, -55.0), (-28.0, 125.0))
"""Elevation and azimuth, [deg]."""
_MOST_DRAWN = 30_000


@default_looks()
def draw_part(raw: RawSolid, refused: frozenset[str], title: str, path: Path) -> None:
    """Write it as PNG: flat faces blue, round ones orange, red what can make no contact though it has a name."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 6.0), layout="constrained")
    figure.suptitle(title)
    for k, (elevation, azimuth) in enumerate(_VIEWS, start=1):
        axes: Any = figure.add_subplot(1, 2, k, projection="3d")
        axes.view_init(elevation, azimuth)
        e, a = np.radians([elevation, azimuth])
        _draw(axes, raw, refused, np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]))
    save_figure(figure, path)


def _draw(axes: Any, raw: RawSolid, refused: frozenset[str], eye: Array) -> None:
    """What looks to the eye, each face with its name on the largest of its triangles."""
    mesh = raw.mesh
    doubled = np.linalg.norm(mesh.across, axis=1)
    normals = mesh.across / np.maximum(doubled, 1e-300)[:, None]
    for region in raw.regions:
        seen = region.triangles[normals[region.triangles] @ eye > 0.0]
        if not len(seen):
            continue
        color = "#d98f8f" if region.name in refused else "#e0b070" if region.is_round else "#8fb3d9"
        axes.plot_trisurf(
            *mesh.corners.T,
            triangles=mesh.triangles[seen[:: -(-len(seen) // _MOST_DRAWN)]],
            color=color if region.name else "#cfcfcf",
            shade=True,
            linewidth=0.0,
            antialiased=False,
        )
        if region.name:
            at = mesh.corners[mesh.triangles[seen[int(doubled[seen].argmax())]]].mean(axis=0) + 0.02 * mesh.extent * eye
            box = {"facecolor": "white", "alpha": 0.6, "edgecolor": "none", "pad": 1.0}
            axes.text(*at, region.name, ha="center", fontsize=9, zorder=1000, bbox=box)
    for name, m in zip("xyz", (mesh.corners.min(axis=0) + mesh.corners.max(axis=0)) / 2.0, strict=True):
        getattr(axes, f"set_{name}lim")(m - mesh.extent / 2.0, m + mesh.extent / 2.0)
        getattr(axes, f"set_{name}label")(f"{name} [mm]")
    axes.set_box_aspect((1.0, 1.0, 1.0))
