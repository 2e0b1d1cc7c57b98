"""What `recording import` says of logs with which one thing is wrong each."""

from __future__ import annotations

import contextlib
import io
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.cli.app import main
from apo_bench.geometry import Array, pose
from benchmarks.recording_demos import Errors, first_places, tracked, watched
from benchmarks.recording_forms import Tracked, camera_text, known_text, objects_text

SCENARIO = "stick_in_tower"
HEAD = "t_s,id,x_mm,y_mm,z_mm,qw,qx,qy,qz"


class Files(NamedTuple):
    """A log as CSV with its camera and objects files."""

    t: Array
    ids: Array
    T: Array
    """(n, 4, 4), camera from model; lengths as they are written."""
    head: str
    camera: str
    objects: str
    found: Mapping[str, Tracked]
    """What the tracker saw, for other objects files."""
    text: str | None = None
    """The whole log, in place of the others."""

    def log(self) -> str:
        if self.text is not None:
            return self.text
        rows = [
            f"{t:.6f},{name}," + ",".join(f"{x:.9g}" for x in numbers)
            for t, name, numbers in zip(self.t, self.ids, pose.pack(self.T), strict=True)
        ]
        return "\n".join([self.head, *rows]) + "\n"


Change = Callable[[Files], Files]


def posed(change: Callable[[Array], Array]) -> Change:
    """Other poses."""
    return lambda files: files._replace(T=change(files.T))


def picked(which: Callable[[Files], Array]) -> Change:
    """Other rows, or another order of them."""

    def change(files: Files) -> Files:
        at = which(files)
        return files._replace(t=files.t[at], ids=files.ids[at], T=files.T[at])

    return change


def timed(change: Callable[[Array], Array]) -> Change:
    """Other times, sorted."""

    def other(files: Files) -> Files:
        t = change(files.t)
        at = np.argsort(t, kind="stable")
        return files._replace(t=t[at], ids=files.ids[at], T=files.T[at])

    return other


def edited(key: str, old: str, new: str) -> Change:
    """A file in which a text is another one."""

    def change(files: Files) -> Files:
        text = files.log() if key == "text" else str(getattr(files, key))
        assert old in text, (key, old)
        return files._replace(**{key: text.replace(old, new, 1)})  # type: ignore[arg-type]

    return change


def _scaled(factor: float) -> Callable[[Array], Array]:
    return lambda T: T * np.array([[1.0, 1.0, 1.0, factor]] * 3 + [[1.0] * 4])


def _reordered(T: Array) -> Array:
    packed = pose.pack(T)
    return np.asarray(pose.unpack(np.concatenate([packed[:, :3], np.roll(packed[:, 3:], -1, axis=1)], axis=1)))


def _inverted(T: Array) -> Array:
    return _scaled(1e3)(pose.inverse(_scaled(1e-3)(T)))


def _flipped(axis: int) -> Callable[[Array], Array]:
    flip = np.where(np.arange(4) == axis, -1.0, 1.0)
    return lambda T: T * np.outer(flip, flip)


def _without_frames(files: Files) -> Files:
    stated = {part: one._replace(T_model_part=np.eye(4)) for part, one in files.found.items()}
    return files._replace(objects=objects_text(stated))


def _one_of_each(files: Files) -> Array:
    return np.unique(files.ids, return_index=True)[1]


CHANGES: Mapping[str, Change] = {
    "mm in columns named `x_m`": lambda files: files._replace(head=HEAD.replace("_mm", "_m")),
    "m in columns named `x_mm`": posed(_scaled(1e-3)),
    "no unit in the names of the columns": lambda files: files._replace(head=HEAD.replace("_mm", "")),
    "milliseconds in the column `t_s`": timed(lambda t: 1e3 * t),
    "quaternions x, y, z, w in columns named w, x, y, z": posed(_reordered),
    "quaternions by number, order not stated": lambda files: files._replace(head="t_s,id,x_mm,y_mm,z_mm,q0,q1,q2,q3"),
    "x mirrored": posed(_flipped(0)),
    "poses of the camera in the model": posed(_inverted),
    "frames in the objects file forgotten": _without_frames,
    "time reversed": timed(lambda t: t.max() + t.min() - t),
    "every row twice": picked(lambda files: np.repeat(np.arange(len(files.t)), 2)),
    "an id that is no part": lambda files: files._replace(ids=np.where(files.ids == "13", "99", files.ids)),
    "a part that is not of the scenario": edited("objects", "stick", "stik"),
    "two parts with each other's ids": lambda files: files._replace(
        ids=np.select([files.ids == "11", files.ids == "13"], ["13", "11"], files.ids)
    ),
    "not a number": edited("text", "\n100.0", "\n100.0,11,nan,0,900,1,0,0,0\n100.0"),
    "an empty file": lambda files: files._replace(text=""),
    "one frame of each part": picked(_one_of_each),
    "a column is missing": edited("text", "qz", "note"),
    "no column of ids": edited("text", "id", "note"),
    "the camera file renames a column that is not there": edited(
        "camera", "[known]", '[log.columns]\nid = "body"\n\n[known]'
    ),
    "nothing is said of the camera": lambda files: files._replace(camera='schema = "apo-bench/camera/1"\n'),
    "semicolons between the columns": lambda files: files._replace(text=files.log().replace(",", ";")),
}
"""What is wrong -> how a log that fits becomes it."""


def refusals() -> Iterator[tuple[str, str]]:
    """What is wrong, and the sentence, without the name of the program."""
    right = _right()
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        assert _imported(right)[0] == 0
        for what, change in CHANGES.items():
            yield what, _refused(change(right), what)
        os.mkfifo("pipe.csv")
        yield "a pipe in place of the log", _refused(right, "pipe", "pipe.csv")
        yield "no such file", _refused(right, "file", "missing.csv")
        Path("noise.csv").write_bytes(np.random.default_rng(0).bytes(1000))
        yield "bytes that are no text", _refused(right, "bytes", "noise.csv")
        yield "another format", _refused(right, "format", form="tum")


def _right() -> Files:
    truth = watched(SCENARIO, 0)
    assert truth is not None
    _, found = tracked(truth, Errors(), np.random.default_rng([0, 9]))
    t = np.concatenate([one.t for one in found.values()])
    ids = np.concatenate([np.full(len(one.t), one.id) for one in found.values()])
    T = np.concatenate([one.T for one in found.values()])
    at = np.argsort(t, kind="stable")
    camera = camera_text("", known_text(first_places(truth, found)), None)
    return Files(t[at], ids[at], _scaled(1e3)(T[at]), HEAD, camera, objects_text(found), found)


def _refused(files: Files, what: str, log: str = "log.csv", form: str = "csv") -> str:
    code, said = _imported(files, log, form)
    assert code == 2, f"{what}: {code}"
    assert said.count("\n") == 1, said
    return said.strip().removeprefix("apo-bench: ")


def _imported(files: Files, log: str = "log.csv", form: str = "csv") -> tuple[int, str]:
    """Exit code, and what went to stderr."""
    for name, text in (("log.csv", files.log()), ("camera.toml", files.camera), ("objects.toml", files.objects)):
        Path(name).write_text(text, encoding="utf-8")
    named = ["--camera", "camera.toml", "--objects", "objects.toml", "--scenario", SCENARIO, "--out", "seen.json"]
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as said:
        code = main(["recording", "import", log, "--format", form, *named])
    return code, said.getvalue()
