"""Recordings of simulated demonstrations, in every format, and what their corrected plans are worth.

    python -m benchmarks.recordings                         # 100 recordings and every wrong log (twenty minutes)
    python -m benchmarks.recordings --write DIR             # one log in each format, with its camera and objects files
    python -m benchmarks.recordings --example FILE.csv      # the log of the guide

A stationary camera at an unknown pose sees every part. The plan is carried out with the parts where they truly stand,
and judged with the true goals. Writes `results/recordings.csv` and `docs/results/recordings.md`.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from apo_bench.geometry import pose
from apo_bench.importers.recording.camera_file import read_camera
from apo_bench.importers.recording.formats import read_log
from apo_bench.importers.recording.importing import ImportedRecording, import_recording
from apo_bench.importers.recording.objects_file import name_tracks, read_objects
from apo_bench.importers.recording.ordering import Stated
from apo_bench.judging.verdict import judge
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.simulation.execution.controller import replay
from apo_bench.trial.planning import apply_method
from benchmarks.made_with import said_by, with_mujoco
from benchmarks.recording_demos import Errors, Truth, first_places, tracked, watched
from benchmarks.recording_faults import refusals
from benchmarks.recording_forms import FORMS, SAID, Form, write_recording

ROOT = Path(__file__).parents[1]
RESULT = ROOT / "benchmarks" / "results" / "recordings.csv"
PAGE = ROOT / "docs" / "results" / "recordings.md"
TASKS = ("stick_in_tower", "stick_on_castles", "pocket_table", "carried_bridge")
ERRORS = {"frames": Errors(frame=1.0), "stays": Errors(frame=0.3, stays=1.0)}
METHODS = ("uncorrected", "contact-robust")
HEAD = ("errors", "scenario", "seed", "form", "method", "success", "ended")
INTRO = """\
# Recordings

Written by `python -m benchmarks.recordings`; every recording is a row of `benchmarks/results/recordings.csv`. Each is a
[log](../guide/recording.md) of a simulated demonstration: the careless human of each task, 30 frames a second, a
camera at an unknown pose that is solved from the parts on their first places, 2 ms of jitter, 10 % of the frames and
one stretch of four missing, 1 % of the frames wrong by tens of mm and degrees. The frames of the tracker's models lie
anywhere in the parts. The plan is carried out with the parts where they truly stand, and judged with the true goals.

Noise of 1 mm and 1 degree per axis in each frame, formats in turn; "without correction" carries the averaged poses out.
"""
STAYS = """
Errors that stay of 1 mm and 1 degree, and of frames of 0.3; they change only while the part moves, so that no average
takes them out, and their size is stated in the camera file:
"""
WRONG = """
## What is wrong with a log

Every row changes one thing about a log of `stick_in_tower` that fits, and shows what `recording import` says. In all of
them the exit code is 2, nothing is written, and `--picture` draws the log as it was read where it could be read.

"""


class Result(NamedTuple):
    """One recording, corrected by one method."""

    errors: str
    scenario: str
    seed: int
    form: str
    method: str
    success: bool
    ended: str


def imported(truth: Truth, form: Form, errors: Errors, seed: int) -> ImportedRecording:
    """What `recording import` makes of the files of one recording."""
    _, found = tracked(truth, errors, np.random.default_rng([seed, 9]))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = write_recording(form, found, first_places(truth, found), folder, errors.stays or None)
        camera = read_camera(folder / "camera.toml")
        objects = read_objects(folder / "objects.toml")
        tracks = name_tracks(read_log(path, form.format, camera.conventions), objects)
    return import_recording(tracks, camera, truth.scene.scenario, Stated(), "log", objects.models)


def carried_out(truth: Truth, found: ImportedRecording, method: str) -> tuple[bool, str]:
    """Whether the corrected plan of one recording succeeds, and what ended it."""
    made = apply_method(method, found.observation, None, where=truth.scene)
    if made.plan is None:
        return False, made.failure.code if made.failure else "no plan"
    done = replay(made.plan, truth.scene, config=ExecutionConfig("near-contact"), parts_at=truth.layout.start)
    verdict = judge(truth.scene.scenario.assembly, done.reached, truth.layout.poses, truth.scene.criteria)
    return verdict.success, done.outcome.code if done.outcome.failed else verdict.rests_on.code


def measured(errors: str, tasks: Sequence[str], trials: int, methods: Sequence[str]) -> Iterator[Result]:
    """Recordings of demonstrations that succeeded, in the formats in turn."""
    names = list(FORMS)
    for i, task in enumerate(tasks):
        for seed in range(trials):
            truth = watched(task, seed)
            if truth is None:
                print(f"{task}, seed {seed}: the demonstration itself failed", flush=True)
                continue
            form = names[(seed + 4 * i) % len(names)]
            try:
                found = imported(truth, FORMS[form], ERRORS[errors], seed)
            except ValueError as error:
                print(f"{task}, seed {seed}, {form}: {error}", flush=True)
                yield from (Result(errors, task, seed, form, method, False, "import") for method in methods)
                continue
            for method in methods:
                one = Result(errors, task, seed, form, method, *carried_out(truth, found, method))
                if not one.success:
                    print(", ".join(map(str, one)), flush=True)
                yield one


def page(results: Sequence[Result], wrong: Sequence[tuple[str, str]]) -> str:
    """The page of the documentation."""
    lines = [INTRO, "| scenario | without correction | `contact-robust` |", "|---|---|---|"]
    frames = [one for one in results if one.errors == "frames"]
    lines += [
        f"| `{task}` | {_of(frames, 'uncorrected', task)} | {_of(frames, 'contact-robust', task)} |" for task in TASKS
    ]
    lines += [f"| all | {_of(frames, 'uncorrected')} | {_of(frames, 'contact-robust')} |", ""]
    lines += ["| `--format` | what stands in it | `contact-robust` |", "|---|---|---|"]
    for name, form in FORMS.items():
        of = [one for one in frames if one.form == name]
        lines.append(f"| `{form.format}` | {SAID[name]} | {_of(of, 'contact-robust')} |")
    stays = [one for one in results if one.errors == "stays"]
    lines += [STAYS, "| scenario | `contact-robust` |", "|---|---|"]
    lines += [f"| `{task}` | {_of(stays, 'contact-robust', task)} |" for task in TASKS]
    lines += [WRONG + "| what was changed | the sentence |", "|---|---|"]
    lines += [f"| {what} | {sentence.replace('|', chr(92) + '|')} |" for what, sentence in wrong]
    return "\n".join(lines) + "\n"


def _of(results: Sequence[Result], method: str, task: str | None = None) -> str:
    good = [one.success for one in results if one.method == method and task in (None, one.scenario)]
    return f"{sum(good)} of {len(good)}"


def write_example(path: Path) -> None:
    """The log of the guide: 15 frames a second, ids 11 to 13, and a stick whose model lies otherwise than the part."""
    truth = watched("stick_in_tower", 3)
    assert truth is not None
    thin = truth._replace(t=truth.t[::2], T={part: T[::2] for part, T in truth.T.items()})
    X, found = tracked(thin, Errors(frame=0.5), np.random.default_rng(19))
    models = dict.fromkeys(found, np.eye(4)) | {"stick": pose.at((0.0, 0.0, -0.01), (0.0, 0.0, 90.0))}
    for part, one in found.items():
        T = one.T @ one.T_model_part @ pose.inverse(models[part])
        found[part] = one._replace(T_model_part=models[part], T=T)
    FORMS["csv-wxyz"].write(found, path)
    print(f"Wrote {path}; the camera stood at {np.round(1e3 * X[:3, 3], 1).tolist()} mm")


def write_logs(folder: Path) -> None:
    """One log in each format, in folders of their own."""
    truth = watched(TASKS[0], 0)
    assert truth is not None
    _, found = tracked(truth, Errors(), np.random.default_rng([0, 9]))
    for name, form in FORMS.items():
        (folder / name).mkdir(parents=True)
        print(f"Wrote {write_recording(form, found, first_places(truth, found), folder / name, None)}")


def main() -> None:
    """Write logs, or measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", type=Path, help="write one log in each format into this folder")
    parser.add_argument("--example", type=Path, help="write the log of the guide into this file")
    parser.add_argument("--trials", type=int, default=25, help="of each task; 2 in 5 of them with errors that stay")
    parser.add_argument("--page", action="store_true", help="write the page again from the results that are there")
    given = parser.parse_args()
    if given.example:
        return write_example(given.example)
    if given.write:
        return write_logs(given.write)
    if given.page:
        with RESULT.open(encoding="utf-8", newline="") as stream:
            results = [
                Result(one["errors"], one["scenario"], int(one["seed"]), one["form"], one["method"],
                       one["success"] == "True", one["ended"])
                for one in csv.DictReader(stream)
            ]  # fmt: skip
    else:
        results = [*measured("frames", TASKS, given.trials, METHODS)]
        results += measured("stays", TASKS, given.trials * 2 // 5, METHODS[1:])
        with RESULT.open("w", encoding="utf-8", newline="") as stream:
            csv.writer(stream, lineterminator="\n").writerows([HEAD, *results])
    versions = said_by(PAGE.read_text(encoding="utf-8")) if given.page else [mujoco.__version__]
    PAGE.write_text(with_mujoco(page(results, list(refusals())), versions), encoding="utf-8")
    print(f"Wrote {PAGE.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
