"""Logs as trackers write them give the rests of `docs/recording.csv`, of which each is a variant."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from apo_bench import load_scenario
from apo_bench.geometry import Array, pose
from apo_bench.importers.recording.camera_file import CameraFile, Conventions
from apo_bench.importers.recording.formats import read_log
from apo_bench.importers.recording.importing import ImportedRecording, import_recording
from apo_bench.importers.recording.matching import match_tracks
from apo_bench.importers.recording.objects_file import ObjectsFile, TrackedPart, merge_tags
from apo_bench.importers.recording.ordering import Stated

ROOT = Path(__file__).parents[3]
MODEL = pose.at((0.0, 0.0, -0.01), (0.0, 0.0, 90.0))
PARTS = {
    "castle1": TrackedPart(("11",), np.eye(4), {}),
    "castle2": TrackedPart(("12",), np.eye(4), {}),
    "stick": TrackedPart(("13",), MODEL, {}),
}
KNOWN = CameraFile(Conventions(), None, dict.fromkeys(PARTS), None)
HEAD = "t_s,id,x_mm,y_mm,z_mm,qw,qx,qy,qz"
OVER = MODEL @ pose.at((0.0, 0.0, 0.0), (180.0, 0.0, 0.0)) @ pose.inverse(MODEL)
"""A half turn of the stick about an axis of its symmetry, in the frame of the tracker's model."""
TAG = pose.at((0.0, 0.0, -0.04), (180.0, 0.0, 0.0))
"""Where a second tag is on the stick, in the frame of the first."""
DEVIATIONS = (0.4831, 1.495, 0.6494)
Rows = list[tuple[float, str, Array]]


@cache
def logged() -> tuple[tuple[float, str, Array], ...]:
    with (ROOT / "docs" / "recording.csv").open(encoding="utf-8", newline="") as file:
        rows = [[*row.values()] for row in csv.DictReader(file)]
    scale = [1e-3, 1e-3, 1e-3, 1, 1, 1, 1]
    return tuple((float(t), name, pose.unpack(np.array(q, dtype=np.float64) * scale)) for t, name, *q in rows)


def cells(T: Array) -> list[str]:
    return [f"{x:.9g}" for x in pose.pack(T) * [1e3, 1e3, 1e3, 1, 1, 1, 1]]


def table(rows: Rows, lost: Callable[[int], list[str] | None] = lambda i: None) -> str:
    lines = [",".join([f"{t:.6f}", name, *(lost(i) or cells(T))]) for i, (t, name, T) in enumerate(rows)]
    return "\n".join([HEAD, *lines]) + "\n"


def some(share: float, i: int) -> bool:
    """Whether a frame is among a share of them that looks drawn, the same on every machine."""
    return (i * 0.6180339887) % 1.0 < share


def stick(change: Callable[[int, float, Array], Array]) -> Rows:
    return [(t, name, change(i, t, T) if name == "13" else T) for i, (t, name, T) in enumerate(logged())]


def by_id(name: str) -> Rows:
    return [row for row in logged() if row[1] == name]


def metres(T: Array) -> list[str]:
    packed = pose.pack(T)
    return [f"{x:.9g}" for x in (*packed[:3], *packed[4:], packed[3])]


def bop(rows: Rows) -> str:
    lines = ["scene_id,im_id,obj_id,score,R,t,time"]
    for t, name, T in rows:
        numbers = [" ".join(f"{x:.9g}" for x in np.ravel(v)) for v in (T[:3, :3], 1e3 * T[:3, 3])]
        lines.append(f"1,{round((t - 99.99) * 30)},{1 if name != '13' else 2},0.9,{numbers[0]},{numbers[1]},-1")
    return "\n".join(lines) + "\n"


def motive(rows: Rows) -> str:
    ids = ("11", "12", "13")
    heads = [
        "Format Version,1.23,Take Name,a,Export Frame Rate,15.000000,Rotation Type,Quaternion,Length Units,Meters",
        "",
        ",," + ",".join(["Rigid Body"] * 21),
        ",," + ",".join(name for name in ids for _ in range(7)),
        ",," + ",".join(f'"{name}"' for name in ids for _ in range(7)),
        ",," + ",".join((["Rotation"] * 4 + ["Position"] * 3) * 3),
        "Frame,Time (Seconds)," + ",".join(["X,Y,Z,W,X,Y,Z"] * 3),
    ]
    frames: dict[int, dict[str, list[str]]] = {}
    for t, name, T in rows:
        values = metres(T)
        frames.setdefault(round((t - 99.99) * 30), {})[name] = [*values[3:], *values[:3]]
    for k in sorted(frames):
        heads.append(",".join([str(k), f"{k / 30:.6f}", *(x for name in ids for x in frames[k].get(name, [""] * 7))]))
    return "\n".join(heads) + "\n"


def plot_juggler(rows: Rows) -> str:
    names = [f"/tracker/{name}/pose/{x}" for name in ("11", "12", "13") for x in FIELDS]
    lines = [
        ",".join([f"{t:.6f}", *(x for other in ("11", "12", "13") for x in (metres(T) if other == name else [""] * 7))])
        for t, name, T in rows
    ]
    return "\n".join([",".join(["__time", *names]), *lines]) + "\n"


FIELDS = [f"position/{a}" for a in "xyz"] + [f"orientation/{a}" for a in "xyzw"]


def vicon(rows: Rows) -> str:
    ids = ("11", "12", "13")
    lines = [
        "Objects",
        "30",
        ",," + ",,,,,,,".join(f"Global Angle {name}:{name}" for name in ids) + ",,,,,,",
        "Frame,Sub Frame," + ",".join(["RX,RY,RZ,RW,TX,TY,TZ"] * 3),
        ",," + ",".join([",,,,mm,mm,mm"] * 3),
    ]
    frames: dict[int, dict[str, list[str]]] = {}
    for t, name, T in rows:
        values = cells(T)
        frames.setdefault(round((t - 99.99) * 30), {})[name] = [*values[4:], values[3], *values[:3]]
    lines += [",".join([str(k), "0", *(x for n in ids for x in frames[k].get(n, [""] * 7))]) for k in sorted(frames)]
    return "\n".join(lines) + "\n"


def detections(rows: Rows) -> str:
    lines = []
    for t, name, T in rows:
        p = pose.pack(T).tolist()
        at = {"position": dict(zip("xyz", p[:3], strict=True)), "orientation": dict(zip("wxyz", p[3:], strict=True))}
        found = {
            "results": [{"hypothesis": {"class_id": name, "score": 0.9}, "pose": {"pose": at}}],
            "bbox": {"center": at},
        }
        stamp = {"sec": int(t), "nanosec": round(t % 1 * 1e9)}
        lines.append(json.dumps({"header": {"stamp": stamp, "frame_id": "camera"}, "detections": [found]}))
    return "\n".join(lines) + "\n"


def apriltags(rows: Rows) -> str:
    frames = [
        {
            "timestamp": t,
            "detections": [
                {"tag_id": int(name), "pose_R": T[:3, :3].tolist(), "pose_t": T[:3, 3:].tolist(), "center": [1, 2]}
            ],
        }
        for t, name, T in rows
    ]
    return json.dumps(frames)


def megapose(folder: Path, rows: Rows) -> None:
    images: dict[int, list[object]] = {}
    for t, name, T in rows:
        p = pose.pack(T).tolist()
        images.setdefault(round((t - 99.99) * 30), []).append({"label": name, "TWO": [[*p[4:], p[3]], p[:3]]})
    for k, objects in images.items():
        (folder / f"{k:06d}.json").write_text(json.dumps(objects), encoding="utf-8")


def foundation_pose(folder: Path, rows: Rows) -> None:
    for t, name, T in rows:
        file = folder / name / "ob_in_cam" / f"{round((t - 99.99) * 30):06d}.txt"
        file.parent.mkdir(parents=True, exist_ok=True)
        np.savetxt(file, T)


def each_id(folder: Path, line: Callable[[float, Array], str], suffix: str, head: str = "") -> None:
    for name in ("11", "12", "13"):
        text = head + "\n".join(line(t, T) for t, _, T in by_id(name)) + "\n"
        (folder / f"{name}{suffix}").write_text(text, encoding="utf-8")


def echo(t: float, T: Array) -> str:
    return ",".join([str(int(t)), str(round(t % 1 * 1e9)), "camera", *metres(T)])


LOST = {
    "identity": ["0", "0", "0", "1", "0", "0", "0"],
    "zeros": ["0"] * 7,
    "nan": ["NaN"] * 7,
    "blank": [""] * 7,
    "minus one": ["-1"] * 3 + ["1", "0", "0", "0"],
}
EUROC = "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []\n"
TEXTS: Mapping[str, Callable[[], str]] = {
    "as it is": lambda: table([*logged()]),
    "comments": lambda: "# my tracker 1.2\n\n# camera: cam0\n" + table([*logged()]),
    "semicolons": lambda: table([*logged()]).replace(",", ";").replace(".", ","),
    "flips": lambda: table(stick(lambda i, t, T: T @ OVER if some(0.3, i) else T)),
    "flipped for good": lambda: table(stick(lambda i, t, T: T @ OVER if t > 105.0 else T)),
    "ids swapped": lambda: table(
        [(t, {"11": "12", "12": "11"}.get(n, n) if t > 103.5 else n, T) for t, n, T in logged()]
    ),
    "one id for two parts": lambda: bop([*logged()]),
    "two tags": lambda: table([(t, "23", T @ TAG) if n == "13" and t > 106.5 else (t, n, T) for t, n, T in logged()]),
    "an id that changes": lambda: table([(t, "23" if n == "13" and t > 106.5 else n, T) for t, n, T in logged()]),
    "two tags at once": lambda: table(
        [
            row
            for t, n, T in logged()
            for row in ((t, n, T), *([(t, "23", T @ TAG)] if n == "13" and some(0.4, int(t * 9)) else []))
        ]
    ),
    **{f"lost as {k}": lambda k=k: table([*logged()], lambda i: LOST[k] if some(0.15, i) else None) for k in LOST},
    "not valid": lambda: "\n".join(
        f"{line},{'valid' if i == 0 else int(not some(0.15, i))}"
        for i, line in enumerate(table([*logged()]).splitlines())
    ),
    "motive": lambda: motive([*logged()]),
    "vicon": lambda: vicon([*logged()]),
    "plotjuggler": lambda: plot_juggler([*logged()]),
    "detections": lambda: detections([*logged()]),
    "apriltags": lambda: apriltags([*logged()]),
}
FOLDERS: Mapping[str, Callable[[Path], None]] = {
    "foundationpose": lambda folder: foundation_pose(folder, [*logged()]),
    "megapose": lambda folder: megapose(folder, [*logged()]),
    "tum with commas": lambda folder: each_id(folder, lambda t, T: ",".join([f"{t:.6f}", *metres(T)]), ".txt"),
    "ros2 topic echo": lambda folder: each_id(folder, echo, ".csv"),
    "euroc": lambda folder: each_id(
        folder, lambda t, T: ",".join([str(round(t * 1e9)), *(f"{x:.9g}" for x in pose.pack(T))]), ".csv", EUROC
    ),
}


def imported(path: Path, parts: Mapping[str, TrackedPart] = PARTS) -> ImportedRecording:
    scenario = load_scenario("stick_in_tower")
    log = read_log(path, Conventions(rate_hz=30.0))
    solids = scenario.assembly.solids
    matched = match_tracks(log, merge_tags(ObjectsFile("objects.toml", parts, frozenset()), solids), solids)
    return import_recording(
        matched.tracks, KNOWN, scenario, Stated(), str(path), None, matched.identical, matched.offsets
    )


@cache
def whole() -> ImportedRecording:
    return imported(ROOT / "docs" / "recording.csv")


def test_the_recording_of_the_guide_gives_what_it_gave() -> None:
    """Positions in mm, and the standard deviations of x in mm: castle2 was moved by 1.4 mm when the stick came in."""
    found = whole().observation
    wanted = [[86.899847, -31.642610, 0.034543], [88.309970, -33.795005, 79.913877], [82.692679, -32.838378, 39.826257]]
    np.testing.assert_allclose(1e3 * found.poses[:, :3, 3], wanted, atol=1e-5)  # other kernels round otherwise
    np.testing.assert_allclose(
        np.sqrt(np.trace(whole().covariance[:, :3, :3], axis1=1, axis2=2) / 3.0) * 1e3, DEVIATIONS, rtol=1e-3
    )


@pytest.mark.parametrize("name", [*TEXTS, *FOLDERS])
def test_a_log_gives_the_rests_of_the_recording(name: str, tmp_path: Path) -> None:
    path = tmp_path
    if name in FOLDERS:
        FOLDERS[name](tmp_path)
    else:
        path = tmp_path / ("log.json" if name == "apriltags" else "log.jsonl" if name == "detections" else "log.csv")
        path.write_text(TEXTS[name](), encoding="utf-8")
    parts = dict(PARTS)
    if name == "one id for two parts":
        parts = {part: one._replace(ids=("2" if part == "stick" else "1",)) for part, one in PARTS.items()}
    if name.startswith("two tags") or name == "an id that changes":
        parts["stick_tag2"] = TrackedPart(("23",), np.eye(4), {})
    found = imported(path, parts)
    # The camera is solved from other frames, and rests have fewer: both errors are within the stated deviations.
    off = pose.log(pose.inverse(whole().observation.poses) @ found.observation.poses)
    deviation = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
    assert (np.abs(off) < 3.0 * deviation).all()
    least = 0.5 * np.sqrt(np.diagonal(whole().covariance, axis1=1, axis2=2))
    assert (deviation > least).all()
    assert (deviation < (5.0 if name == "two tags" else 1.5) * 2.0 * least).all()
