"""Format the result of an import as lines for the terminal and as rows of CSV files."""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from apo_bench.geometry import Array, copy_frozen, pose
from apo_bench.importers.recording.averaging import per_axis
from apo_bench.importers.recording.camera_file import CameraFile
from apo_bench.importers.recording.camera_pose import CameraPose, rest_error
from apo_bench.importers.recording.importing import ImportedRecording
from apo_bench.importers.recording.objects_file import ObjectsFile
from apo_bench.importers.recording.rests import Rest
from apo_bench.importers.recording.tracks import Log
from apo_bench.io import align_columns

# Heads of the table of rests.
_HEADS = ("", "part", "rests from", "until s", "frames", "outliers", "x mm", "y mm", "z mm", "deviation of a frame")
POSE_HEAD = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
# Columns of an observation file.
OBSERVATION_HEAD = ("operation", "part", *POSE_HEAD, "deviation_mm", "deviation_deg", "seen")
PATH_HEAD = ("operation", "part", "t_s", *POSE_HEAD)  # columns of a file of paths
_POSE_UNITS = copy_frozen([1e3, 1e3, 1e3, 1.0, 1.0, 1.0, 1.0], 7)
"""Factors from a packed pose, [m], to mm."""


def reading_lines(log: Log, objects: ObjectsFile) -> list[tuple[str, str]]:
    """Return lines on the log, its conventions and the frames of its parts: pairs of label and text."""
    times = [track.t for track in log.tracks.values()]
    seconds = max(float(t[-1]) for t in times)
    lines = [
        ("log", f"{log.file}: {len(log.tracks)} ids, {sum(map(len, times))} poses, {seconds:.1f} s"),
        ("read as", "; ".join(log.notes)),
    ]
    for part, tracked in objects.parts.items():
        lines.append(("frame", f"{part} is id {tracked.id}, its frame {_pose_text(tracked.T_model_part)} of the model"))
    return lines


def camera_lines(camera: CameraPose) -> list[tuple[str, str]]:
    """Return lines on the pose of the camera and its residuals at known places: pairs of label and text."""
    stands = f"{_pose_text(camera.T_world_camera)}; its axes are those of OpenCV"
    if not camera.residuals:
        return [("camera", f"as stated: {stands}")]
    off = ", ".join(f"{part} {_size_text(r)}" for part, r in camera.residuals.items())
    return [("camera", f"solved: {stands}"), ("residuals", off)]


def imported_lines(recording: ImportedRecording) -> list[tuple[str, str]]:
    """Return lines on starts, contacts, displaced parts and doubts: pairs of label and text."""
    fit = recording.arrangement.fit
    starts = ", ".join(f"{part} {source}" for part, source in recording.arrangement.start_source.items())
    lines = [
        ("starts", starts),
        ("contacts", f"open by up to {1e3 * fit.gap_m:.2f} mm and {np.degrees(fit.angle_rad):.2f} deg as observed"),
    ]
    for k, operation in enumerate(recording.operations, start=1):
        for part, twist in {**operation.carried, **operation.adjusted}.items():
            lines.append(("moved", f"{part} by {_size_text(twist)} during operation {k}"))
    return lines + [("unclear", text) for text in recording.unclear]


def rest_lines(rests: Sequence[tuple[str, Rest | None]], X: Array) -> list[str]:
    """Return a table with one line per operation: times, place and scatter of the rest of its part.

    Args:
        rests: Part and rest of each operation.
        X: (4, 4), world from camera.
    """
    table: list[tuple[str, ...]] = [_HEADS]
    for k, (part, rest) in enumerate(rests, start=1):
        if rest is None:
            table.append((str(k), part, "not seen", *[""] * 7))
            continue
        times_and_place = (rest.begins, rest.ends, *(1e3 * (X @ rest.T)[:3, 3]))
        begins, ends, *place = (f"{x:.2f}" for x in times_and_place)
        m, rad = per_axis(rest.mean.scatter)
        frames = (str(len(rest.mean.inlier)), str(int((~rest.mean.inlier).sum())))
        table.append((str(k), part, begins, ends, *frames, *place, f"{1e3 * m:.2f} mm {np.degrees(rad):.2f} deg"))
    return align_columns(table)


def observation_rows(
    parts: Sequence[str], poses: Array, rests: Sequence[Rest | None], camera: CameraFile
) -> Iterator[tuple[object, ...]]:
    """Yield the rows of an observation in CSV form, in mm and degrees.

    Args:
        parts: Main part of each operation.
        rests: Rest that ends each operation; None if not observed.
        poses: (n, 4, 4), world, [m].
    """
    for k, (part, T, rest) in enumerate(zip(parts, poses, rests, strict=True), start=1):
        m, rad = 1.0, 1.0  # without a rest: 1 m and 1 rad, so practically unknown
        if rest is not None:
            m, rad = per_axis(rest.mean.covariance + rest_error(camera, rest.mean))
        packed = (pose.pack(T) * _POSE_UNITS).round(9).tolist()
        yield (k, part, *packed, f"{1e3 * m:.4g}", f"{np.degrees(rad):.4g}", str(rest is not None).lower())


def path_rows(recording: ImportedRecording) -> Iterator[tuple[object, ...]]:
    """Yield the paths between rests: operation, part, time, and pose in the world in mm."""
    for k, observed in enumerate(recording.operations, start=1):
        if observed.path is not None and observed.interval is not None:
            for t, T in zip(*observed.path, strict=True):
                yield (k, observed.interval.part, round(float(t), 6), *(pose.pack(T) * _POSE_UNITS).round(6).tolist())


def _pose_text(T: Array) -> str:
    """Return a pose as text: position in mm, and rotation vector in degrees."""
    turn = Rotation.from_matrix(T[:3, :3]).as_rotvec(degrees=True)
    return f"at {_vector_text(1e3 * T[:3, 3])} mm, turned by {_vector_text(turn)} deg"


def _vector_text(v: Array) -> str:
    return f"({', '.join(f'{x + 0.0:.4g}' for x in np.round(v, 3))})"


def _size_text(twist: Array) -> str:
    """Return the lengths of a twist, [m, rad], as text in mm and degrees."""
    return f"{1e3 * np.linalg.norm(twist[:3]):.2f} mm {np.degrees(np.linalg.norm(twist[3:])):.2f} deg"
