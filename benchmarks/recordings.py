"""Logs of a pose tracker from simulated demonstrations, in every format, and what their corrected plans are worth.

    python benchmarks/recordings.py --write DIR             # one log in each format, with its camera and objects files
    python benchmarks/recordings.py --trials 20 --level 1   # the share of corrected plans that succeed

A stationary camera at an unknown pose sees every part in the frame of the tracker's own model, 30 times a second, with
jitter of the clock, drop-outs and frames that are wrong. An error has two parts: one that is drawn for each frame, and
one that stays as long as the part rests. The plan is carried out with the parts where they truly stand, and judged
with the true goals.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from apo_bench.assembly.goals import Layout
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.judging.verdict import judge
from apo_bench.observation.models.camera import WORKSPACE_MIDDLE_M
from apo_bench.recording.camera_file import read_camera
from apo_bench.recording.formats import read_log
from apo_bench.recording.importing import import_recording
from apo_bench.recording.objects_file import part_tracks, read_objects
from apo_bench.recording.ordering import Stated
from apo_bench.records.settings import TrialSettings
from apo_bench.scenario.layout import draw_layout
from apo_bench.simulation.execution.controller import replay
from apo_bench.simulation.human.demonstration import demonstrate
from apo_bench.simulation.scene.scene import Scene
from apo_bench.simulation.scene.world import part_pose
from apo_bench.trial.planning import apply_method
from apo_bench.trial.scene import scene_of
from apo_bench.trial.stages import DEMONSTRATION, LAYOUT, stream

RATE_HZ = 30.0
BEGINS_S = 100.0
"""What the tracker's clock says then."""
BEFORE_S = 1.0
"""The log begins so long before the hand takes the first part."""
TASKS = ("stick_in_tower", "stick_on_castles", "pocket_table", "carried_bridge")


class Truth(NamedTuple):
    """A demonstration and how its parts moved."""

    scene: Scene
    layout: Layout
    t: Array
    """(n,), [s]."""
    T: Mapping[str, Array]
    """Part -> (n, 4, 4), world, [m]."""


class Tracked(NamedTuple):
    """What a tracker reports of one model."""

    id: str
    T_model_part: Array
    t: Array
    T: Array
    """(n, 4, 4), camera from model, [m]."""


class Errors(NamedTuple):
    """Standard deviations per axis, mm and degrees alike, and how often a frame is missing or wrong."""

    frame: float = 1.0
    stays: float = 0.0
    dropped: float = 0.1
    wrong: float = 0.01
    jitter_s: float = 2e-3


class _Watch:
    def __init__(self, scene: Scene) -> None:
        self.period_s = 1.0 / RATE_HZ
        self._scene = scene
        self.t: list[float] = []
        self.T: list[Mapping[str, Array]] = []

    def __call__(self, data: Any) -> None:
        self.t.append(float(data.time))
        self.T.append({part: part_pose(self._scene.shown, data, part) for part in self._scene.shown.free})


def watched(scenario: str, seed: int, careless: float = 1.0) -> Truth | None:
    """A simulated demonstration; None if it failed itself."""
    scene = scene_of(TrialSettings(scenario=scenario, seed=seed))
    layout = draw_layout(scene.scenario, stream(seed, LAYOUT), scene.clearance_mm)
    watch = _Watch(scene)
    done = demonstrate(scene, layout, careless, stream(seed, DEMONSTRATION), watch)
    if done.code != "ok":
        return None
    still = np.arange(-BEFORE_S, -0.5 / RATE_HZ, 1.0 / RATE_HZ)
    parts = {part: np.array([poses[part] for poses in watch.T]) for part in watch.T[0]}
    T = {part: np.concatenate([np.repeat(x[:1], len(still), axis=0), x]) for part, x in parts.items()}
    n = len(still) + len(watch.t)
    T |= {part: np.repeat(layout.start[part][None], n, axis=0) for part in sorted(scene.scenario.follows_site)}
    return Truth(scene, layout, np.concatenate([still, watch.t]) + BEFORE_S, T)


def tracked(truth: Truth, errors: Errors, rng: np.random.Generator) -> tuple[Array, dict[str, Tracked]]:
    """The camera's pose, which nobody knows, and what its tracker reports of every part."""
    X = _camera(rng)
    found = {}
    for i, (part, T) in enumerate(truth.T.items()):
        T_model_part = pose.at(rng.uniform(-0.02, 0.02, 3), rng.uniform(-180.0, 180.0, 3))
        n = len(T)
        xi = errors.frame * rng.standard_normal((n, 6)) + errors.stays * _staying(T, rng)
        xi[rng.random(n) < errors.wrong] *= 30.0
        T_seen = pose.inverse(X) @ T @ pose.exp(xi * np.repeat([1e-3, np.radians(1.0)], 3)) @ pose.inverse(T_model_part)
        kept = rng.random(n) >= errors.dropped
        gap = int(rng.integers(0, n))
        kept[gap : gap + 4] = False
        t = truth.t + np.clip(errors.jitter_s * rng.standard_normal(n), -0.4 / RATE_HZ, 0.4 / RATE_HZ)
        found[part] = Tracked(str(11 + i), T_model_part, BEGINS_S + t[kept], T_seen[kept])
    return X, found


def _camera(rng: np.random.Generator) -> Array:
    """Obliquely from above, from any side, looking at the workspace."""
    turn, up = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.5, 1.1)
    z = -np.array([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)])
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = np.column_stack([x, np.cross(z, x), z]), WORKSPACE_MIDDLE_M - rng.uniform(0.8, 1.2) * z
    return X


def _staying(T: Array, rng: np.random.Generator) -> Array:
    """Errors (n, 6) that change whenever the part has moved: drawn anew at every turn of 30 mm or 10 degrees of way."""
    step = pose.log(pose.inverse(T[:-1]) @ T[1:])
    way = np.linalg.norm(step[:, :3], axis=1) / 0.03 + np.linalg.norm(step[:, 3:], axis=1) / np.radians(10.0)
    walked = np.concatenate([[0.0], np.cumsum(way)])
    at = np.floor(walked).astype(int)
    drawn = rng.standard_normal((at[-1] + 2, 6))
    part = (walked - at)[:, None]
    mixed = (1.0 - part) * drawn[at] + part * drawn[at + 1]
    return np.asarray(mixed / np.sqrt(part**2 + (1.0 - part) ** 2))


def camera_text(log: str, known: Mapping[str, str], stays: float | None) -> str:
    """A camera file: how the log is written, and which parts stand on known places."""
    lines = ['schema = "apo-bench/camera/1"', "", *(["[log]", log, ""] if log else []), "[known]"]
    lines += [f"{part} = {place}" for part, place in known.items()]
    lines += [] if stays is None else ["", "[noise]", f"stays_mm = {stays:g}", f"stays_deg = {stays:g}"]
    return "\n".join(lines) + "\n"


def objects_text(found: Mapping[str, Tracked]) -> str:
    """An objects file."""
    lines = ['schema = "apo-bench/objects/1"', "", "[objects]"]
    for part, one in found.items():
        packed = pose.pack(one.T_model_part)
        at, q = (", ".join(f"{x:.9g}" for x in numbers) for numbers in (packed[:3] * 1e3, packed[3:]))
        lines.append(f'{part} = {{ id = "{one.id}", frame = {{ at_mm = [{at}], quaternion_wxyz = [{q}] }} }}')
    return "\n".join(lines) + "\n"


def _rows(found: Mapping[str, Tracked]) -> list[tuple[float, str, Array]]:
    return sorted(
        ((t, one.id, T) for one in found.values() for t, T in zip(one.t, one.T, strict=True)), key=lambda r: r[:2]
    )


def _csv(head: str, numbers: Callable[[Array], Array]) -> Callable[[Mapping[str, Tracked], Path], None]:
    def write(found: Mapping[str, Tracked], path: Path) -> None:
        rows = [f"{t:.6f},{name}," + ",".join(f"{x:.7g}" for x in numbers(T)) for t, name, T in _rows(found)]
        path.write_text("\n".join([f"t_s,id,{head}", *rows]) + "\n", encoding="utf-8")

    return write


def _with(scale: float, rotation: Callable[[Rotation], Array]) -> Callable[[Array], Array]:
    return lambda T: np.concatenate([T[:3, 3] * scale, np.ravel(rotation(Rotation.from_matrix(T[:3, :3])))])


def _bop(found: Mapping[str, Tracked], path: Path) -> None:
    rows = []
    for t, name, T in _rows(found):
        R, at = (" ".join(f"{x:.8g}" for x in np.ravel(numbers)) for numbers in (T[:3, :3], T[:3, 3] * 1e3))
        rows.append(f"1,{round(t * RATE_HZ)},{name},0.9,{R},{at},0.03")
    path.write_text("\n".join(["scene_id,im_id,obj_id,score,R,t,time", *rows]) + "\n", encoding="utf-8")


def _tum(found: Mapping[str, Tracked], path: Path) -> None:
    path.mkdir()
    for one in found.values():
        packed = pose.pack(one.T)[:, [0, 1, 2, 4, 5, 6, 3]]
        lines = [" ".join(f"{x:.9g}" for x in (t, *row)) for t, row in zip(one.t, packed, strict=True)]
        (path / f"{one.id}.txt").write_text(
            "# timestamp tx ty tz qx qy qz qw\n" + "\n".join(lines) + "\n", encoding="utf-8"
        )


def _ros_csv(found: Mapping[str, Tracked], path: Path) -> None:
    names = [f"transform.translation.{a}" for a in "xyz"] + [f"transform.rotation.{a}" for a in "xyzw"]
    rows = [
        f"{int(t)},{round(t % 1 * 1e9)},camera,{name},"
        + ",".join(f"{x:.9g}" for x in pose.pack(T)[[0, 1, 2, 4, 5, 6, 3]])
        for t, name, T in _rows(found)
    ]
    head = "header.stamp.sec,header.stamp.nanosec,header.frame_id,child_frame_id," + ",".join(names)
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")


def _ros_json(found: Mapping[str, Tracked], path: Path) -> None:
    lines = []
    for t, name, T in _rows(found):
        packed = pose.pack(T).tolist()
        lines.append(
            json.dumps(
                {
                    "topic": f"/tracker/{name}",
                    "msg": {
                        "header": {"stamp": {"sec": int(t), "nanosec": round(t % 1 * 1e9)}, "frame_id": "camera"},
                        "pose": {
                            "position": dict(zip("xyz", packed[:3], strict=True)),
                            "orientation": dict(zip("wxyz", packed[3:], strict=True)),
                        },
                    },
                }
            )
        )
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


class Form(NamedTuple):
    """A way to write a log."""

    format: str
    file: str
    log: str
    """What the camera file has to say about it."""
    write: Callable[[Mapping[str, Tracked], Path], None]


FORMS: Mapping[str, Form] = {
    "csv-wxyz": Form(
        "csv", "log.csv", "", _csv("x_mm,y_mm,z_mm,qw,qx,qy,qz", _with(1e3, lambda R: R.as_quat(scalar_first=True)))
    ),
    "csv-xyzw": Form(
        "csv", "log.csv", 'quaternion = "xyzw"', _csv("x_m,y_m,z_m,q0,q1,q2,q3", _with(1.0, lambda R: R.as_quat()))
    ),
    "csv-rotvec": Form(
        "csv",
        "log.csv",
        "",
        _csv("x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg", _with(1e3, lambda R: np.degrees(R.as_rotvec()))),
    ),
    "csv-euler": Form(
        "csv",
        "log.csv",
        'euler = "ZYX"\nangle = "rad"\nlength = "m"',
        _csv("x,y,z,e1,e2,e3", _with(1.0, lambda R: R.as_euler("ZYX"))),
    ),
    "csv-matrix": Form(
        "csv",
        "log.csv",
        "",
        _csv(
            "x_mm,y_mm,z_mm," + ",".join(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)),
            _with(1e3, lambda R: R.as_matrix()),
        ),
    ),
    "bop": Form("bop", "log.csv", f"rate_hz = {RATE_HZ:g}", _bop),
    "tum": Form("tum", "log", "", _tum),
    "ros-csv": Form("ros-csv", "log.csv", "", _ros_csv),
    "ros-json": Form("ros-json", "log.jsonl", "", _ros_json),
}
"""Every way in which a log may be written."""


def write_recording(form: Form, truth: Truth, found: Mapping[str, Tracked], folder: Path, stays: float | None) -> Path:
    """Write a log with its camera.toml and objects.toml; returns the log. Every part begins on a known place."""
    ids = {
        part: one if form.format != "ros-json" else one._replace(id=f"tracker/{one.id}") for part, one in found.items()
    }
    form.write(found, folder / form.file)
    known = dict.fromkeys(found, '"start"')
    for part in truth.scene.scenario.follows_site:
        packed = pose.pack(truth.layout.start[part])
        at, q = (", ".join(f"{x:.9g}" for x in numbers) for numbers in (packed[:3] * 1e3, packed[3:]))
        known[part] = f"{{ at_mm = [{at}], quaternion_wxyz = [{q}] }}"
    (folder / "camera.toml").write_text(camera_text(form.log, known, stays), encoding="utf-8")
    (folder / "objects.toml").write_text(objects_text(ids), encoding="utf-8")
    return folder / form.file


def succeeds(truth: Truth, form: Form, errors: Errors, method: str, seed: int) -> tuple[bool, str]:
    """Whether the corrected plan of one recording succeeds, and what ended it."""
    _, found = tracked(truth, errors, np.random.default_rng([seed, 9]))
    with tempfile.TemporaryDirectory() as folder:
        path = write_recording(form, truth, found, Path(folder), errors.stays or None)
        camera = read_camera(Path(folder) / "camera.toml")
        log = read_log(path, form.format, camera.conventions)
        tracks = part_tracks(log, read_objects(Path(folder) / "objects.toml"))
        imported = import_recording(tracks, camera, truth.scene.scenario, Stated(), "log")
    made = apply_method(method, imported.observation, None, where=truth.scene)
    if made.plan is None:
        return False, made.failure.sentence if made.failure else "no plan"
    done = replay(made.plan, truth.scene, parts_at=truth.layout.start, fidelity="contact")
    verdict = judge(truth.scene.scenario.assembly, done.reached, truth.layout.goals, truth.scene.criteria)
    return verdict.success, done.outcome.code if done.outcome.failed else verdict.rests_on.code


def write_example(path: Path) -> None:
    """The log of the guide: 15 frames a second, ids 11 to 13, and a stick whose model lies otherwise than the part."""
    truth = watched("stick_in_tower", 3)
    assert truth is not None
    thin = truth._replace(t=truth.t[::2], T={part: T[::2] for part, T in truth.T.items()})
    rng = np.random.default_rng(19)
    X, found = tracked(thin, Errors(frame=0.5), rng)
    models = dict.fromkeys(found, np.eye(4)) | {"stick": pose.at((0.0, 0.0, -0.01), (0.0, 0.0, 90.0))}
    for part, one in found.items():
        T = one.T @ one.T_model_part @ pose.inverse(models[part])
        found[part] = one._replace(T_model_part=models[part], T=T)
    FORMS["csv-wxyz"].write(found, path)
    print(f"Wrote {path}; the camera stood at {np.round(1e3 * X[:3, 3], 1).tolist()} mm")


def main() -> None:
    """Write logs, or measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", type=Path, help="write one log in each format into this folder")
    parser.add_argument("--tasks", default=",".join(TASKS))
    parser.add_argument("--trials", type=int, default=25, help="of each task")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--level", type=float, default=1.0, help="mm and degrees of each frame")
    parser.add_argument("--stays", type=float, default=0.0, help="mm and degrees of the error that stays")
    parser.add_argument("--methods", default="none,contact-robust")
    parser.add_argument("--example", type=Path, help="write the log of the guide into this file")
    given = parser.parse_args()
    if given.example:
        return write_example(given.example)
    errors = Errors(frame=given.level, stays=given.stays)
    tasks = given.tasks.split(",")
    if given.write:
        truth = watched(tasks[0], given.first)
        assert truth is not None
        _, found = tracked(truth, errors, np.random.default_rng([given.first, 9]))
        for name, form in FORMS.items():
            (given.write / name).mkdir(parents=True)
            print(f"Wrote {write_recording(form, truth, found, given.write / name, errors.stays or None)}")
        return
    for task in tasks:
        right = dict.fromkeys(given.methods.split(","), 0)
        trials = 0
        for seed in range(given.first, given.first + given.trials):
            truth = watched(task, seed)
            if truth is None:
                continue
            form = list(FORMS.values())[seed % len(FORMS)]
            trials += 1
            for method in right:
                try:
                    good, why = succeeds(truth, form, errors, method, seed)
                except ValueError as error:
                    good, why = False, str(error)
                right[method] += good
                if not good:
                    print(f"  {task} seed {seed} {form.format} {method}: {why}", flush=True)
        print(f"{task}: {trials} recordings, " + ", ".join(f"{m} {n}" for m, n in right.items()), flush=True)


if __name__ == "__main__":
    main()
