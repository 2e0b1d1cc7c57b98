"""A picture of a part with the names of its faces, from two sides."""

from collections.abc import Container
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.cad.solids.raw_solid import RawSolid, Region
from apo_bench.geometry import Array
from apo_bench.io import default_looks

_VIEWS = ((28.0, -55.0), (-28.0, 125.0))
"""Elevation and azimuth, [deg]."""
_MOST_DRAWN = 30_000


@default_looks()
def draw_part(raw: RawSolid, refused: Container[str], title: str, path: Path) -> None:
    """Write it as PNG: flat faces blue, round ones orange, red what can make no contact though it has a name."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 6.0), layout="constrained")
    figure.suptitle(title)
    low, high = raw.mesh.corners.min(axis=0), raw.mesh.corners.max(axis=0)
    for k, (elevation, azimuth) in enumerate(_VIEWS, start=1):
        axes: Any = figure.add_subplot(1, 2, k, projection="3d", xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]")
        axes.view_init(elevation, azimuth)
        e, a = np.radians([elevation, azimuth])
        eye = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        for region in raw.regions:
            _draw_face(axes, raw, region, region.name in refused, eye)
        half = raw.mesh.extent / 2.0
        axes.set(**{f"{name}lim": (m - half, m + half) for name, m in zip("xyz", (low + high) / 2.0, strict=True)})
        axes.set_box_aspect((1.0, 1.0, 1.0))
    figure.savefig(path, dpi=100)


def _draw_face(axes: Any, raw: RawSolid, region: Region, is_refused: bool, eye: Array) -> None:
    """What of a face looks to the eye, with its name on the largest of its triangles."""
    mesh = raw.mesh
    seen = region.triangles[mesh.across[region.triangles] @ eye > 0.0]
    if not len(seen):
        return
    color = "#d98f8f" if is_refused else "#e0b070" if region.is_round else "#8fb3d9"
    look = {"shade": True, "linewidth": 0.0, "antialiased": False, "color": color if region.name else "#cfcfcf"}
    axes.plot_trisurf(*mesh.corners.T, triangles=mesh.triangles[seen[:: -(-len(seen) // _MOST_DRAWN)]], **look)
    if region.name:
        largest = seen[int(np.linalg.norm(mesh.across[seen], axis=1).argmax())]
        at = mesh.corners[mesh.triangles[largest]].mean(axis=0) + 0.02 * mesh.extent * eye
        box = {"facecolor": "white", "alpha": 0.6, "edgecolor": "none", "pad": 1.0}
        axes.text(*at, region.name, ha="center", fontsize=9, zorder=1000, bbox=box)
