"""Correctors of one's own in their process: what they are given, what they cannot reach, and how they may end."""

from __future__ import annotations

import gc
import json
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from apo_bench import (
    Correction,
    InputError,
    Layout,
    Observation,
    TrialSettings,
    build_scene,
    correct,
    load_scenario,
    run_trial,
)
from apo_bench.correction.correctors import CorrectorMisbehaved
from apo_bench.correction.own_code import own
from apo_bench.correction.own_code import process as own_process
from apo_bench.correction.own_code.forms import (
    FRAME_HEADER,
    GarbledMessage,
    correction_message,
    observation_message,
    parse_correction,
    parse_observation,
    receive,
    send,
)
from apo_bench.correction.own_code.own import CorrectorLost, OwnCorrectors
from apo_bench.geometry import pose
from apo_bench.io.processes import descendants
from apo_bench.sweeps.work.environment_lock import EnvironmentLock
from apo_bench.sweeps.work.worker import Worker
from tests import scenes

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="what a process leaves behind is found in /proc")
TOWER = scenes.stick_in_tower()
SEEN = scenes.seen(TOWER, TOWER.goals @ pose.exp(np.full(6, 1e-3)))
HOSTILE = """
import gc, json, os, signal, subprocess, sys, tempfile, time
import numpy as np
from apo_bench.judging import verdict as judge
from apo_bench.correction.contact.contact import contact, contact_drop
from apo_bench.correction.baselines.track import paper_track
from apo_bench.assembly.correction_record import Correction
from apo_bench.assembly.goals import Layout

kept = []

def remembers(seen):
    kept.append(seen)
    raise ValueError(f"kept {len(kept)}")

def layouts(seen):
    found = sum(isinstance(one, Layout) for one in gc.get_objects())
    frame, names = sys._getframe(), set()
    while frame is not None:
        found += sum(isinstance(value, Layout) for value in frame.f_locals.values())
        names |= {name for name in frame.f_locals if name in ("truth", "spec", "shown", "layout", "seed")}
        frame = frame.f_back
    raise ValueError(f"found {found} layouts and {sorted(names)}")

def knows(seen):
    words = [*sys.argv, *os.environ.values(), *os.environ]
    raise ValueError(f"found {sum('424243' in word for word in words)} seeds")

def leaves(seen):
    raise SystemExit(0)

def interrupts(seen):
    raise KeyboardInterrupt

def ends(seen):
    os._exit(0)

def ends_three(seen):
    os._exit(3)

def kills(seen):
    os.kill(os.getpid(), signal.SIGKILL)

def crashes(seen):
    import ctypes
    ctypes.string_at(0)

def hangs(seen):
    while True:
        pass

def closes(seen):
    os.closerange(3, 64)
    time.sleep(600)

def _write(bytes):
    for descriptor in range(3, 64):
        try:
            os.write(descriptor, bytes)
        except OSError:
            pass

def garbage(seen):
    _write(b"\\x00\\x00\\x00\\x10\\x00\\x00\\x00\\x00" + b"nonsense" * 8)
    os._exit(0)

def endless(seen):
    while True:
        _write(b"\\xff" * 4096)

def half(seen):
    _write(b"\\x00\\x00\\x00\\x10\\x00\\x00\\x00\\x00{")
    os._exit(0)

def forged(seen):
    text = json.dumps({"arrays": {}, "status": "converged", "sentence": "all is well"}).encode()
    _write(len(text).to_bytes(4, "big") + bytes(4) + text)
    os._exit(0)

def clears(seen):
    for module in list(sys.modules.values()):
        vars(module).clear()
    return seen.goals

def reseeds(seen):
    np.random.default_rng = lambda *_: None
    return seen.goals

def judges(seen):
    judge.judge = lambda *_: None
    return seen.goals

def forks(seen):
    os.fork()
    return seen.goals

def exhausts(seen):
    return np.ones((1 << 45,))

def helpers(seen):
    subprocess.Popen(["sleep", "86397"], start_new_session=True)
    subprocess.Popen(["sleep", "86397"])
    if os.fork() == 0:
        time.sleep(600)
    return seen.goals

def fills(seen):
    with tempfile.TemporaryFile() as file:
        file.truncate(1 << 31)

def nonsense(seen):
    return "goals"

def wide(seen):
    goals = np.array(seen.goals)
    goals[:, 0, 3] = 1e9
    return Correction(goals, "converged", "far", (), 0.0, 0.0, 0)

def odd(seen):
    return Correction(seen.goals, "converged", "odd", (), 0.0, 0.0, "rank")

def imaginary(seen):
    return seen.goals * (1 + 0j)

def imaginary_inside(seen):
    return Correction(seen.goals * (1 + 0j), "converged", "complex", (), 0.0, 0.0, 0)

def red(seen):
    return Correction(seen.goals, "converged", "\x1b[31m red", (), 0.0, 0.0, 0)

def half_a_letter(seen):
    return Correction(seen.goals, "converged", "half \\ud800", (), 0.0, 0.0, 0)

def halves(seen):
    raise ValueError("half a letter: \\ud800 and \\x1b[31m red")

def unspeakable(seen):
    class Mute(BaseException):
        def __str__(self):
            raise RuntimeError
    raise Mute

number = 3
"""


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    made = tmp_path_factory.mktemp("own")
    (made / "hostile.py").write_text(HOSTILE)
    (made / "leaving.py").write_text("raise SystemExit(0)")
    (made / "ending.py").write_text("import os; os._exit(0)")
    (made / "broken.py").write_text("def")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(made))
        yield made


@pytest.fixture(scope="module")
def found(folder: Path) -> Iterator[OwnCorrectors]:
    with OwnCorrectors(limit_s=20.0) as correctors:
        yield correctors


@pytest.mark.parametrize("name", ["contact", "contact_drop", "paper_track"])
def test_a_process_of_its_own_gives_the_bits_of_this_one(name: str, found: OwnCorrectors) -> None:
    """Between two processes on one machine."""
    here = correct(SEEN, name.replace("_", "-"))
    there = correct(SEEN, found.find(f"hostile:{name}"))
    (one, numbers), (other, others) = map(correction_message, (here, there))
    measured_anew = {"gap_before_m": None, "gap_after_m": None}
    assert {**one, **measured_anew} == {**other, **measured_anew}
    assert there.gap_after_m == pytest.approx(here.gap_after_m, abs=1e-9)  # measured again, by other sums
    assert {name: array.tobytes() for name, array in numbers.items()} == {
        name: array.tobytes() for name, array in others.items()
    }


ENDS = {
    "ends": ("worker_died", "ended its process with exit code 0"),
    "ends_three": ("worker_died", "ended its process with exit code 3"),
    "interrupts": (None, r"raised KeyboardInterrupt\(\)"),
    "kills": ("worker_died", "ended its process by signal 9"),
    "crashes": ("worker_died", "ended its process by signal"),
    "closes": ("worker_died", "ended its process"),
    "half": ("worker_died", "ended its process"),
    "clears": ("worker_died", "ended its process"),
    "garbage": (None, "sent back what cannot be read"),
    "endless": (None, "sent back what cannot be read"),
    "forged": (None, "sent back what is no correction"),
    "leaves": (None, r"raised SystemExit\(0\)"),
    "unspeakable": (None, r"raised Mute\(\)"),
    "exhausts": (None, "MemoryError"),
    "fills": (None, "File too large"),
    "nonsense": (None, "returned a str"),
    "wide": (None, "a position of 1e\\+09 m"),
    "odd": (None, "rank of Correction must be a whole number, got 'rank'"),
    "imaginary": (None, "returned complex numbers as goals; return real ones"),
    "imaginary_inside": (None, "goals of Correction must be an array of real numbers, got an array"),
    "red": (None, r"returned '\\x1b\[31m red' as its sentence"),
    "half_a_letter": (None, r"returned 'half \\ud800' as its sentence"),
    "halves": (None, r"half a letter:   and  \[31m red"),
}


@pytest.mark.parametrize("name", ENDS)
def test_whatever_it_does_is_one_sentence(name: str, found: OwnCorrectors) -> None:
    code, words = ENDS[name]
    with pytest.raises(CorrectorMisbehaved, match=words) as raised:
        correct(SEEN, found.find(f"hostile:{name}"))
    assert getattr(raised.value, "code", None) == code
    assert str(raised.value).isprintable()
    assert f"'hostile:{name}'" in str(raised.value)


def test_an_endless_loop_ends_at_its_limit(folder: Path) -> None:
    began = time.monotonic()
    with (
        OwnCorrectors(limit_s=0.5) as correctors,
        pytest.raises(CorrectorLost, match=r"took longer than 0\.5 s") as raised,
    ):
        correct(SEEN, correctors.find("hostile:hangs"))
    assert raised.value.code == "time_limit"
    assert time.monotonic() - began > 0.5


def test_the_import_of_a_module_has_a_limit(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "sleeping.py").write_text("import time; time.sleep(600)")
    monkeypatch.setattr(own, "LEAST_STARTING_S", 1.5)
    with (
        OwnCorrectors(limit_s=0.5) as correctors,
        pytest.raises(InputError, match=r"took longer than 1\.5 s while it was"),
    ):
        correctors.find("sleeping:any")
    with OwnCorrectors(limit_s=2.0) as correctors, pytest.raises(InputError, match=r"took longer than 2 s while"):
        correctors.find("sleeping:any")


def test_nothing_is_remembered_from_one_correction_to_the_next(found: OwnCorrectors) -> None:
    for _ in range(3):
        with pytest.raises(CorrectorMisbehaved, match="kept 1;"):
            correct(SEEN, found.find("hostile:remembers"))


def test_what_it_changes_is_changed_for_itself_alone(found: OwnCorrectors) -> None:
    from apo_bench.judging import verdict as judge

    before = np.random.default_rng, judge.judge
    for name in ("reseeds", "judges", "forks"):
        made = correct(SEEN, found.find(f"hostile:{name}"))
        assert made.ok
        assert made.goals.tobytes() == SEEN.goals.tobytes()
    assert (np.random.default_rng, judge.judge) == before
    assert "hostile" not in sys.modules


@LINUX
def test_what_it_leaves_behind_is_ended(found: OwnCorrectors) -> None:
    assert correct(SEEN, found.find("hostile:helpers")).ok
    soon = time.monotonic() + 10.0
    while sleeping := [path for path in Path("/proc").glob("[0-9]*/cmdline") if "86397" in _text(path)]:
        assert time.monotonic() < soon, f"a process that was told to end takes longer than any needs: {sleeping}"
        time.sleep(0.02)
    found.close()
    assert not [pid for pid in descendants(os.getpid()) if "hostile" in _text(Path(f"/proc/{pid}/cmdline"))]


@LINUX
def test_a_fork_ends_with_the_process_of_its_module(folder: Path) -> None:
    """Whoever kills that one alone, as a cluster does with the children of its workers."""
    with OwnCorrectors(limit_s=60.0) as correctors:
        hanging = correctors.find("hostile:hangs")
        process = correctors._servers["hostile"]._process
        assert process is not None
        asking = threading.Thread(target=lambda: suppressed(correct, SEEN, hanging))
        asking.start()
        end = time.monotonic() + 60.0
        while not (forks := _alive(descendants(process.pid))) and time.monotonic() < end:
            time.sleep(0.01)
        os.kill(process.pid, signal.SIGKILL)
        asking.join(60.0)
        assert not asking.is_alive()
        while _alive(forks) and time.monotonic() < end:
            time.sleep(0.01)
        assert forks
        assert not _alive(forks)


def _alive(processes: list[int]) -> list[int]:
    """Those that have not ended: what only waits to be waited for has no command line any more."""
    return [pid for pid in processes if _text(Path(f"/proc/{pid}/cmdline"))]


def suppressed(function: Any, *given: Any) -> None:
    with suppress(CorrectorMisbehaved):
        function(*given)


def _text(path: Path) -> str:
    try:
        return path.read_bytes().decode(errors="replace")
    except OSError:
        return ""


def test_a_request_without_fork_has_a_process_of_its_own(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(own_process, "can_fork", lambda: False)
    with OwnCorrectors() as correctors:
        for _ in range(2):
            with pytest.raises(CorrectorMisbehaved, match="kept 1;"):
                correct(SEEN, correctors.find("hostile:remembers"))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("not_there:at_all", "cannot be imported"),
        ("hostile:hang", "did you mean 'hangs'"),
        ("hostile:number", "is an int; give a function"),
        ("hostile:", "is not of the form"),
        (":hangs", "is not of the form"),
        ("leaving:any", "SystemExit"),
        ("ending:any", "ended its process while it was imported"),
        ("broken:any", "SyntaxError"),
    ],
)
def test_what_cannot_be_had_is_refused(name: str, words: str, folder: Path) -> None:
    with OwnCorrectors() as correctors, pytest.raises(InputError, match=words) as raised:
        correctors.find(name)
    assert not isinstance(raised.value, CorrectorMisbehaved)


@pytest.mark.parametrize("limit", [0.0, -1.0, float("nan"), float("inf")])
def test_a_limit_is_a_number_above_zero(limit: float) -> None:
    with pytest.raises(InputError, match="per correction was given"):
        OwnCorrectors(limit)


@pytest.fixture(scope="module")
def worker(folder: Path) -> Iterator[Worker]:
    class Any_(dict[str, str]):
        def __getitem__(self, name: str) -> str:
            return ""

    lock = EnvironmentLock(Any_(), {})
    object.__setattr__(lock, "check_content", lambda given, found: None)
    made = Worker(0, lock)
    yield made
    made.close()


def rows(worker: Worker, *methods: str) -> dict[str, dict[str, Any]]:
    from apo_bench.sweeps.work.environment_lock import Unit

    asked = [TrialSettings("block_on_block", careless=0.0, method=method, seed=424243) for method in methods]
    made = [dict(said[0]) for kind, *said in worker.run(Unit(tuple(asked))) if kind == "row"]
    return {row["method"]: row for row in made}


def test_neither_truth_nor_seed_is_there(worker: Worker) -> None:
    found = rows(worker, "hostile:layouts", "hostile:knows")
    assert "found 0 layouts and []" in found["hostile:layouts"]["sentence"]
    assert "found 0 seeds" in found["hostile:knows"]["sentence"]
    scene = build_scene(load_scenario("block_on_block"))

    def layouts(seen: Observation) -> None:
        """In this process, where code is trusted, the same search finds it."""
        raise ValueError(f"found {any(isinstance(one, Layout) for one in gc.get_objects())}")

    with pytest.raises(CorrectorMisbehaved, match="found True"):
        run_trial(TrialSettings("block_on_block", careless=0.0, method="contact", seed=1), scene, method=layouts)


def test_a_corrector_that_patches_the_judge_changes_no_other_row(worker: Worker) -> None:
    before = rows(worker, "none")["none"]
    after = rows(worker, "hostile:judges", "hostile:reseeds", "hostile:leaves", "none")
    assert after["none"] == before
    assert after["hostile:judges"]["success"] == before["success"]
    kept = ("success", "failure_stage", "failure_code")
    assert [after["hostile:leaves"][key] for key in kept] == [False, "correct", "raised"]


def test_messages_come_back_as_they_were() -> None:
    form, arrays = observation_message(SEEN)
    again = parse_observation(json.loads(json.dumps(form)), arrays)
    assert observation_message(again)[0] == form
    assert [again.assembly.solids[part].faces.keys() for part in again.assembly.solids] == [
        solid.faces.keys() for solid in SEEN.assembly.solids.values()
    ]
    for part, solid in SEEN.assembly.solids.items():
        for name, face in solid.faces.items():
            assert again.assembly.solids[part].faces[name].plane.tobytes() == face.plane.tobytes()
    made = correct(scenes.seen(TOWER, TOWER.goals), "contact")
    there, here = socket.socketpair()
    with there, here:
        send(there, *correction_message(made))
        back = parse_correction(*receive(here))
    assert back.goals.tobytes() == made.goals.tobytes()
    assert replace(back, goals=made.goals).sentence == made.sentence


def _changes() -> Iterator[tuple[str, Any]]:
    yield from (("goals", value) for value in (None, np.zeros((2, 4)), np.full((6, 4, 4), np.nan)))
    yield from ((key, value) for key in ("status", "sentence", "rank", "freed") for value in (None, 0.5, [{}], True))
    yield from (("gap_after_m", value) for value in (None, "1", [{}], True))
    yield from (("schedule", value) for value in ([[1]], [["1", False]], [[1e400, True]], 3))
    yield from (("tried", value) for value in ([[0]], [[0, 1, 2]], [["", [], 0.0]]))
    yield from (
        ("test", value) for value in ([], [1, 2, 3, 4, 5], "x", [0.0, 1, 0.5, 0.1, [["R1", [["a"]], 0, 0, 0, 0]]])
    )
    yield ("targets", np.zeros((3, 4, 4)))
    yield ("covariance", np.zeros((1, 6, 6)))
    yield ("dropped", [1])


@pytest.mark.parametrize(("key", "value"), [*_changes()])
def test_what_is_no_correction_is_garbled(key: str, value: Any) -> None:
    form, arrays = correction_message(correct(SEEN, "contact"))
    changed = dict(arrays)
    if key in ("goals", "targets", "covariance"):
        changed[key] = value
        if value is None:
            del changed[key]
    else:
        form[key] = value
    with pytest.raises(GarbledMessage):
        parse_correction(form, changed)


@pytest.mark.parametrize(
    "raw",
    [
        b"",
        b"\x00",
        FRAME_HEADER.pack(1 << 31, 0),
        FRAME_HEADER.pack(2, 1 << 31),
        FRAME_HEADER.pack(2, 0) + b"[]",
        FRAME_HEADER.pack(2, 0) + b"{}",
        FRAME_HEADER.pack(4, 0) + b"\xff\xfe{}",
        FRAME_HEADER.pack(100_000, 0) + b"[" * 100_000,
        *(
            FRAME_HEADER.pack(len(text), 8) + text + bytes(8)
            for text in (
                b'{"arrays": {"x": ["object", [1]]}}',
                b'{"arrays": {"x": ["float64", [-1]]}}',
                b'{"arrays": {"x": ["float64", [2]]}}',
                b'{"arrays": {"x": ["float64", [1e400]]}}',
                b'{"arrays": {"x": ["float64", 5]}}',
                b'{"arrays": {"x": ["float64", [99999999, 99999999, 0]], "y": ["float64", [99999999999]]}}',
                b'{"arrays": {}}',
            )
        ),
    ],
)
def test_what_is_no_message_is_garbled(raw: bytes) -> None:
    there, here = socket.socketpair()
    with here:
        with there:
            there.sendall(raw)
        with pytest.raises((GarbledMessage, EOFError)):
            receive(here)


def test_a_correction_is_checked_when_it_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also one that never saw the check in its own process."""

    def moved(seen: Observation) -> Correction:
        return Correction(seen.goals * 2.0, "converged", "fine", (), 0.0, 0.0, 0)

    with pytest.raises(CorrectorMisbehaved, match="is not a rigid pose"):
        correct(SEEN, moved)
