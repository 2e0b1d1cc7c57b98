"""The folder of a sweep: whole rows, whatever kills the process that writes, fills the disk, or changes in between.

Trials cost nothing here; processes that are killed are forked, so that twenty deaths take a second.
"""

from __future__ import annotations

import errno
import json
import os
import random
import resource
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from apo_bench import InputError
from apo_bench.assembly import Outcome
from apo_bench.records import KEY, RECORD_SCHEMA, TrialConfig, list_setting_columns
from apo_bench.records.run.run_file import make_run_record
from apo_bench.records.run.run_folder import RunFolder, read_records
from apo_bench.trial.fingerprint import list_versions
from apo_bench.trial.record_start_and_end import end_record

GRID = {"scenarios": ["block_on_block"], "noise_level": [1.0], "trials": 60}
CONTENT = {"block_on_block, scenario": "11", "block_on_block, part cube": "22"}
VERSIONS = list_versions()
pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")


def run(**changed: Any) -> dict[str, Any]:
    said = {"grids": [GRID], "content": CONTENT, "files": {}, "command": "apo-bench sweep"} | changed
    return make_run_record(versions=VERSIONS, **said)


def row(seed: int) -> dict[str, Any]:
    ended = {"demonstration": "ok", **end_record(Outcome("done", "ok", None, "all was done"), success=True)}
    ended |= {"sim_time_s": 20.0, "extra_steps": 0}
    reached = {f"part {i}": [0.1 * seed] * 7 for i in range(7)}
    return {
        "schema": RECORD_SCHEMA,
        "env_id": "APOReplay-v0",
        "config_hash": "ab",
        **list_setting_columns(TrialConfig("block_on_block", seed=seed), "block_on_block"),
        **ended,
        "final_poses": reached,
    }


def line(seed: int) -> bytes:
    return json.dumps(row(seed)).encode() + b"\n"


def write(folder: Path, seeds: range, pause_s: float = 0.0) -> None:
    """What a sweep does: the rows that are not there yet."""
    with RunFolder(folder, run()) as store:
        there = {key[KEY.index("seed")] for key in store.finished}
        for seed in seeds:
            if seed not in there:
                store.append(row(seed), {"seed": seed, "trial_s": 1.0})
                time.sleep(pause_s)


def forked(act: Callable[[], None]) -> int:
    """Run something in a process of its own, which ends without cleaning up."""
    pid = os.fork()
    if pid:
        return pid
    try:
        act()
    except BaseException:
        os._exit(1)
    os._exit(0)


def ended(pid: int) -> int:
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def test_twenty_kills_lose_no_row_and_leave_no_wrong_one(tmp_path: Path) -> None:
    rng = random.Random(3)
    wanted = [line(seed) for seed in range(60)]
    before: list[bytes] = []
    for _ in range(20):
        pid = forked(lambda: write(tmp_path, range(60), pause_s=0.002))
        time.sleep(rng.uniform(0.0, 0.02))
        os.kill(pid, signal.SIGKILL)
        ended(pid)
        path = tmp_path / "trials.jsonl"
        now = path.read_bytes().splitlines(keepends=True) if path.exists() else []
        assert now[: len(before)] == before
        assert now == wanted[: len(now)]
        before = now
    write(tmp_path, range(60))
    assert (tmp_path / "trials.jsonl").read_bytes() == b"".join(wanted)


def test_the_last_line_may_be_cut_anywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "fsync", lambda file: None)
    write(tmp_path, range(3))
    path = tmp_path / "trials.jsonl"
    aside = tmp_path / "torn.txt"
    whole = path.read_bytes()
    begin = len(line(0) + line(1))
    for left in sorted({*range(begin, len(whole), 5), *range(begin, begin + 9), *range(len(whole) - 9, len(whole))}):
        path.write_bytes(whole[:left])
        aside.unlink(missing_ok=True)
        assert len(read_records(tmp_path)) == 2
        write(tmp_path, range(3))
        assert path.read_bytes() == whole
        torn = whole[len(line(0) + line(1)) : left]
        assert (aside.read_bytes() if aside.exists() else b"") == (torn + b"\n" if torn else b"")


@pytest.mark.parametrize("room", [0, 1500])
def test_a_full_disk_takes_back_half_a_row(room: int, tmp_path: Path) -> None:
    write(tmp_path, range(2))
    size = (tmp_path / "trials.jsonl").stat().st_size

    def filling() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size + room, size + room))
        with pytest.raises(
            RuntimeError, match=r"could not be written to .*File too large\); the \d+ before it are kept"
        ):
            write(tmp_path, range(60))

    assert ended(forked(filling)) == 0
    now = (tmp_path / "trials.jsonl").read_bytes()
    fit = [n for n in range(60) if len(b"".join(map(line, range(n)))) <= size + room]
    assert now == b"".join(map(line, range(fit[-1])))
    write(tmp_path, range(60))
    assert (tmp_path / "trials.jsonl").read_bytes() == b"".join(line(seed) for seed in range(60))
    assert not (tmp_path / "torn.txt").exists()


def test_only_one_process_writes(tmp_path: Path) -> None:
    with RunFolder(tmp_path, run()), pytest.raises(InputError, match="another sweep is writing to"):
        RunFolder(tmp_path, run())
    write(tmp_path, range(1))


def test_run_json_is_the_old_one_or_the_new_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path, range(1))
    before = (tmp_path / "run.json").read_bytes()

    def dies(*_: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", dies)
    with pytest.raises(InputError, match=r"cannot be written \(No space left on device\)"):
        RunFolder(tmp_path, run(grids=[GRID | {"trials": 80}]))
    assert (tmp_path / "run.json").read_bytes() == before
    monkeypatch.undo()
    write(tmp_path, range(2))


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"content": CONTENT | {"method mine:fit": "0"}}, "(inputs: method mine:fit was null, now"),
        ({"grids": [GRID, GRID]}, "(it had 1 grids, now 2)"),
    ],
)
def test_what_changed_is_said(changed: dict[str, Any], words: str, tmp_path: Path) -> None:
    write(tmp_path, range(2))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(InputError) as refused:
        RunFolder(tmp_path, run(**changed))
    assert words in str(refused.value)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    assert RunFolder(tmp_path, run(grids=[GRID | {"trials": 99}])).finished


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("run.json", "{", "has trials but no readable run.json"),
        (
            "trials.jsonl",
            json.dumps(row(1) | {"schema": "apo-bench/record/10"}) + "\n",
            "'apo-bench/record/10' was given; only apo-bench/record/1 can be read",
        ),
    ],
)
def test_a_folder_of_something_else(name: str, text: str, words: str, tmp_path: Path) -> None:
    write(tmp_path, range(2))
    (tmp_path / name).write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError) as refused:
        write(tmp_path, range(3))
    assert words in str(refused.value)
    assert (tmp_path / name).read_bytes() == text.encode("latin-1")
