"""Format the result of an import as lines for the terminal and as rows of CSV files."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from apo_bench.geometry import Array, copy_frozen, pose
from apo_bench.importers.recording.averaging import per_axis
from apo_bench.importers.recording.camera_pose import CameraPose
from apo_bench.importers.recording.importing import ImportedRecording
from apo_bench.importers.recording.matching import MatchedTracks
from apo_bench.importers.recording.rests import Rest
from apo_bench.importers.recording.tracks import Log

POSE_HEAD = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
# Columns of an observation file.
OBSERVATION_HEAD = ("operation", "part", *POSE_HEAD, "deviation_mm", "deviation_deg", "seen")
PATH_HEAD = ("operation", "part", "t_s", *POSE_HEAD)  # columns of a file of paths
_POSE_UNITS = copy_frozen([1e3, 1e3, 1e3, 1.0, 1.0, 1.0, 1.0], 7)
"""Factors from a packed pose, [m], to mm."""


def describe_recording(
    log: Log,
    matched: MatchedTracks,
    folded: Mapping[str, int],
    gross: Mapping[str, int],
    camera: CameraPose,
    placed: Sequence[tuple[str, Rest | None]],
) -> list[tuple[str, str]]:
    """Return five lines on what was read and done: pairs of label and text.

    Args:
        folded: Part -> number of frames folded to another image.
        gross: Part -> number of frames left out, as they are far from the frames around.
        placed: Part and rest of each operation.
    """
    times = [poses.t for poses in log.candidates.values()]
    seconds = max(float(t[-1]) for t in times)
    size = f"{len(log.candidates)} ids, {sum(map(len, times))} poses, {seconds:.1f} s"
    lost = {**matched.lost, **({"broken rows": log.broken} if log.broken else {})}
    done = [f"{n} of {part} folded to the nearest image under its symmetry" for part, n in folded.items() if n]
    done += [f"{n} of {part} left out (far from the frames around)" for part, n in gross.items() if n]
    done += [f"{n} left out ({kind})" for kind, n in lost.items()]
    rests = [
        f"{part} not observed" if rest is None else f"{part} {rest.begins:.2f} to {rest.ends:.2f} s"
        for part, rest in placed
    ]
    known = [rest for _, rest in placed if rest is not None]
    frames = sum(len(rest.mean.inlier) for rest in known)
    outliers = frames - sum(int(rest.mean.inlier.sum()) for rest in known)
    size_m, size_rad = np.max([per_axis(rest.mean.scatter) for rest in known], axis=0) if known else (0.0, 0.0)
    deviation = f"{1e3 * size_m:.2f} mm {np.degrees(size_rad):.2f} deg"
    return [
        ("read", f"{log.file}: {size}; {'; '.join(log.notes)}"),
        ("frames", "; ".join([*done, *matched.notes]) or "all used as they are"),
        ("camera", _camera_text(camera)),
        ("placed", ", ".join(rests)),
        ("rests", f"{frames} frames, {outliers} outliers, a frame deviates by up to {deviation}"),
    ]


def _camera_text(camera: CameraPose) -> str:
    """Return the pose of the camera, and the largest residuals at known places."""
    stands = _pose_text(camera.T_world_camera)
    if not camera.residuals:
        return f"as stated: {stands}"
    return f"solved: {stands}; known places missed by up to {camera.off_mm:.2f} mm {camera.off_deg:.2f} deg"


def observation_rows(
    parts: Sequence[str], poses: Array, rests: Sequence[Rest | None], covariance: Array
) -> Iterator[tuple[object, ...]]:
    """Yield the rows of an observation in CSV form, in mm and degrees.

    Args:
        parts: Main part of each operation.
        rests: Rest that ends each operation; None if not observed.
        poses: (n, 4, 4), world, [m].
        covariance: (n, 6, 6), of each pose, [m, rad].
    """
    for k, (part, T, rest, C) in enumerate(zip(parts, poses, rests, covariance, strict=True), start=1):
        m, rad = per_axis(C) if rest is not None else (1.0, 1.0)  # without a rest practically unknown
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
