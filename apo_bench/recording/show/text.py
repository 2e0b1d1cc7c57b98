"""What was made of a recording, in words and as tables of files."""

import csv
import io
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.io.words import columns, direction
from apo_bench.recording.approach import approaches
from apo_bench.recording.bare import Bare
from apo_bench.recording.camera_pose import CameraPose
from apo_bench.recording.importing import Imported
from apo_bench.recording.log import Log
from apo_bench.recording.objects_file import ObjectsFile
from apo_bench.recording.rests import Rest

_HEADS = ("", "part", "rests from", "until s", "frames", "outliers", "x mm", "y mm", "z mm", "a frame is off by")
_MOST_TIMES = 5


def reading_lines(log: Log, objects: ObjectsFile) -> list[tuple[str, str]]:
    """Frames, units and orders, before anything is trusted."""
    frames = sum(len(track.t) for track in log.tracks.values())
    lines = [("log", f"{log.file}: {len(log.tracks)} ids, {frames} poses, {log.seconds:.1f} s")]
    lines += [("read as", "; ".join(log.notes))]
    for part, one in objects.parts.items():
        lines.append(("frame", f"{part} is id {one.id}, its frame {_said(one.T_model_part)}, in the tracker's model"))
    return lines


def camera_lines(camera: CameraPose) -> list[tuple[str, str]]:
    """Where the camera stands, and how well known places agree."""
    stands = f"{_said(camera.T_world_camera)}; its axes are those of OpenCV"
    if not camera.residuals:
        return [("camera", f"as stated: {stands}")]
    off = ", ".join(f"{p} {1e3 * np.linalg.norm(r[:3]):.2f} mm {_deg(r):.2f} deg" for p, r in camera.residuals.items())
    return [("camera", f"solved: {stands}"), ("residuals", off)]


def imported_lines(found: Imported) -> list[tuple[str, str]]:
    """What is known of starts, contacts, paths, and what stays unclear."""
    stood = {
        whence: [part for part, one in found.stood.items() if one == whence] for whence in ("known", "seen", "scenario")
    }
    said = [
        f"{', '.join(parts)} {how}"
        for how, parts in (
            ("on known places", stood["known"]),
            ("where they were seen, standing as in the scenario", stood["seen"]),
            ("as in the scenario", stood["scenario"]),
        )
        if parts
    ]
    lines = [
        ("starts", "; ".join(said)),
        (
            "contacts",
            f"open by up to {1e3 * found.fit.gap_m:.2f} mm and {np.degrees(found.fit.angle_rad):.2f} deg as seen",
        ),
    ]
    if not found.stays_stated:
        lines.append(
            (
                "noise",
                "an error that stays while a part rests cannot be seen: taken as large as that of one frame; "
                "state [noise] in the camera file",
            )
        )
    lines += [("path", text) for text in _paths(found)]
    for k, one in enumerate(found.operations):
        if one.rest is None:
            lines.append(("not seen", f"operation {k + 1}, as stated"))
        lines += [
            ("moved", f"{part} by {_far(moved)} in the hand during operation {k + 1}")
            for part, moved in one.carried.items()
            if np.linalg.norm(moved[:3]) > 1e-3
        ]
        lines += [
            (
                "moved",
                f"{part} by {_far(moved)} during operation {k + 1}, which does not move it: counted into its error",
            )
            for part, moved in one.adjusted.items()
            if np.linalg.norm(moved[:3]) > 1e-3
        ]
    return lines + [("unclear", text) for text in found.unclear]


def rest_lines(rests: Sequence[tuple[str, Rest | None]], X: Array, times: Mapping[str, Array]) -> list[str]:
    """One line for each operation: when its part came to rest, and what its frames show; then the outliers.

    Args:
        rests: Part and rest of each operation.
        X: (4, 4), world from camera.
        times: Part -> times of its frames, [s].
    """
    cells = [
        (str(k), part, *(_rest_cells(rest, X) if rest else ["not seen", *[""] * 7]))
        for k, (part, rest) in enumerate(rests, 1)
    ]
    outliers = []
    for k, (part, rest) in enumerate(rests, 1):
        if rest is None or rest.mean.inlier.all():
            continue
        t = times[part][rest.first : rest.last + 1][~rest.mean.inlier]
        shown = ", ".join(f"{x:.2f}" for x in t[:_MOST_TIMES]) + (", ..." if len(t) > _MOST_TIMES else "")
        outliers.append(f"outliers of operation {k} ({part}) at {shown} s, left out")
    return [*columns([_HEADS, *cells]), *([""] if outliers else []), *outliers]


def put_lines(found: Bare) -> list[str]:
    """What a log says by itself of the order of operations."""
    said = []
    for k, put in enumerate(found.puts, 1):
        if put.carries:
            said.append(
                f"operation {k}: {put.part} and {', '.join(put.carries)} moved together; {put.part}, which was "
                "taken first, is what the hand held, as far as the log tells"
            )
    return said


def observation_table(
    parts: Sequence[str], goals: Array, deviations: Sequence[tuple[float, float]], seen: Sequence[bool]
) -> str:
    """An observation file as CSV, mm and degrees."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(
        ["operation", "part", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz", "deviation_mm", "deviation_deg", "seen"]
    )
    for k, (part, T, (mm, deg), was) in enumerate(zip(parts, goals, deviations, seen, strict=True), 1):
        packed = (pose.pack(T) * [1e3, 1e3, 1e3, 1, 1, 1, 1]).round(9).tolist()
        writer.writerow([k, part, *packed, f"{1e3 * mm:.4g}", f"{np.degrees(deg):.4g}", "true" if was else "false"])
    return text.getvalue()


def path_rows(found: Imported) -> Iterator[tuple[object, ...]]:
    """The paths between rests: operation, part, time, pose in the world."""
    for k, (operation, one) in enumerate(zip(found.scenario.assembly.operations, found.operations, strict=True), 1):
        if one.path is not None:
            for t, T in zip(one.path.t, one.path.T, strict=True):
                packed = (pose.pack(T) * [1e3, 1e3, 1e3, 1, 1, 1, 1]).round(6).tolist()
                yield (k, operation.main, round(float(t), 6), *packed)


PATH_HEAD = ("operation", "part", "t_s", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")


def _paths(found: Imported) -> Iterator[str]:
    for one in approaches(found):
        main = found.scenario.assembly.operations[one.operation].main
        if one.straight is None:
            yield f"operation {one.operation + 1} ({main}) shows no straight end"
            continue
        way = direction(np.round(one.straight.direction, 2))
        how = (
            f"as `{one.macro}` of the plan, {one.off_deg:.0f} deg off"
            if one.alike
            else (f"unlike the plan, whose nearest motion, `{one.macro}`, is {one.off_deg:.0f} deg off")
        )
        far = f"{1e3 * one.straight.length_m:.0f} mm"
        yield f"operation {one.operation + 1} ({main}) ends along {way} of the part for {far}, {how}"


def _rest_cells(rest: Rest, X: Array) -> list[str]:
    S = rest.mean.scatter
    p = 1e3 * (X @ rest.T)[:3, 3]
    off = f"{1e3 * np.sqrt(np.trace(S[:3, :3]) / 3.0):.2f} mm {np.degrees(np.sqrt(np.trace(S[3:, 3:]) / 3.0)):.2f} deg"
    left = int((~rest.mean.inlier).sum())
    return [
        f"{rest.begins:.2f}",
        f"{rest.ends:.2f}",
        str(len(rest.mean.inlier)),
        str(left),
        *(f"{x:.2f}" for x in p),
        off,
    ]


def _said(T: Array) -> str:
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_matrix(T[:3, :3]).as_rotvec(degrees=True)
    angle = float(np.linalg.norm(turn))
    about = f" about {_listed(turn / angle)}" if angle > 0.05 else ""
    return f"at {_listed(1e3 * T[:3, 3])} mm, turned {angle:.1f} deg{about}"


def _listed(v: Array) -> str:
    return f"({', '.join(f'{x + 0.0:.4g}' for x in np.round(v, 3))})"


def _far(twist: Array) -> str:
    return f"{1e3 * np.linalg.norm(twist[:3]):.1f} mm and {_deg(twist):.1f} deg"


def _deg(twist: Array) -> float:
    return float(np.degrees(np.linalg.norm(twist[3:])))
