"""What the range finder sees, one row per operation: picture, range, difference, regions, fitted model."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.assembly.topology import Assembly
from apo_bench.depth_camera.distance import strike_distances
from apo_bench.depth_camera.follow import Event
from apo_bench.depth_camera.view import View
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.io.figures import default_looks, save_figure
from apo_bench.show.sensor_run import SensorRun
from apo_bench.simulation.sensor.watch import DemonstrationImages

_TITLES = ("TV camera, quiet", "range image [m]", "minus the one before [mm]", "appeared, vanished", "fitted model")
_APPEARED = "#1b7837"
_VANISHED = "#b2182b"
_OUTLINE = "#d95f02"
_AROUND = 20
"""Pixels around what changed."""
_LARGEST_MM = 60.0
_RESIDUAL_MM = 5.0


@default_looks()
def draw_sensor(run: SensorRun, out: Path, view: int = 0) -> None:
    """Draw every operation that was noticed, in one view of the range finder."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    events = run.events
    assembly = run.simulated.demonstration.assembly
    figure = Figure(figsize=(15.0, 2.55 * max(1, len(events)) + 0.3), layout="constrained")
    FigureCanvasAgg(figure)
    rows = figure.subplots(max(1, len(events)), len(_TITLES), squeeze=False)
    for axes, title in zip(rows[0], _TITLES, strict=True):
        axes.set_title(title, fontsize=11)
    for axes in rows.ravel():
        axes.set_xticks([])
        axes.set_yticks([])
    for row, event in zip(rows, events, strict=False):
        row[0].set_ylabel(_label(assembly, event), fontsize=9)
        _draw_row(row, run.watched, run.images, event, view)
    for axes in rows[:, 1:].ravel():
        _crop(axes, events, view)
    save_figure(figure, out, dpi=72, given="--out ")


def _label(assembly: Assembly, event: Event) -> str:
    moved = ", ".join(sorted(event.moved)) or "nothing"
    if event.operation is None:
        return f"{moved}: not expected"
    if event.found is None:
        return f"{event.operation + 1}: {moved}, not recognised"
    return f"{event.operation + 1}: {moved}, {100 * event.found.explained:.0f} % explained"


def _crop(axes: Any, events: Sequence[Event], view: int) -> None:
    """Show only where anything ever changed."""
    changed = [event.regions[view].appeared | event.regions[view].vanished for event in events]
    if np.any(changed):
        v, u = np.nonzero(np.any(changed, axis=0))
        axes.set_xlim(u.min() - _AROUND, u.max() + _AROUND)
        axes.set_ylim(v.max() + _AROUND, v.min() - _AROUND)


def _draw_row(row: Any, watched: DemonstrationImages, images: Sequence[Array], event: Event, view: int) -> None:
    before = images[event.first][view]
    after = images[event.last][view]
    regions = event.regions[view]
    row[0].imshow(watched.pictures[event.last], cmap="gray", vmin=0.0, vmax=1.0)
    row[1].imshow(after, cmap="viridis_r", vmin=np.nanmin(after), vmax=np.nanquantile(after, 0.95))
    row[2].imshow(1e3 * (after - before), cmap="RdBu", vmin=-_LARGEST_MM, vmax=_LARGEST_MM)
    row[3].imshow(after, cmap="gray_r", vmin=np.nanmin(after), vmax=2.0 * np.nanmax(after))
    for mask, color in ((regions.appeared, _APPEARED), (regions.vanished, _VANISHED)):
        row[3].imshow(np.where(mask, 1.0, np.nan), cmap=_one_color(color), vmin=0.0, vmax=1.0, alpha=0.8)
    row[4].imshow(after, cmap="gray_r", vmin=np.nanmin(after), vmax=2.0 * np.nanmax(after))
    if event.found is not None and event.shape is not None:
        expected = _expected(watched.finder.views[view], event)
        agreeing = regions.appeared & (np.abs(after - expected) < 0.02)
        drawn = row[4].imshow(
            np.where(agreeing, 1e3 * (after - expected), np.nan), cmap="coolwarm", vmin=-_RESIDUAL_MM, vmax=_RESIDUAL_MM
        )
        row[4].contour(np.isfinite(expected), levels=[0.5], colors=_OUTLINE, linewidths=1.2)
        bar = row[4].figure.colorbar(drawn, ax=row[4], shrink=0.85)
        bar.ax.tick_params(labelsize=7)
        bar.set_label("measured - model [mm]", fontsize=7)


def _expected(view: View, event: Event) -> Array:
    """The range image of the fitted model alone, (height, width), [m]."""
    assert event.found is not None
    assert event.shape is not None
    T = event.found.T
    origin = pose.apply(pose.inverse(T), view.origin[None])[0]
    distance, _ = strike_distances(event.shape, origin, view.rays @ T[:3, :3])
    return distance.reshape(view.height, view.width)


def _one_color(color: str) -> Any:
    from matplotlib.colors import ListedColormap

    return ListedColormap([color])
