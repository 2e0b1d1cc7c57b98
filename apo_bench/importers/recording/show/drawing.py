"""A recording drawn, whether it fits, is refused or has no scenario: frames of camera and parts, paths, and rests."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import combinations, cycle, product
from pathlib import Path
from typing import Any, final

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry import Array, Solid, pose
from apo_bench.importers.recording.approaches import approaches
from apo_bench.importers.recording.arranging import camera_pose
from apo_bench.importers.recording.camera_file import CameraFile
from apo_bench.importers.recording.importing import ImportedRecording, planned_starts
from apo_bench.importers.recording.stays import Stays, all_stays
from apo_bench.importers.recording.tracks import Log, PoseTrack
from apo_bench.importers.recording.unplanned import UnplannedRecording
from apo_bench.io import default_looks, save_figure
from apo_bench.scenario.scenario import Scenario

_AXES = ("#c0392b", "#2e8b57", "#2456a6")
_PARTS = ("#cc5c45", "#4588c7", "#b8a02a", "#6b8e23", "#8e5ea2", "#3cba9f", "#777777")


@final
@dataclass(frozen=True, eq=False)
class RecordingDrawing:
    """What is drawn of a recording."""

    title: str
    tracks: Mapping[str, PoseTrack]
    """Of parts, camera from part."""
    stays: Stays
    T_world_camera: Array | None
    """(4, 4), [m]; None: not known, and all is drawn in the frame of the camera."""
    ended: Sequence[tuple[str, float]] = ()
    """Part of each operation, and when it came to rest, [s]."""
    solids: Mapping[str, Solid] = field(default_factory=dict)
    """For the box around each part."""
    places: Mapping[str, Array] = field(default_factory=dict)
    """Part -> the known place on which it should start, (4, 4), world, [m]."""
    path_ends: Sequence[tuple[str, str, Array]] = ()
    """Part, label, and both ends of the last straight piece of its path, (2, 3), world, [m]."""


def drawing_of(
    recording: ImportedRecording, log: Log, tracks: Mapping[str, PoseTrack], camera: CameraFile
) -> RecordingDrawing:
    """Of a recording that was understood."""
    return RecordingDrawing(
        title=_title(log, recording.scenario),
        tracks=tracks,
        stays=recording.stays,
        T_world_camera=recording.camera.T_world_camera,
        ended=[
            (operation.main, seen.rest.begins)
            for operation, seen in zip(recording.scenario.assembly.operations, recording.operations, strict=True)
            if seen.rest is not None
        ],
        solids=recording.scenario.assembly.solids,
        places=camera.places(planned_starts(recording.scenario)),
        path_ends=tuple(_path_ends(recording)),
    )


def unfit_drawing(
    log: Log, tracks: Mapping[str, PoseTrack], camera: CameraFile, scenario: Scenario
) -> RecordingDrawing:
    """Of a recording that is refused: as it was read, with the camera where it fits best."""
    stays = all_stays(tracks)
    planned = planned_starts(scenario)
    X = None
    with suppress(InputError, LookupError, np.linalg.LinAlgError):
        X = camera_pose(stays, camera, planned, scenario.assembly.fixed).T_world_camera
    return RecordingDrawing(
        title=f"{_title(log, scenario)}; it does not fit",
        tracks=tracks,
        stays=stays,
        T_world_camera=X,
        solids=scenario.assembly.solids,
        places={} if X is None else camera.places(planned),
    )


def unplanned_drawing(recording: UnplannedRecording, log: Log, tracks: Mapping[str, PoseTrack]) -> RecordingDrawing:
    """Of a recording without a scenario."""
    return RecordingDrawing(
        title=_title(log, None),
        tracks=tracks,
        stays=recording.stays,
        T_world_camera=recording.camera.T_world_camera,
        ended=[(put.part, put.rest.begins) for put in recording.puts],
    )


def _title(log: Log, scenario: Scenario | None) -> str:
    return f"{log.file}{f', {scenario.name}' if scenario else ''}\n{'; '.join(log.notes)}"


def _path_ends(recording: ImportedRecording) -> Iterator[tuple[str, str, Array]]:
    for k, end, macro, off_deg in approaches(recording.scenario, recording.operations, recording.camera.T_world_camera):
        if end is not None:
            goal = recording.observation.poses[k]
            ends = np.array([goal[:3, 3] - end.length_m * goal[:3, :3] @ end.direction, goal[:3, 3]])
            part = recording.scenario.assembly.operations[k].main
            yield part, f"{k + 1}: {macro}, {off_deg:.0f} deg off", ends


@default_looks()
def draw_recording(drawing: RecordingDrawing, out: Path) -> None:
    """Write the picture as PNG: all frames, the parts from near, and when each part rested."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(17.0, 6.4), layout="constrained")
    grid = figure.add_gridspec(1, 3, width_ratios=[1.0, 1.35, 1.15])
    room, near = (figure.add_subplot(grid[i], projection="3d") for i in (0, 1))
    X = np.eye(4) if drawing.T_world_camera is None else drawing.T_world_camera
    if drawing.T_world_camera is not None:
        _draw_frame(room, np.eye(4), 0.12, "world")
    _draw_frame(room, X, 0.12, "camera")
    _draw_parts(room, drawing, X, 0.05, False)
    _draw_parts(near, drawing, X, 0.03, True)
    for axes in (room, near):
        axes.set_aspect("equal")
        axes.view_init(elev=28.0, azim=-60.0)
        axes.locator_params(nbins=5)
    room.set_title("frames: x red, y green, z blue; m", fontsize=10)
    near.set_title("first and last place; dotted: known place; thick: last straight piece", fontsize=10)
    near.legend(loc="upper left", fontsize=8, frameon=False)
    _draw_times(figure.add_subplot(grid[2]), drawing)
    figure.suptitle(drawing.title, fontsize=11)
    save_figure(figure, out)


def _draw_parts(axes: Any, drawing: RecordingDrawing, X: Array, reach: float, close: bool) -> None:
    for color, (part, track) in zip(cycle(_PARTS), drawing.tracks.items(), strict=False):
        axes.plot(*(X @ track.T)[:, :3, 3].T, color=color, linewidth=0.8, alpha=0.7, label=part)
        known = drawing.stays[part]
        for stay, name in zip((known[0], known[-1]) if known else (), (part, ""), strict=False):
            T = X @ stay.rests[-1].T
            _draw_frame(axes, T, reach, name if close else "")
            if part in drawing.solids:
                _draw_box(axes, drawing.solids[part], T, color, "-")
        if close and part in drawing.places and part in drawing.solids:
            _draw_box(axes, drawing.solids[part], drawing.places[part], "black", ":")
        for of, label, ends in drawing.path_ends if close else ():
            if of == part:
                axes.plot(*ends.T, color=color, linewidth=4.0, alpha=0.6, label=label)


def _draw_times(axis: Any, drawing: RecordingDrawing) -> None:
    rows = {part: i for i, part in enumerate(drawing.tracks)}
    for color, (part, track) in zip(cycle(_PARTS), drawing.tracks.items(), strict=False):
        row = rows[part]
        stays = drawing.stays[part]
        first = stays[0].rests[0].T if stays else track.T[0]
        far = np.linalg.norm((pose.inverse(first) @ track.T)[:, :3, 3], axis=1)
        axis.plot(track.t, row - 0.4 + 0.8 * far / max(float(far.max()), 1e-6), color=color, linewidth=0.8)
        for rest in (rest for stay in stays for rest in stay.rests):
            axis.barh(row, rest.seconds, left=rest.begins, height=0.8, color=color, alpha=0.25)
    for k, (part, t) in enumerate(drawing.ended, 1):
        axis.text(t, rows[part] + 0.42, f"{k}", fontsize=10, ha="left", va="bottom", fontweight="bold")
        axis.plot([t, t], [rows[part] - 0.4, rows[part] + 0.5], color="black", linewidth=0.8)
    axis.set_yticks(list(rows.values()), list(rows))
    axis.set_xlabel("time [s]")
    axis.set_title("bars: at rest; lines: distance from its first place; numbers: operations", fontsize=10)
    axis.spines[["top", "right"]].set_visible(False)


def _draw_frame(axis: Any, T: Array, size: float, name: str) -> None:
    for i, color in enumerate(_AXES):
        axis.plot(*np.column_stack([T[:3, 3], T[:3, 3] + size * T[:3, i]]), color=color, linewidth=1.6)
    if name:
        axis.text(*T[:3, 3], f" {name}", fontsize=9)


def _draw_box(axis: Any, solid: Solid, T: Array, color: str, style: str) -> None:
    for a, b in combinations([np.array(corner[::-1]) for corner in product((0, 1), repeat=3)], 2):
        if np.abs(a - b).sum() == 1:
            ends = np.where(np.array([a, b]) == 1, solid.bounds[1], solid.bounds[0])
            axis.plot(*pose.apply(T, ends).T, color=color, linestyle=style, linewidth=0.9, alpha=0.8)
