"""Worker processes: correctors that die, hang or raise cost one trial each, whoever else is at work."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from apo_bench import InputError, SweepConfig, TrialConfig, run_sweep
from apo_bench.benchmark.sweeps import pool
from apo_bench.benchmark.sweeps.stop_signals import StoppedBySignal, stop_at_signals
from apo_bench.benchmark.sweeps.worker import SweepInputs, Worker
from apo_bench.cli.app import main
from apo_bench.records import USUAL_LIMITS, Limits
from apo_bench.records.run.replay_command import format_replay_command
from apo_bench.records.run.run_file import read_limits, read_run
from apo_bench.trial.fingerprint import list_versions

CODE = """
import ctypes, os, sys, time

def dies(seen):
    os._exit(3)

def hangs(seen):
    time.sleep(1000)

def raises(seen):
    raise ZeroDivisionError(object())

def nonsense(seen):
    return "goals"

def talks(seen):
    print("from Python")
    os.write(1, b"from below")
    ctypes.CDLL(None).printf(b"from C")
    return seen.poses

def slow(seen):
    time.sleep(0.2)
    raise ValueError("slow")
"""
PROCESSES = pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks for processes in /proc")


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


def grid(*methods: str, **more: Any) -> SweepConfig:
    named = tuple(method if method == "uncorrected" else f"unruly:{method}" for method in methods)
    return SweepConfig(("block_on_block",), (1.0,), (0.0,), named, **{"trials": 1, "fidelity": "near-contact"} | more)


MANY = grid("uncorrected", "raises", "dies", "nonsense")
ENDS = {
    "uncorrected": (None, None),
    "unruly:raises": ("correct", "raised"),
    "unruly:nonsense": ("correct", "raised"),
    "unruly:dies": ("worker", "worker_died"),
    "unruly:hangs": ("worker", "time_limit"),
}


def endings(rows: list[Any]) -> dict[str, tuple[str, str]]:
    return {row["method"]: (row["failure_stage"], row["failure_code"]) for row in rows}


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    """The rows of `MANY`, by two processes."""
    return run_sweep(MANY, tmp_path_factory.mktemp("two") / "run", workers=2)


def test_rows_are_the_same_bytes_whoever_makes_them_and_a_death_costs_one_trial(two: list[Any], tmp_path: Path) -> None:
    assert endings(two) == {method: ENDS[method] for method in MANY.method}
    assert len(two) == 4
    one = run_sweep(MANY, tmp_path / "one", workers=1)
    assert sorted(map(json.dumps, one)) == sorted(map(json.dumps, two))
    alive = [row for row in two if row["failure_stage"] != "worker"]
    here = run_sweep(grid("uncorrected", "raises", "nonsense"), tmp_path / "here")
    assert sorted(map(json.dumps, here)) == sorted(map(json.dumps, alive))
    timing = [json.loads(text) for text in (tmp_path / "one" / "timing.jsonl").read_text().splitlines()]
    assert len(timing) == len(one)


def replayed(row: dict[str, Any], capsys: pytest.CaptureFixture[str], limits: Limits = USUAL_LIMITS) -> dict[str, Any]:
    """The row that the command of a row prints."""
    assert main([*shlex.split(format_replay_command(row, None, limits))[1:], "--json"]) == 0
    return dict(json.loads(capsys.readouterr().out))


@pytest.mark.parametrize("method", ["raises", "dies"])
def test_a_replay_of_a_trial_that_went_wrong_is_the_same_row(
    method: str, two: list[Any], capsys: pytest.CaptureFixture[str]
) -> None:
    row = next(row for row in two if row["method"] == f"unruly:{method}")
    assert ("--trial-limit 600" in format_replay_command(row)) is (method == "dies")
    assert replayed(row, capsys) == json.loads(json.dumps(row))


def test_a_trial_that_hangs_is_ended_at_its_limit_and_the_others_go_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = run_sweep(grid("hangs", "raises"), tmp_path / "run", workers=1, limit_s=4.0)
    assert endings(rows) == {method: ENDS[method] for method in ("unruly:hangs", "unruly:raises")}
    limits = read_limits(read_run(tmp_path / "run"))
    assert limits == Limits(4.0)
    late = next(row for row in rows if row["method"] == "unruly:hangs")
    assert "4" not in late["sentence"]
    assert "--trial-limit 4 " in format_replay_command(late, None, limits)
    assert replayed(late, capsys, limits) == json.loads(json.dumps(late))


TALKS = shlex.split("run block_on_block --human-error-scale 0 --fidelity near-contact --method unruly:talks --json")


@pytest.mark.skipif(sys.platform == "win32", reason="the C library has no name there")
@pytest.mark.parametrize("more", [[], ["--trial-limit", "100"]])
def test_a_row_on_standard_output_stands_there_alone(
    more: list[str], capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("PYTHONUNBUFFERED", raising=False)
    assert main([*TALKS, *more]) == 0
    out, err = capfd.readouterr()
    assert json.loads(out)["method"] == "unruly:talks"
    for words in ("from Python", "from below", "from C")[: 2 if more else 3]:
        assert words in err


def test_a_worker_with_other_code_or_packages_refuses() -> None:
    batch = (TrialConfig("block_on_block", method="uncorrected"),)
    other = SweepInputs({"block_on_block": "0123456789abcdef"}, list_versions())
    with pytest.raises(InputError, match="has other files for 'block_on_block'"):
        list(Worker(other, {}).run(batch))
    with pytest.raises(InputError, match=r"has mujoco .*, the process that started the sweep 1\.2\.3; install"):
        Worker(SweepInputs({}, list_versions() | {"mujoco": "1.2.3"}), {})
    with pytest.raises(InputError, match="has other files"):
        pool.run_locally([batch], other, 1, 60.0, lambda row, timing: None)


def count(out: Path) -> int:
    path = out / "trials.jsonl"
    return path.read_bytes().count(b"\n") if path.exists() else 0


def wait_for(true: Callable[[], bool], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.05)


def started(out: Path, levels: str) -> subprocess.Popen[str]:
    asked = shlex.split(f"sweep block_on_block --human-error-scale 0 --workers 2 --noise-level {levels} --out")
    return subprocess.Popen(
        [sys.executable, "-m", "apo_bench.cli.app", *asked, str(out), "--method", "unruly:slow", "--trials", "1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell may have it ignored
        start_new_session=True,
    )


def children(pid: int) -> list[Path]:
    """Processes that a process has started, which have not ended."""
    found = [
        int(child) for task in Path(f"/proc/{pid}/task").iterdir() for child in (task / "children").read_text().split()
    ]
    return [Path(f"/proc/{child}") for child in found]


@PROCESSES
@pytest.mark.parametrize(
    ("number", "code", "said"), [(signal.SIGTERM, 143, "ended by SIGTERM"), (signal.SIGINT, 130, "interrupted")]
)
def test_a_signal_leaves_whole_rows_and_no_process(
    number: signal.Signals, code: int, said: str, tmp_path: Path
) -> None:
    levels = ",".join(str(0.5 * k) for k in range(100))
    process = started(tmp_path / "run", levels)
    wait_for(lambda: count(tmp_path / "run") >= 2)
    workers = children(process.pid)
    assert len(workers) >= 2
    os.killpg(process.pid, number)  # as a terminal does
    _, printed = process.communicate(timeout=60)
    assert process.returncode == code
    assert printed.splitlines() == [
        "0 of 100 trials",
        f"apo-bench: {said}; the trials that ended are kept, and the same command continues.",
    ]
    wait_for(lambda: not any(worker.exists() for worker in workers))
    assert 2 <= count(tmp_path / "run") < 100
    assert (tmp_path / "run" / "trials.jsonl").read_bytes().endswith(b"\n")


def test_signals_raise_and_handlers_of_the_callers_own_stay() -> None:
    def mine(number: int, frame: Any) -> None: ...

    before = signal.signal(signal.SIGTERM, signal.SIG_DFL)
    try:
        with stop_at_signals(), pytest.raises(StoppedBySignal) as stopped:
            signal.raise_signal(signal.SIGTERM)
        assert stopped.value.number == signal.SIGTERM
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
        signal.signal(signal.SIGTERM, mine)
        with stop_at_signals():
            assert signal.getsignal(signal.SIGTERM) is mine
    finally:
        signal.signal(signal.SIGTERM, before)
