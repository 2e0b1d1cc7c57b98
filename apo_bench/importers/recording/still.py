"""The noise of a camera from parts that rest: what its frames scatter about the mean of each rest."""

import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import Array, pose
from apo_bench.importers.recording.rests import Rest, find_rests
from apo_bench.importers.recording.tracks import Log, PoseTrack
from apo_bench.perception.observation.models import Camera, Residuals

_MOST_GAP = 1.5
"""A time between two frames that is so many times the usual one has frames missing."""


def still_residuals(log: Log) -> Residuals:
    """The residuals of all frames of all rests, in the frames of the rays; missing frames are those of gaps in time.

    An error that stays while a part rests is in the mean, and therefore not in these.

    Raises:
        InputError: Nothing rests.
    """
    parts = list[int]()
    errors = list[Array]()
    distance = list[float]()
    camera = Camera(np.eye(4))
    for part, track in enumerate(log.tracks.values()):
        for rest in find_rests(track):
            seen = _errors(camera, track, rest)
            # Frames that are missing between others, by the usual time between two.
            steps = np.diff(track.t[rest.first : rest.last + 1])
            missing = int(np.sum(np.round(steps[steps > _MOST_GAP * np.median(steps)] / np.median(steps)) - 1.0))
            errors += [seen, np.full((missing, 6), np.nan)]
            distance += [1e3 * float(np.linalg.norm(rest.T[:3, 3]))] * len(seen)
            parts += [part] * (len(seen) + missing)
    require(errors, f"{log.file}: nothing rests in the log; give one in which parts stand still.")
    n = len(parts)
    shift, turn = np.split(np.concatenate(errors), 2, axis=1)
    turn_deg = np.degrees(turn)
    return Residuals(
        where=np.column_stack([np.zeros(n, dtype=np.int64), np.arange(n), np.array(parts)]),
        shift_mm=shift * 1e3,
        turn_deg=turn_deg,
        trace_deg=np.linalg.norm(turn_deg, axis=1),
        score=np.full(n, np.nan),
        distance_mm=float(np.median(distance)),
    )


def _errors(camera: Camera, track: PoseTrack, rest: Rest) -> Array:
    """(n, 6), (x, y, along; rx, ry, about), [m, rad]: from the mean of a rest to each frame.

    A mean of n frames takes part of each error with it, so what is left is as much larger as it was made smaller.
    """
    T = track.T[rest.first : rest.last + 1]
    n = float(rest.mean.inlier.sum())
    # From the camera's axes into those of the ray; turns first from the part's axes into the camera's.
    F = camera.frames(rest.T[None])[0]
    shift = (T[:, :3, 3] - rest.T[:3, 3]) @ F
    turn = pose.log(pose.inverse(rest.T) @ T)[:, 3:] @ rest.T[:3, :3].T @ F
    return np.concatenate([shift, turn], axis=1) * np.sqrt(n / max(n - 1.0, 1.0))
