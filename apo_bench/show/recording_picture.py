"""A recording drawn: frames of camera and parts, their paths, and when each part rested."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.solid import Solid
from apo_bench.recording.log import Track
from apo_bench.recording.stays import Stay
from apo_bench.show.save import save_figure

_AXES = ("#c0392b", "#2e8b57", "#2456a6")
_PARTS = ("#cc5c45", "#4588c7", "#b8a02a", "#6b8e23", "#8e5ea2", "#3cba9f", "#777777")
_AXIS_M = 0.03
_EDGES = [(i, j) for i in range(8) for j in range(i + 1, 8) if bin(i ^ j).count("1") == 1]


def draw_recording(
    tracks: Mapping[str, Track],
    stays: Mapping[str, Sequence[Stay]],
    X: Array,
    out: Path,
    ended: Sequence[tuple[str, float]] = (),
    solids: Mapping[str, Solid] | None = None,
    title: str = "",
) -> None:
    """Write the picture as PNG.

    Args:
        tracks: Of parts, camera from part.
        X: (4, 4), world from camera, [m].
        ended: Part of each operation, and when it came to rest.
        solids: To draw the box around each part.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 6.2), layout="constrained")
    FigureCanvasAgg(figure)
    room = figure.add_subplot(1, 2, 1, projection="3d")
    clock = figure.add_subplot(1, 2, 2)
    _draw_frame(room, np.eye(4), 0.08, "world")
    _draw_frame(room, X, 0.08, "camera")
    points = [np.zeros(3), X[:3, 3]]
    for color, (part, track) in zip(_colors(len(tracks)), tracks.items(), strict=True):
        path = (X @ track.T)[:, :3, 3]
        room.plot(*path.T, color=color, linewidth=0.8, alpha=0.7, label=part)
        for stay in (stays[part][0], stays[part][-1]) if stays[part] else ():
            T = X @ stay.rests[-1].T
            _draw_frame(room, T, _AXIS_M, "")
            points.append(T[:3, 3])
            if solids is not None and part in solids:
                _draw_box(room, solids[part], T, color)
    _level(room, np.array(points))
    room.set_title("frames: x red, y green, z blue; mm", fontsize=10)
    room.legend(loc="upper left", fontsize=8, frameon=False)
    _draw_times(clock, tracks, stays, ended)
    figure.suptitle(title, fontsize=11)
    save_figure(figure, out, given="--picture ")


def _draw_times(
    axis: Any, tracks: Mapping[str, Track], stays: Mapping[str, Sequence[Stay]], ended: Sequence[tuple[str, float]]
) -> None:
    rows = {part: i for i, part in enumerate(tracks)}
    for color, (part, track) in zip(_colors(len(tracks)), tracks.items(), strict=True):
        first = stays[part][0].rests[0].T if stays[part] else track.T[0]
        far = np.linalg.norm((pose.inverse(first) @ track.T)[:, :3, 3], axis=1)
        axis.plot(track.t, rows[part] - 0.4 + 0.8 * far / max(float(far.max()), 1e-6), color=color, linewidth=0.8)
        for stay in stays[part]:
            for rest in stay.rests:
                axis.barh(rows[part], rest.ends - rest.begins, left=rest.begins, height=0.8, color=color, alpha=0.25)
    for k, (part, t) in enumerate(ended, 1):
        axis.text(t, rows[part] + 0.42, f"{k}", fontsize=10, ha="left", va="bottom", fontweight="bold")
        axis.plot([t, t], [rows[part] - 0.4, rows[part] + 0.5], color="black", linewidth=0.8)
    axis.set_yticks(list(rows.values()), list(rows))
    axis.set_xlabel("time [s]")
    axis.set_title("bars: at rest; lines: distance from its first place; numbers: operations", fontsize=10)
    axis.spines[["top", "right"]].set_visible(False)


def _draw_frame(axis: Any, T: Array, size: float, name: str) -> None:
    for i, color in enumerate(_AXES):
        ends = np.array([T[:3, 3], T[:3, 3] + size * T[:3, i]])
        axis.plot(*ends.T, color=color, linewidth=1.6)
    if name:
        axis.text(*T[:3, 3], f" {name}", fontsize=9)


def _draw_box(axis: Any, solid: Solid, T: Array, color: str) -> None:
    low = np.min([piece.center - piece.half for piece in solid.pieces], axis=0)
    high = np.max([piece.center + piece.half for piece in solid.pieces], axis=0)
    corners = np.array([[(low, high)[(i >> axis_) & 1][axis_] for axis_ in range(3)] for i in range(8)])
    world = pose.apply(T, corners)
    for i, j in _EDGES:
        axis.plot(*world[[i, j]].T, color=color, linewidth=0.7, alpha=0.8)


def _level(axis: Any, points: Array) -> None:
    """The same scale in all directions, in mm."""
    middle, reach = (points.max(axis=0) + points.min(axis=0)) / 2, max(float(np.ptp(points, axis=0).max()) / 2, 0.1)
    axis.set_xlim(middle[0] - reach, middle[0] + reach)
    axis.set_ylim(middle[1] - reach, middle[1] + reach)
    axis.set_zlim(middle[2] - reach, middle[2] + reach)
    axis.set_box_aspect((1, 1, 1))
    for each in (axis.xaxis, axis.yaxis, axis.zaxis):
        each.set_major_formatter(lambda x, _: f"{1e3 * x:.0f}")
    axis.view_init(elev=28.0, azim=-60.0)


def _colors(n: int) -> list[str]:
    return [_PARTS[i % len(_PARTS)] for i in range(n)]
