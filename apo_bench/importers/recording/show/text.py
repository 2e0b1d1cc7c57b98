"""What was made of a recording, in words and as tables of files."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from apo_bench.geometry import Array, frozen, pose
from apo_bench.importers.recording.approaches import approaches
from apo_bench.importers.recording.arranging import CameraPose
from apo_bench.importers.recording.averaging import per_axis
from apo_bench.importers.recording.importing import ImportedRecording
from apo_bench.importers.recording.objects_file import ObjectsFile
from apo_bench.importers.recording.rests import RestSpan
from apo_bench.importers.recording.tracks import Log
from apo_bench.importers.recording.unplanned import UnplannedRecording
from apo_bench.io import columns, direction

_HEADS: tuple[str, ...] = (
    "",
    "part",
    "rests from",
    "until s",
    "frames",
    "outliers",
    "x mm",
    "y mm",
    "z mm",
    "a frame is off by",
)
_MOST_TIMES = 5
_ALIKE_DEG = 20.0
"""Directions within this are the same."""
_POSE_UNITS = frozen([1e3, 1e3, 1e3, 1.0, 1.0, 1.0, 1.0], 7)
"""mm for m of a packed pose."""


def reading_lines(log: Log, objects: ObjectsFile, hands: Mapping[str, str]) -> list[tuple[str, str]]:
    """Frames, units and orders, before anything is trusted; and ids that are taken for hands -> a part they moved."""
    times = [track.t for track in log.tracks.values()]
    seconds = max(float(t[-1]) for t in times)
    return [
        ("log", f"{log.file}: {len(log.tracks)} ids, {sum(map(len, times))} poses, {seconds:.1f} s"),
        ("read as", "; ".join(log.notes)),
        *(
            (
                "frame",
                f"{part} is id {tracked.id}, its frame {_pose_text(tracked.T_model_part)}, in the tracker's model",
            )
            for part, tracked in objects.parts.items()
        ),
        *(("hand", f"id {name} takes {part} along and leaves it: no part") for name, part in hands.items()),
    ]


def camera_lines(camera: CameraPose) -> list[tuple[str, str]]:
    """Where the camera stands, and how well known places agree."""
    stands = f"{_pose_text(camera.T_world_camera)}; its axes are those of OpenCV"
    if not camera.residuals:
        return [("camera", f"as stated: {stands}")]
    off = ", ".join(f"{part} {_mm(r):.2f} mm {_deg(r):.2f} deg" for part, r in camera.residuals.items())
    return [("camera", f"solved: {stands}"), ("residuals", off)]


def imported_lines(recording: ImportedRecording) -> list[tuple[str, str]]:
    """What is known of starts, contacts, paths, and what stays unclear."""
    fit = recording.fit
    how = {
        "known": "on known places",
        "seen": "where they were seen, standing as in the scenario",
        "scenario": "as in the scenario",
        "in the hand": "in the hand from the first frame, so as in the scenario",
    }
    # Which parts start where, by how that is known; those that stood otherwise are unclear, and stand there.
    stood = {whence: [part for part, each in recording.stood.items() if each == whence] for whence in how}
    lines = [
        ("starts", "; ".join(f"{', '.join(parts)} {how[whence]}" for whence, parts in stood.items() if parts)),
        ("contacts", f"open by up to {1e3 * fit.gap_m:.2f} mm and {np.degrees(fit.angle_rad):.2f} deg as seen"),
    ]
    if not recording.stays_stated:
        error = "an error that stays while a part rests cannot be seen: taken as large as that of one frame"
        lines.append(("noise", f"{error}; state [noise] in the camera file"))
    lines += [("path", text) for text in _paths(recording)]
    for k, operation in enumerate(recording.operations, 1):
        if operation.rest is None:
            lines.append(("not seen", f"operation {k}, as stated"))
        in_hand = f"in the hand during operation {k}"
        beside = f"during operation {k}, which does not move it: counted into its error"
        lines += [
            ("moved", f"{part} by {_mm(twist):.1f} mm and {_deg(twist):.1f} deg {how_moved}")
            for moved, how_moved in ((operation.carried, in_hand), (operation.adjusted, beside))
            for part, twist in moved.items()
            if np.linalg.norm(twist[:3]) > 1e-3
        ]
    return lines + [("unclear", text) for text in recording.unclear]


def rest_lines(rests: Sequence[tuple[str, RestSpan | None]], X: Array, times: Mapping[str, Array]) -> list[str]:
    """One line for each operation: when its part came to rest, and what its frames show; then the outliers.

    Args:
        rests: Part and rest of each operation.
        X: (4, 4), world from camera.
        times: Part -> times of its frames, [s].
    """
    table = [_HEADS]
    outliers = []
    for k, (part, rest) in enumerate(rests, 1):
        table.append((str(k), part, *(_rest_cells(rest, X) if rest else ("not seen", *[""] * 7))))
        if rest is not None and not rest.mean.inlier.all():
            t = times[part][rest.first : rest.last + 1][~rest.mean.inlier]
            first_few = ", ".join(f"{x:.2f}" for x in t[:_MOST_TIMES]) + (", ..." if len(t) > _MOST_TIMES else "")
            outliers.append(f"outliers of operation {k} ({part}) at {first_few} s, left out")
    return [*columns(table), *([""] if outliers else []), *outliers]


def put_lines(recording: UnplannedRecording) -> list[str]:
    """What a log says by itself of the order of operations."""
    return [
        f"operation {k}: {put.part} and {', '.join(put.carries)} moved together; {put.part}, which was "
        "taken first, is what the hand held, as far as the log tells"
        for k, put in enumerate(recording.puts, 1)
        if put.carries
    ]


OBSERVATION_HEAD = (
    "operation",
    "part",
    "x_mm",
    "y_mm",
    "z_mm",
    "qw",
    "qx",
    "qy",
    "qz",
    "deviation_mm",
    "deviation_deg",
    "seen",
)


def observation_rows(
    parts: Sequence[str], goals: Array, deviations: Sequence[tuple[float, float]], seen: Sequence[bool]
) -> Iterator[tuple[object, ...]]:
    """The rows of an observation file as CSV, mm and degrees."""
    for k, (part, T, (m, rad), was_seen) in enumerate(zip(parts, goals, deviations, seen, strict=True), 1):
        packed = (pose.pack(T) * _POSE_UNITS).round(9).tolist()
        yield (k, part, *packed, f"{1e3 * m:.4g}", f"{np.degrees(rad):.4g}", "true" if was_seen else "false")


def path_rows(recording: ImportedRecording) -> Iterator[tuple[object, ...]]:
    """The paths between rests: operation, part, time, pose in the world."""
    for k, seen in enumerate(recording.operations, 1):
        if seen.path is not None and seen.stay is not None:
            for t, T in zip(*seen.path, strict=True):
                yield (k, seen.stay.part, round(float(t), 6), *(pose.pack(T) * _POSE_UNITS).round(6).tolist())


PATH_HEAD = ("operation", "part", "t_s", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")


def _paths(recording: ImportedRecording) -> Iterator[str]:
    for approach in approaches(recording.scenario, recording.operations, recording.camera.T_world_camera):
        main = recording.scenario.assembly.operations[approach.operation].main
        operation = f"operation {approach.operation + 1} ({main})"
        if approach.end is None:
            yield f"{operation} shows no straight end"
            continue
        way = direction(np.round(approach.end.direction, 2))
        how = f"unlike the plan, whose nearest motion, `{approach.macro}`, is"
        if approach.off_deg <= _ALIKE_DEG:
            how = f"as `{approach.macro}` of the plan,"
        yield (
            f"{operation} ends along {way} of the part for {1e3 * approach.end.length_m:.0f} mm, {how} "
            f"{approach.off_deg:.0f} deg off"
        )


def _rest_cells(rest: RestSpan, X: Array) -> list[str]:
    m, rad = per_axis(rest.mean.scatter)
    begins, ends, *place = (f"{x:.2f}" for x in (rest.begins, rest.ends, *(1e3 * (X @ rest.T)[:3, 3])))
    off = f"{1e3 * m:.2f} mm {np.degrees(rad):.2f} deg"
    return [begins, ends, str(len(rest.mean.inlier)), str(int((~rest.mean.inlier).sum())), *place, off]


def _pose_text(T: Array) -> str:
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_matrix(T[:3, :3]).as_rotvec(degrees=True)
    angle = float(np.linalg.norm(turn))
    about = f" about {_listed(turn / angle)}" if angle > 0.05 else ""
    return f"at {_listed(1e3 * T[:3, 3])} mm, turned {angle:.1f} deg{about}"


def _listed(v: Array) -> str:
    return f"({', '.join(f'{x + 0.0:.4g}' for x in np.round(v, 3))})"


def _mm(twist: Array) -> float:
    return 1e3 * float(np.linalg.norm(twist[:3]))


def _deg(twist: Array) -> float:
    return float(np.degrees(np.linalg.norm(twist[3:])))
