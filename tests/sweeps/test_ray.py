"""A sweep on a Ray cluster: the same rows, whatever becomes of nodes, workers and the driver. The cluster is real."""

from __future__ import annotations

import importlib.util
import json
import pickle
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from apo_bench import InputError, SweepSettings, run_sweep
from apo_bench.cli.app import main
from apo_bench.records import Row, row_key
from apo_bench.resources import folder
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.sweeps.grid import load_all, units
from apo_bench.sweeps.ray import backend as on_ray
from apo_bench.sweeps.ray import pool, task
from apo_bench.sweeps.ray.driver import runtime_files
from apo_bench.sweeps.sweep import names_of
from apo_bench.sweeps.work import dispatch
from apo_bench.sweeps.work.dispatch import Dispatch
from apo_bench.sweeps.work.environment_lock import EnvironmentLock, Unit, environment_lock

SPEC = SweepSettings(("carried_bridge",), levels=(1.0,), careless=(0.0,), methods=("none", "paper"), trials=5)
NODE = {"num_cpus": 1, "object_store_memory": 80 * 2**20, "include_dashboard": False}
CODE = """
import os, time
from helper_of_mine import seconds

def dies(seen):
    os._exit(3)

def hangs(seen):
    time.sleep(seconds)

def raises(seen):
    raise RuntimeError("of my own")
"""
installed = pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="Ray is not installed: the extra [ray]")


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of a user's own, and the current one."""
    (tmp_path / "code_of_mine.py").write_text(CODE)
    (tmp_path / "helper_of_mine.py").write_text("seconds = 1000")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield tmp_path
    for name in ("code_of_mine", "helper_of_mine"):
        sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """A head and another node, one CPU each; nothing of it is left afterwards."""
    pytest.importorskip("ray", reason="Ray is not installed: the extra [ray]")
    if not Path("/proc").is_dir():
        pytest.skip("looks for processes in /proc")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        patch.setenv("RAY_AUTH_MODE", "disabled")
        patch.delenv("RAY_ADDRESS", raising=False)
        from ray.cluster_utils import Cluster

        cluster = Cluster(initialize_head=True, head_node_args=NODE)
        session = str(cluster.head_node.get_session_dir_path())
        try:
            cluster.add_node(**NODE)
            yield cluster
        finally:
            cluster.shutdown()
            wait_for(lambda: not processes(session))


def processes(word: str) -> list[int]:
    """Those with a word in their command line."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if word.encode() in path.read_bytes():
                found.append(int(path.parent.name))
        except OSError:
            continue
    return found


def wait_for(true: Callable[[], bool], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.1)


def lock_of(spec: SweepSettings) -> tuple[tuple[Unit, ...], EnvironmentLock]:
    loaded = load_all([spec])
    return tuple(units([spec], loaded)), environment_lock(names_of([spec]), loaded, find_arm(spec.arm).files)


def lines(out: Path) -> list[bytes]:
    return sorted((out / "trials.jsonl").read_bytes().splitlines())


def text_of(path: Path) -> str:
    """Nothing where there is no such file, or no longer."""
    try:
        return path.read_text()
    except OSError:
        return ""


def count(out: Path) -> int:
    return text_of(out / "trials.jsonl").count("\n")


def workers(cluster: Any) -> list[int]:
    """The processes that run tasks on the nodes of a cluster."""
    raylets = {info.process.pid for node in cluster.list_all_nodes() for info in node.all_processes["raylet"]}
    return [pid for pid in processes("ray::run_unit") if parent(pid) in raylets]


def parent(pid: int) -> int | None:
    found = re.search(r"^PPid:\s*(\d+)", text_of(Path(f"/proc/{pid}/status")), re.MULTILINE)
    return int(found[1]) if found else None


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    """The rows of `SPEC`, made in this process."""
    out = tmp_path_factory.mktemp("here")
    run_sweep(SPEC, out)
    return lines(out)


@pytest.mark.extras
def test_a_node_that_is_lost_costs_no_row_and_changes_none(cluster: Any, here: list[bytes], tmp_path: Path) -> None:
    second = next(node for node in cluster.list_all_nodes() if node is not cluster.head_node)
    rows_then = []

    def lose() -> None:
        """As soon as it has made a row."""
        wait_for(lambda: second.node_id in text_of(tmp_path / "timing.jsonl"))
        rows_then.append(count(tmp_path))
        cluster.remove_node(second, allow_graceful=False)

    losing = threading.Thread(target=lose)
    losing.start()
    run_sweep(SPEC, tmp_path, backend="ray", address=cluster.address)
    losing.join()
    cluster.add_node(**NODE)
    timing = [json.loads(line) for line in text_of(tmp_path / "timing.jsonl").splitlines()]
    assert lines(tmp_path) == here
    assert 0 < rows_then[0] < len(here)
    assert {entry["node"] for entry in timing} == {second.node_id, cluster.head_node.node_id}
    assert all({"host", "worker", "trial_s"} <= set(entry) for entry in timing)


@pytest.mark.extras
def test_a_driver_that_is_stopped_or_killed_goes_on_later(cluster: Any, here: list[bytes], tmp_path: Path) -> None:
    out = tmp_path / "run"
    asked = ["--levels", "1", "--careless", "0", "--methods", "none,paper", "--trials", "5", "--out", str(out)]
    command = [sys.executable, "-m", "apo_bench.cli.app", "sweep", "carried_bridge", *asked]
    command += ["--backend", "ray", "--address", cluster.address]

    def start() -> subprocess.Popen[str]:
        return subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell may have it ignored
        )

    for number, rows in ((signal.SIGINT, 2), (signal.SIGKILL, 5)):
        process = start()
        wait_for(lambda rows=rows: count(out) >= rows)
        process.send_signal(number)
        printed = process.communicate(timeout=60)
        if number == signal.SIGINT:
            assert process.returncode == 130
            assert (printed[0], printed[1].count("\n"), printed[1][:11]) == ("", 1, "apo-bench: ")
        wait_for(lambda: not workers(cluster))
    assert len(cluster.list_all_nodes()) == 2
    assert 5 <= count(out) < len(here)
    last = start()
    printed = last.communicate(timeout=120)
    assert (last.returncode, printed[1]) == (0, "")
    assert f"{len(here)} rows in" in printed[0]
    assert lines(out) == here


@pytest.mark.extras
def test_a_trial_that_ends_its_worker_or_hangs_is_one_failed_row(cluster: Any, own: Path) -> None:
    """And files of the current folder, with what they import, travel to the nodes."""
    methods = tuple(f"code_of_mine:{name}" for name in ("dies", "raises", "hangs"))
    shutil.copy(folder("scenarios") / "block_on_block.toml", own / "mine.toml")
    spec = replace(SPEC, scenarios=("mine.toml",), methods=methods, trials=1)
    work, lock = lock_of(spec)
    rows: list[Row] = []
    on_ray.run_on_ray(
        work,
        lock,
        workers=None,
        limit_s=3.0,
        emit=lambda row, timing: rows.append(row),
        address=cluster.address,
    )
    ends = {row["method"].partition(":")[2]: (row["failure_stage"], row["failure_code"]) for row in rows}
    assert len(rows) == len({row_key(row) for row in rows}) == 3
    assert ends == {
        "dies": ("worker", "worker_died"),
        "raises": ("correct", "raised"),
        "hangs": ("worker", "time_limit"),
    }
    assert not any(row["success"] for row in rows)


@pytest.mark.extras
def test_nodes_with_other_packages_or_code_are_refused(cluster: Any) -> None:
    work, lock = lock_of(SPEC)
    other = replace(lock, versions={**lock.versions, "mujoco": "3.0.0"})
    with pytest.raises(InputError, match=rf"the node '{socket.gethostname()}' .* mujoco .* 3\.0\.0"):
        on_ray.run_on_ray(work, other, workers=1, limit_s=60.0, emit=refuse_row, address=cluster.address)


def refuse_row(row: Row, timing: dict[str, Any]) -> None:
    raise AssertionError("a row was made")


def test_what_speaks_against_a_node_is_one_sentence(own: Path) -> None:
    work, lock = lock_of(replace(SPEC, methods=("code_of_mine:raises",)))
    lock.check_here()
    for changed, words in (
        ({"content": dict.fromkeys(lock.content, "0" * 16)}, "other code or other files for 'carried_bridge'"),
        ({"hashes": dict.fromkeys(lock.hashes, "0" * 16)}, "the file behind the method code_of_mine:raises is another"),
        ({"names": replace(lock.names, methods=("not_there:at_all",))}, "cannot be imported"),
        ({"names": replace(lock.names, scenarios=("missing.toml",))}, "missing.toml"),
    ):
        ((kind, said),) = task.messages(pickle.dumps(replace(lock, **changed)), work[0], "node 1")
        assert words in said
        assert (kind, said.count("\n"), said.startswith("the node '")) == ("refused", 0, True)


def test_files_below_the_current_folder_travel_and_no_others(
    own: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    far = tmp_path_factory.mktemp("far") / "far.toml"
    text = (folder("scenarios") / "block_on_block.toml").read_text()
    far.write_text(text.replace("block_on_block", "far"))
    (own / "deep").mkdir()
    (own / "deep" / "mine.toml").write_text(text.replace('file = "block"', 'file = "../part.xml"'))
    shutil.copy(folder("assets") / "parts" / "block.xml", own / "part.xml")
    (own / "part.toml").write_text("")
    shutil.copy(folder("assets") / "noise" / "megapose-lmo.toml", own / "noise.toml")
    scenarios = ("deep/mine.toml", str(far))
    spec = replace(SPEC, scenarios=scenarios, methods=("code_of_mine:raises",), noises=("noise.toml", "camera"))
    travel = runtime_files(names_of([spec]))
    assert set(travel) == {
        "deep/mine.toml",
        "part.xml",
        "part.toml",
        "noise.toml",
        "code_of_mine.py",
        "helper_of_mine.py",
    }
    assert all((own / name).samefile(path) for name, path in travel.items())


def test_code_that_ends_its_process_is_no_error_of_the_trial(monkeypatch: pytest.MonkeyPatch) -> None:
    """An error would end the sweep; a process that ends costs a trial."""
    work, _ = lock_of(replace(SPEC, trials=1))
    ended: list[int] = []

    def leave(packed: bytes) -> Any:
        sys.exit(0)

    monkeypatch.setattr(task, "_worker", leave)
    monkeypatch.setattr(task.os, "_exit", ended.append)
    assert list(task.messages(b"", work[0], "node 1")) == []
    assert ended == [1]


class Gone(Exception):
    """A worker that is no more."""


class NodeGone(Gone):
    """A node that is no more."""


class Messages:
    """Stands for what a task yields; an error is raised, `...` never comes."""

    def __init__(self, answers: list[Any]) -> None:
        self.answers = list(answers)

    def __next__(self) -> Any:
        if not self.answers:
            raise StopIteration
        return self.answers.pop(0)


class Nodes:
    """Stands for Ray: `tasks` says what each next task answers."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, tasks: list[list[Any]], spec: SweepSettings = SPEC) -> None:
        self.tasks = list(tasks)
        self.taken = list[int]()
        self.cancelled = 0
        self.rows = list[Any]()
        names = {"NodeDiedError": NodeGone, "ObjectLostError": NodeGone, "RayError": Gone, "RayTaskError": KeyError}
        monkeypatch.setitem(sys.modules, "ray", self)
        monkeypatch.setitem(sys.modules, "ray.exceptions", SimpleNamespace(**names))
        work, lock = lock_of(replace(spec, trials=1))
        self.dispatch = Dispatch(
            work, lock, 60.0, self.emit, deaths=pool.DEATHS, false_starts=pool.FALSE_STARTS_OF_TASKS
        )
        self.pool = pool.RayPool(self.dispatch, self.start, workers=1)

    def start(self, unit: bytes) -> Messages:
        self.taken.append(len(pickle.loads(unit).trials))
        return Messages(self.tasks.pop(0))

    def emit(self, row: Row, timing: Any) -> None:
        self.rows.append(row.get("failure_code", "row"))

    def wait(self, calls: list[Messages], **_: Any) -> tuple[list[Messages], list[Messages]]:
        return [call for call in calls if call.answers[:1] != [...]], []

    def get(self, answer: Any) -> Any:
        if isinstance(answer, Exception):
            raise answer
        return answer

    def cancel(self, messages: Messages, force: bool) -> None:
        self.cancelled += 1

    def turns(self, most: int = 99) -> None:
        while self.pool.is_busy and most:
            self.pool.turn()
            most -= 1


HERE = ("here", {"host": "h", "node": "n", "worker": 7})
BEGAN = ("began",)
ENDED = ("row", {}, {})
FINE = [HERE, BEGAN, ENDED, BEGAN, ENDED]


@pytest.mark.parametrize(
    ("tasks", "rows", "taken"),
    [
        ([FINE], ["row", "row"], [2]),
        ([[Gone()], FINE], ["row", "row"], [2, 2]),
        ([[HERE, BEGAN, Gone()], FINE], ["row", "row"], [2, 2]),
        ([[HERE, BEGAN, Gone()], [HERE, BEGAN, Gone()], FINE[3:]], ["worker_died", "row"], [2, 2, 1]),
        ([[*FINE[:4], Gone()], [HERE, BEGAN, Gone()]], ["row", "worker_died"], [2, 1]),
        ([[*FINE[:5], Gone()]], ["row", "row"], [2]),
        ([[HERE, BEGAN, NodeGone()]] * 9 + [FINE], ["row", "row"], [2] * 10),
    ],
)
def test_each_trial_has_one_row_whatever_becomes_of_nodes_and_workers(
    tasks: list[list[Any]], rows: list[str], taken: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two workers that die of a trial are its fault; nodes that are lost never are."""
    ray = Nodes(monkeypatch, tasks)
    ray.turns()
    assert (ray.rows, ray.taken, ray.pool.is_busy) == (rows, taken, False)


def test_workers_that_never_begin_end_the_sweep(monkeypatch: pytest.MonkeyPatch) -> None:
    ray = Nodes(monkeypatch, [[Gone("no room")]] * 9)
    ray.turns(pool.FALSE_STARTS_OF_TASKS - 1)
    with pytest.raises(RuntimeError, match="end before they have begun a trial: no room"):
        ray.turns(1)
    assert not ray.rows


def test_workers_that_begin_no_more_cost_the_trials_of_own_correctors(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = replace(SPEC, methods=("not_there:one", "not_there:two"))
    ray = Nodes(monkeypatch, [[*FINE[:3], Gone()], *[[HERE, Gone()]] * 9], spec)
    ray.turns()
    assert ray.rows == ["row", "worker_died"]


def test_a_driver_that_was_asleep_finds_nobody_late(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(dispatch.time, "monotonic", lambda: now[0])
    ray = Nodes(monkeypatch, [[HERE, BEGAN, ...], FINE[3:]])
    for seconds in (0.0, 0.0, 3600.0):
        now[0] += seconds
        ray.turns(1)
    assert (ray.rows, ray.cancelled) == ([], 0)
    for _ in range(70):
        now[0] += 1.0
        ray.turns(1)
    assert (ray.rows, ray.cancelled) == (["time_limit", "row"], 1)


def test_a_stop_keeps_the_rows_of_trials_that_end_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    ray = Nodes(monkeypatch, [FINE])
    ray.turns(2)
    ray.pool.stop()
    ray.turns()
    assert (ray.rows, ray.cancelled) == (["row"], 1)


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str], out: Path) -> str:
    asked = ["sweep", "block_on_block", "--trials", "1", "--out", str(out), *arguments]
    assert main(asked) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n"), said.err[:11]) == ("", 1, "apo-bench: ")
    return said.err


@installed
@pytest.mark.parametrize("address", ["rubbish", "10.0.0.1", "ray://10.0.0.1:10001", "host:port", "1.2.3.4:0", ""])
def test_what_is_no_address_is_refused(address: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    said = refused(["--backend", "ray", "--address", address], capsys, tmp_path / "run")
    assert "HOST:PORT of its head is allowed" in said
    assert not (tmp_path / "run").exists()


@installed
def test_an_address_where_nothing_listens(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    for address in (f"127.0.0.1:{port}", "no-such-host.invalid:6379"):
        said = refused(["--backend", "ray", "--address", address], capsys, tmp_path / "run")
        assert f"no Ray cluster answers at {address}" in said
    assert not (tmp_path / "run").exists()


@installed
def test_an_address_where_something_else_listens(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(on_ray, "JOINING_S", 2.0)
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
        said = refused(["--backend", "ray", "--address", address], capfd, tmp_path / "run")
    assert f"no Ray cluster answered at {address} within 2 s" in said


def test_the_extra_is_named_where_it_is_missing(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(on_ray.importlib.util, "find_spec", lambda name: None)
    assert "pip install 'apo_bench[ray]'" in refused(["--backend", "ray"], capsys, tmp_path / "run")


def test_an_address_is_one_of_a_cluster(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert "--backend ray" in refused(["--address", "10.0.0.1:6379"], capsys, tmp_path / "run")
