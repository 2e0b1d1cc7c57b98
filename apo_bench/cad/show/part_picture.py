"""A picture of a part with the names of its faces, from two sides."""

from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.cad.raw import RawSolid, Region
from apo_bench.geometry.arrays import Array
from apo_bench.io.default_looks import default_looks

_VIEWS = ((28.0, -55.0), (-28.0, 125.0))
"""Elevation and azimuth, [deg]."""
_FLAT = "#8fb3d9"
_ROUND = "#e0b070"
_PLAIN = "#cfcfcf"
_REFUSED = "#d98f8f"
_MOST_DRAWN = 30_000


@default_looks()
def draw_part(raw: RawSolid, refused: frozenset[str], title: str, path: Path) -> None:
    """Write it as PNG: flat faces blue, round ones orange, red what can make no contact though it has a name."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 6.0), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title)
    for k, (elevation, azimuth) in enumerate(_VIEWS, start=1):
        axes: Any = figure.add_subplot(1, 2, k, projection="3d")
        axes.view_init(elevation, azimuth)
        _draw(axes, raw, refused, _toward(elevation, azimuth))
    figure.savefig(path, dpi=100)


def _toward(elevation: float, azimuth: float) -> Array:
    """To the eye."""
    e, a = np.radians([elevation, azimuth])
    return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


def _draw(axes: Any, raw: RawSolid, refused: frozenset[str], eye: Array) -> None:
    mesh = raw.mesh
    normals = mesh.across / np.maximum(np.linalg.norm(mesh.across, axis=1), 1e-300)[:, None]
    for region in raw.regions:
        seen = region.triangles[normals[region.triangles] @ eye > 0.0]
        if not len(seen):
            continue
        drawn = seen[:: -(-len(seen) // _MOST_DRAWN)]
        color = _color(region, refused)
        axes.plot_trisurf(
            *mesh.corners.T, triangles=mesh.triangles[drawn], color=color, shade=True, linewidth=0.0, antialiased=False
        )
        if region.name:
            weight = np.linalg.norm(mesh.across[seen], axis=1)
            at = mesh.corners[mesh.triangles[seen[int(weight.argmax())]]].mean(axis=0) + 0.02 * mesh.extent * eye
            box = {"facecolor": "white", "alpha": 0.6, "edgecolor": "none", "pad": 1.0}
            axes.text(*at, region.name, ha="center", fontsize=9, zorder=1000, bbox=box)
    low = mesh.corners.min(axis=0)
    high = mesh.corners.max(axis=0)
    middle = (low + high) / 2.0
    half = mesh.extent / 2.0
    for name, m in zip("xyz", middle, strict=True):
        getattr(axes, f"set_{name}lim")(m - half, m + half)
        getattr(axes, f"set_{name}label")(f"{name} [mm]")
    axes.set_box_aspect((1.0, 1.0, 1.0))


def _color(region: Region, refused: frozenset[str]) -> str:
    if region.name in refused and region.name:
        return _REFUSED
    if not region.name:
        return _PLAIN
    return _ROUND if region.is_round else _FLAT
