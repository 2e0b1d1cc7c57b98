"""Worker processes: correctors that die, hang or raise cost one trial each, whoever else is at work."""

from __future__ import annotations

import json
import multiprocessing
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import imageio.v3 as imageio
import pytest

from apo_bench import InputError, SweepSettings, TrialSettings, load_scenario, run_sweep
from apo_bench.cli.app import main
from apo_bench.records import USUAL_LIMITS, Limits
from apo_bench.records.run.replay_command import replay_command
from apo_bench.records.run.run_file import limits_of, read_run
from apo_bench.report.report import report
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.sweeps.grid import load_all, units
from apo_bench.sweeps.local import pool
from apo_bench.sweeps.local.pool import FALSE_STARTS, run_locally
from apo_bench.sweeps.work.environment_lock import EnvironmentLock, Stopped, Unit, listening, versions
from apo_bench.sweeps.work.worker import Worker
from apo_bench.trial.fingerprint import content_hash
from apo_bench.trial.outcome_columns import lost, misbehaved
from tests import pages

CODE = """
import ctypes, os, shutil, subprocess, sys, time

def dies_of_b(seen):
    if "B" in seen.assembly.solids:
        os._exit(3)
    raise KeyError("many")

def hangs(seen):
    subprocess.run(["sleep", "86399"])

def raises(seen):
    raise ZeroDivisionError(object())

def halves(seen):
    raise ValueError("half a letter: \\ud800")

def forks(seen):
    os.fork()
    raise ValueError("twice")

def ends(seen):
    os._exit(0)

def removes(seen):
    shutil.rmtree("run")
    raise ValueError("gone")

def nonsense(seen):
    return "goals"

def interrupts(seen):
    raise KeyboardInterrupt

def talks(seen):
    print("from Python")
    print("from behind", file=sys.__stdout__)
    os.write(1, b"from below")
    ctypes.CDLL(None).printf(b"from C")
    return seen.goals

def slow(seen):
    time.sleep(0.2)
    raise ValueError("slow")
"""
FOLDERS = pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks for processes in /proc")


@pytest.fixture(scope="module", autouse=True)
def module(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    folder = tmp_path_factory.mktemp("module")
    (folder / "unruly.py").write_text(CODE)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        yield


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "unruly.py").write_text(CODE)
    monkeypatch.chdir(tmp_path)


def grid(*methods: str, scenarios: tuple[str, ...] = ("block_on_block",), **more: Any) -> SweepSettings:
    """Trials that end before the arm moves, but for its own."""
    return SweepSettings(scenarios, (1.0,), (0.0,), tuple(f"unruly:{m}" for m in methods), **{"trials": 1} | more)


def endings(rows: list[dict[str, Any]]) -> dict[tuple[str, str], tuple[str, str]]:
    return {
        (row["scenario"], row["method"].removeprefix("unruly:")): (row["failure_stage"], row["failure_code"])
        for row in rows
    }


MANY = grid(
    *("raises", "dies_of_b", "nonsense", "halves", "forks", "interrupts"),
    scenarios=("block_on_block", "stick_in_tower"),
)


class Ended(NamedTuple):
    """A sweep of `MANY`."""

    rows: list[dict[str, Any]]
    said: str
    """What stood on standard error, of all processes."""


@pytest.fixture(scope="module")
def one(tmp_path_factory: pytest.TempPathFactory) -> Ended:
    """With one worker process."""
    folder = tmp_path_factory.mktemp("one")
    before = os.dup(2)
    try:
        with (folder / "said").open("w") as file, redirect_stderr(file):
            os.dup2(file.fileno(), 2)
            rows = run_sweep(MANY, folder / "run", workers=1)
    finally:
        os.dup2(before, 2)
        os.close(before)
    return Ended(rows, (folder / "said").read_text())


def test_what_a_corrector_says_can_be_written_as_text(one: Ended) -> None:
    said = [row["sentence"] for row in one.rows if row["method"] == "unruly:halves"]
    assert len(said) == 2
    for sentence in said:
        assert "half a letter" in sentence
        sentence.encode()


def test_a_corrector_that_forks_has_one_row(one: Ended) -> None:
    rows = [row for row in one.rows if row["method"] in ("unruly:forks", "unruly:raises")]
    assert sorted((row["scenario"], row["method"]) for row in rows) == [
        (scenario, f"unruly:{method}") for scenario in MANY.scenarios for method in ("forks", "raises")
    ]
    assert {row["failure_code"] for row in rows} == {"raised"}


def test_a_corrector_that_ends_its_process_costs_its_own_trials_alone(one: Ended, tmp_path: Path) -> None:
    two = run_sweep(MANY, tmp_path / "two", workers=2)
    assert endings(one.rows) == {
        **{
            (scenario, method): ("correct", "raised")
            for scenario in MANY.scenarios
            for method in ("raises", "nonsense", "halves", "forks", "interrupts")
        },
        ("stick_in_tower", "dies_of_b"): ("correct", "raised"),
        ("block_on_block", "dies_of_b"): ("worker", "worker_died"),
    }
    assert len(one.rows) == 2 * 6
    assert all(row["success"] is False for row in one.rows)
    assert sorted(map(json.dumps, one.rows)) == sorted(map(json.dumps, two))
    timing = [json.loads(text) for text in (tmp_path / "two" / "timing.jsonl").read_text().splitlines()]
    assert len(timing) == len(two)
    assert {t["worker"] for t in timing} == {0, 1}


def test_an_interrupt_of_the_correctors_own_is_an_error_that_it_raised(one: Ended) -> None:
    found = endings(one.rows)
    assert found["block_on_block", "interrupts"] == found["block_on_block", "raises"] == ("correct", "raised")
    assert "Traceback" not in one.said


def test_what_ends_before_anyone_looks_is_late_all_the_same(tmp_path: Path) -> None:
    """The clock is looked at every half second."""
    rows = run_sweep(grid("slow"), tmp_path / "late", workers=1, limit_s=0.05)
    assert {(row["failure_stage"], row["failure_code"]) for row in rows} == {("worker", "time_limit")}
    for row in rows:
        spec = TrialSettings("block_on_block", careless=0.0, method="unruly:slow", seed=row["seed"])
        same = {name: row[name] for name in ("spec_hash", "clearance_mm")}
        assert row == {**lost(spec, "", "time_limit"), **same}


TALKS = ["replay", "block_on_block", "--careless", "0", "--method", "unruly:talks", "--json"]


def replayed(row: dict[str, Any], capsys: pytest.CaptureFixture[str], limits: Limits = USUAL_LIMITS) -> dict[str, Any]:
    """The row that the command of a row prints."""
    assert main([*shlex.split(replay_command(row, None, limits))[1:], "--json"]) == 0
    return dict(json.loads(capsys.readouterr().out))


def test_a_replay_of_a_trial_that_went_wrong_is_the_same_row(one: Ended, capsys: pytest.CaptureFixture[str]) -> None:
    methods = [f"unruly:{m}" for m in ("raises", "nonsense", "dies_of_b")]
    rows = [row for row in one.rows if row["method"] in methods and row["scenario"] == "block_on_block"]
    assert len(rows) == 3
    assert {row["failure_code"] for row in rows} == {"raised", "worker_died"}
    for row in rows:
        assert ("--trial-limit 600" in replay_command(row)) is (row["failure_stage"] == "worker")
        assert replayed(row, capsys) == json.loads(json.dumps(row))


@pytest.mark.parametrize(("workers", "limits"), [(1, Limits(50.0, 0.5)), (None, Limits(None, 0.5))])
def test_what_the_limit_of_the_corrector_ended_is_the_same_row_again(
    workers: int | None, limits: Limits, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (row,) = run_sweep(grid("hangs"), tmp_path / "run", workers=workers, limit_s=50.0, corrector_limit_s=0.5)
    assert (row["failure_code"], row["sentence"]) == ("time_limit", "the corrector took longer than its limit")
    assert limits_of(read_run(tmp_path / "run")) == limits
    assert replayed(row, capsys, limits) == json.loads(json.dumps(row))
    kept = pages.trials(report(tmp_path / "run").page)["words"]["command"]
    said = ["--corrector-limit 0.5" in kept[0], "--trial-limit 50 " in f"{kept[0]} ", len(kept)]
    assert said == [True, workers == 1, 1]


def test_a_replay_has_no_limit_below_zero(capsys: pytest.CaptureFixture[str]) -> None:
    """That one has a limit of its own, see the next test."""
    assert main(["replay", "block_on_block", "--method", "unruly:hangs", "--trial-limit", "-1"]) == 2
    assert "a limit of -1 s per trial was given" in capsys.readouterr().err


def test_films_and_observations_work_with_limits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    film = tmp_path / "film.gif"
    seen = tmp_path / "seen.json"
    trial = ["replay", "block_on_block", "--careless", "0", "--fidelity", "contact", "--method", "none"]
    written = ["--video", str(film), "--save-observation", str(seen)]
    assert main([*trial, *written, "--level", "0.1", "--trial-limit", "500", "--json"]) == 0
    row = json.loads(capsys.readouterr().out)
    assert (row["method"], row["failure_stage"] in (None, "judge")) == ("none", True)
    assert film.read_bytes()[:3] == b"GIF"
    assert len(imageio.imread(film, index=None)) > 10
    film.unlink()
    measured = ["replay", "block_on_block", "--fidelity", "contact", "--observation", str(seen), "--json"]
    assert main([*measured, "--method", "none"]) == 0
    here = json.loads(capsys.readouterr().out)
    assert main([*measured, "--method", "none", "--trial-limit", "500"]) == 0
    assert json.loads(capsys.readouterr().out) == here
    assert main([*measured, "--method", "unruly:hangs", "--trial-limit", "0.5"]) == 0
    late = json.loads(capsys.readouterr().out)
    assert (late["failure_code"], late["noise"], late["level"]) == ("time_limit", "measured", None)
    assert list(late) == list(here)
    assert main([*trial[:-1], "unruly:ends", *written]) == 0
    assert "nothing was replayed, so" in capsys.readouterr().err
    assert not film.exists()


@pytest.mark.skipif(sys.platform == "win32", reason="the C library has no name there")
@pytest.mark.parametrize("more", [[], ["--trial-limit", "100"]])
def test_a_row_on_standard_output_stands_there_alone(
    more: list[str], capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also what is held back until the end of the corrector's process, where the output is no terminal."""
    monkeypatch.delenv("PYTHONUNBUFFERED", raising=False)
    assert main([*TALKS, *more]) == 0
    out, err = capfd.readouterr()
    assert json.loads(out)["method"] == "unruly:talks"
    for words in ("from Python", "from behind", "from below", "from C"):
        assert words in err


@pytest.mark.skipif(sys.platform == "win32", reason="the C library has no name there")
@pytest.mark.parametrize("closed", [False, True])
def test_the_program_has_a_row_alone_on_its_output_or_none_where_that_is_closed(closed: bool) -> None:
    command = shlex.join([sys.executable, "-m", "apo_bench.cli.app", *TALKS]) + " >&-" * closed
    held_back = {k: v for k, v in os.environ.items() if k != "PYTHONUNBUFFERED"}
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False, timeout=120, env=held_back)
    assert "Traceback" not in done.stderr
    if not closed:
        assert done.returncode == 0
        assert json.loads(done.stdout)["method"] == "unruly:talks"
        assert "from C" in done.stderr


@FOLDERS
def test_a_corrector_that_hangs_is_ended_with_what_it_started(tmp_path: Path) -> None:
    began = time.monotonic()
    rows = run_sweep(grid("hangs", "raises"), tmp_path / "run", workers=1, limit_s=8.0)
    assert endings(rows) == {
        ("block_on_block", "hangs"): ("worker", "time_limit"),
        ("block_on_block", "raises"): ("correct", "raised"),
    }
    assert 8.0 < time.monotonic() - began < 300.0
    assert not asleep()
    assert "8" not in rows[0]["sentence"]


def test_rows_of_lost_trials_have_every_column_and_no_clock() -> None:
    spec = TrialSettings("block_on_block", method="paper", seed=4)
    died = lost(spec, "abc", "worker_died")
    late = lost(spec, "abc", "time_limit")
    raised = misbehaved(spec, "abc", "ok", "it raised <thing at 0x7f3c12ab>; " + "x" * 5000)
    assert list(died) == list(late) == list(raised)
    assert died["spec_hash"] == raised["spec_hash"]
    assert (died["success"], died["demonstration"], died["failure_stage"]) == (False, None, "worker")
    assert died["sentence"] == "the process that ran the trial died"
    assert (late["failure_code"], raised["demonstration"]) == ("time_limit", "ok")
    assert raised["sentence"].startswith("it raised <thing at 0x...>; xxx")
    assert len(raised["sentence"]) == 1000


def test_a_worker_with_other_code_or_packages_refuses() -> None:
    unit = Unit((TrialSettings("block_on_block", method="none"),))
    with pytest.raises(InputError, match="has other code or other files for 'block_on_block'"):
        list(Worker(0, EnvironmentLock({"block_on_block": "0123456789abcdef"}, versions())).run(unit))
    with pytest.raises(
        InputError, match=r"has mujoco .*, the process that started the sweep 1\.2\.3; install the same"
    ):
        Worker(0, EnvironmentLock({}, versions() | {"mujoco": "1.2.3"}))


def test_what_a_worker_refuses_ends_the_sweep() -> None:
    asked = grid("raises")
    lock = EnvironmentLock({"block_on_block": "0123456789abcdef"}, versions())
    with pytest.raises(InputError, match="has other code or other files"):
        run_locally(
            tuple(units([asked], load_all([asked]))), lock, workers=1, limit_s=60.0, emit=lambda row, timing: None
        )


@dataclass(frozen=True)
class Deadly:
    """Ends the process that unpacks it."""

    content: str = ""

    def __reduce__(self) -> Any:
        return os._exit, (5,)


def test_processes_that_cannot_begin_are_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = grid("raises")
    lock = EnvironmentLock({}, versions())
    real = pool.Process
    monkeypatch.setattr(pool, "Process", lambda *given: real(Deadly()))  # type: ignore[arg-type]
    with pytest.raises(RuntimeError, match="worker processes end with exit code 5 before they have begun a trial"):
        run_locally(
            tuple(units([asked], load_all([asked]))), lock, workers=1, limit_s=60.0, emit=lambda row, timing: None
        )
    assert FALSE_STARTS == 3


def test_a_corrector_that_removes_the_folder_of_the_rows(tmp_path: Path) -> None:
    rows = run_sweep(grid("removes", "raises", trials=2), "run")
    assert len(rows) == 4
    assert {row["failure_code"] for row in rows} == {"raised"}
    assert count(tmp_path / "run") == 4


@pytest.mark.parametrize("methods", [("raises",), ("raises", "none")])
def test_processes_that_cannot_begin_any_more_cost_the_trials_of_own_correctors(
    methods: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first process is killed after its first row, and those after it before they begin."""
    asked = replace(grid("raises", trials=2), methods=tuple(m if m == "none" else f"unruly:{m}" for m in methods))
    content = content_hash(load_scenario("block_on_block"), "block_on_block", find_arm("six_axis").files)
    lock = EnvironmentLock({"block_on_block": content}, versions())
    asked_for: list[Any] = []

    def start(work: Any, *given: Any) -> Any:
        asked_for.append(work)
        return real(work, *given) if len(asked_for) == 1 else real(Deadly())

    real = pool.Process
    monkeypatch.setattr(pool, "Process", start)
    rows: list[dict[str, Any]] = []

    def emit(row: Any, timing: Any) -> None:
        rows.append(dict(row))
        if len(rows) == 1:
            for process in multiprocessing.active_children():
                process.kill()
                process.join()

    work = tuple(units([asked], load_all([asked])))
    if "none" in methods:
        with pytest.raises(RuntimeError, match="before they have begun a trial"):
            run_locally(work, lock, workers=1, limit_s=60.0, emit=emit)
    else:
        run_locally(work, lock, workers=1, limit_s=60.0, emit=emit)
        assert [row["failure_code"] for row in rows] == ["raised", "worker_died"]


PATIENT = """
import sys
from apo_bench.sweeps.local import pool
from apo_bench.cli.app import main
pool.GRACE_S = float(sys.argv[1])
sys.exit(main(sys.argv[2:]))
"""


def started(out: Path, *more: str, grace_s: float = 5.0) -> subprocess.Popen[str]:
    asked = ["sweep", "block_on_block", "--careless", "0", "--out", str(out), "--workers", "1", *more]
    return subprocess.Popen(
        [sys.executable, "-c", PATIENT, str(grace_s), *asked],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell may have it ignored
    )


def count(out: Path) -> int:
    path = out / "trials.jsonl"
    return path.read_bytes().count(b"\n") if path.exists() else 0


def wait_for(true: Callable[[], bool], process: subprocess.Popen[str], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.05)


def asleep() -> list[str]:
    """Processes that `hangs` has started and that are still there."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            found += [path.parent.name] if b"sleep\x0086399" in path.read_bytes() else []
        except OSError:
            continue
    return found


@FOLDERS
def test_a_signal_ends_a_sweep_cleanly(tmp_path: Path) -> None:
    out = tmp_path / "run"
    levels = ",".join(str(0.5 * k) for k in range(100))
    process = started(out, "--methods", "unruly:slow", "--trials", "1", "--levels", levels)
    wait_for(lambda: count(out) >= 2, process)
    began = time.monotonic()
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 143
    assert said == "apo-bench: ended by SIGTERM; what had ended is kept, and the same command continues.\n"
    assert time.monotonic() - began < 60.0
    assert 2 <= count(out) < 100
    assert (out / "trials.jsonl").read_bytes().endswith(b"\n")


@FOLDERS
def test_a_second_interrupt_ends_at_once(tmp_path: Path) -> None:
    out = tmp_path / "run"
    process = started(out, "--methods", "unruly:raises,unruly:hangs", "--trials", "1", "--levels", "1", grace_s=600.0)
    wait_for(lambda: count(out) == 1 and bool(asleep()), process)
    process.send_signal(signal.SIGINT)
    time.sleep(1.0)
    assert process.poll() is None
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert said == "apo-bench: interrupted; what had ended is kept, and the same command continues.\n"
    assert not asleep()


def test_the_first_signal_asks_and_the_second_raises() -> None:
    handler = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with listening() as check:
            check()
            os.kill(os.getpid(), signal.SIGINT)
            with pytest.raises(Stopped) as first:
                check()
            assert first.value.number == signal.SIGINT
            with pytest.raises(Stopped):
                os.kill(os.getpid(), signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, handler)


def test_handlers_of_the_callers_own_stay() -> None:
    def mine(number, frame): ...

    before = signal.getsignal(signal.SIGTERM)
    signal.signal(signal.SIGTERM, mine)
    try:
        with listening() as check:
            assert signal.getsignal(signal.SIGTERM) is mine
            check()
    finally:
        signal.signal(signal.SIGTERM, before)
