"""Draw a recording: the paths of parts around the camera, and the times at which each part rests."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.importers.recording.rest_intervals import find_all_intervals
from apo_bench.importers.recording.tracks import PoseTrack
from apo_bench.io import save_figure, use_figure_style

_AXIS_COLORS = ("#c0392b", "#2e8b57", "#2456a6")  # x, y and z


@use_figure_style()
def draw_recording(
    title: str,
    tracks: Mapping[str, PoseTrack],
    T_world_camera: Array | None,
    operations: Sequence[tuple[str, float]],
    out: Path,
) -> None:
    """Write the picture as PNG.

    Args:
        tracks: Track of each part, camera from part.
        T_world_camera: (4, 4), [m]; None: the picture is in the frame of the camera.
        operations: Main part of each operation, and the time at which it came to rest, [s].
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 6.4), layout="constrained")
    axes = figure.add_subplot(1, 2, 1, projection="3d", title="axes: x red, y green, z blue")
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    X = np.eye(4) if T_world_camera is None else T_world_camera
    _draw_frame(axes, X, 0.12, "camera")
    if T_world_camera is not None:
        _draw_frame(axes, np.eye(4), 0.12, "world")
    times = figure.add_subplot(1, 2, 2, xlabel="time [s]", title="bars: at rest; lines: distance from the first place")
    for row, (part, track) in enumerate(tracks.items()):
        color = f"C{row}"
        T = X @ track.T
        axes.plot(*T[:, :3, 3].T, color=color, linewidth=0.8)
        _draw_frame(axes, T[0], 0.05, part)
        _draw_frame(axes, T[-1], 0.05, "")
        far = np.linalg.norm((pose.inverse(track.T[0]) @ track.T)[:, :3, 3], axis=1)
        times.plot(track.t, row - 0.4 + 0.8 * far / max(float(far.max()), 1e-6), color=color, linewidth=0.8)
    rows = {part: row for row, part in enumerate(tracks)}
    for part, intervals in find_all_intervals(tracks).items():
        for rest in (rest for interval in intervals for rest in interval.rests):
            times.barh(rows[part], rest.ends - rest.begins, left=rest.begins, color=f"C{rows[part]}", alpha=0.25)
    for k, (part, t) in enumerate(operations, start=1):
        times.text(t, rows[part] + 0.42, str(k), fontweight="bold")
    times.set_yticks(list(rows.values()), list(rows))
    axes.set_aspect("equal")
    figure.suptitle(title)
    save_figure(figure, out)


def _draw_frame(axes: Any, T: Array, size: float, name: str) -> None:
    """Draw the axes of a frame with a length, [m], and its name."""
    for i, color in enumerate(_AXIS_COLORS):
        axes.plot(*np.column_stack([T[:3, 3], T[:3, 3] + size * T[:3, i]]), color=color, linewidth=1.6)
    axes.text(*T[:3, 3], f" {name}")
