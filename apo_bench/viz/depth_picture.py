"""A picture of the poses that a depth camera estimates from a demonstration: one row per detected change."""

from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.io import save_figure, use_figure_style
from apo_bench.perception.depth_camera.operation_detection import DetectedOperation
from apo_bench.perception.depth_camera.range_finder import VIEWS
from apo_bench.viz.depth_run import DepthRun

_TITLES = ("camera image", "depth [m]", "minus the depth before [mm]", "appeared, vanished", "fitted model")
_APPEARED = "#1b7837"  # colour of pixels where something appeared
_VANISHED = "#b2182b"  # colour of pixels where something vanished
_OUTLINE = "#d95f02"  # colour of the outline of the fitted model
_AROUND = 20  # margin around the changed pixels, in pixels
_LARGEST_MM = 60.0  # end of the colour scale of depth differences


@use_figure_style()
def draw_depth(run: DepthRun, out: Path, view: int = 0) -> None:
    """Draw every detected change in one view of the depth camera.

    Args:
        out: PNG file to write.
        view: Number of the view, from 0.
    """
    from matplotlib.figure import Figure

    rows = max(1, len(run.events))
    figure = Figure(figsize=(15.0, 2.55 * rows + 0.3), layout="constrained")
    grid = figure.subplots(rows, len(_TITLES), squeeze=False, subplot_kw={"xticks": [], "yticks": []})
    for axes, title in zip(grid[0], _TITLES, strict=True):
        axes.set_title(title, fontsize=11)
    for row, event in zip(grid, run.events, strict=False):
        row[0].set_ylabel(_describe_event(event), fontsize=9)
        _draw_row(row, run, event, view)
    # every picture is cropped to the pixels that changed in any event, with a margin
    changed = [event.regions[view].appeared | event.regions[view].vanished for event in run.events]
    if np.any(changed):
        v, u = np.nonzero(np.any(changed, axis=0))
        for axes in grid[:, 1:].ravel():
            axes.set(xlim=(u.min() - _AROUND, u.max() + _AROUND), ylim=(v.max() + _AROUND, v.min() - _AROUND))
    save_figure(figure, out, dpi=72)


def _describe_event(event: DetectedOperation) -> str:
    """Return the label of an event: `3: cube, 97 % explained`."""
    moved = ", ".join(sorted(event.moved)) or "nothing"
    if event.operation is None:
        return f"{moved}: unexpected"
    found = "no pose" if event.found is None else f"{100 * event.found.explained:.0f} % explained"
    return f"{event.operation + 1}: {moved}, {found}"


def _draw_row(row: Any, run: DepthRun, event: DetectedOperation, view: int) -> None:
    """Draw the five pictures of `_TITLES` for one event into a row of axes."""
    from matplotlib.colors import ListedColormap

    after = run.images[event.last][view]
    change = 1e3 * (after - run.images[event.first][view])
    regions = event.regions[view]  # masks of the pixels that appeared or vanished
    low = np.nanmin(after)
    row[0].imshow(run.watched.pictures[event.last], cmap="gray", vmin=0.0, vmax=1.0)
    row[1].imshow(after, cmap="viridis_r", vmin=low, vmax=np.nanquantile(after, 0.95))
    row[2].imshow(change, cmap="RdBu", vmin=-_LARGEST_MM, vmax=_LARGEST_MM)
    for axes in row[3:]:
        axes.imshow(after, cmap="gray_r", vmin=low, vmax=2.0 * np.nanmax(after))
    for mask, color in ((regions.appeared, _APPEARED), (regions.vanished, _VANISHED)):
        row[3].imshow(np.where(mask, 1.0, np.nan), cmap=ListedColormap([color]), vmin=0.0, vmax=1.0, alpha=0.8)
    if event.found is not None and event.model is not None:
        # outline the pixels whose rays hit the model at the estimated pose
        camera = VIEWS[view]
        distance, _ = run.models(event.model.place_parts(event.found.T), camera.origin, camera.rays)
        row[4].contour(np.isfinite(distance.reshape(after.shape)), levels=[0.5], colors=_OUTLINE, linewidths=1.2)
