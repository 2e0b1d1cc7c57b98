"""A sweep on a Ray cluster: the same rows, whatever becomes of nodes, trials and the driver. The cluster is real."""

from __future__ import annotations

import importlib.util
import json
import shlex
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from apo_bench import SweepConfig, TrialConfig, run_sweep, run_trial
from apo_bench.benchmark.sweeps import cluster as on_ray
from apo_bench.benchmark.sweeps.grid import load_all
from apo_bench.benchmark.sweeps.user_files import list_user_files_for_nodes
from apo_bench.cli.app import main
from apo_bench.resources import folder
from tests.image_sets import make, write_truth

SPEC = SweepConfig(
    ("carried_bridge",), noise_level=(1.0,), human_error_scale=(0.0,), method=("uncorrected", "paper"), trials=10
)
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


def lines(out: Path) -> list[bytes]:
    return sorted((out / "trials.jsonl").read_bytes().splitlines())


def text_of(path: Path) -> str:
    """Nothing where there is no such file yet."""
    return path.read_text() if path.exists() else ""


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    """The rows of `SPEC`, made in this process."""
    out = tmp_path_factory.mktemp("here")
    run_sweep(SPEC, out)
    return lines(out)


@pytest.mark.extras
def test_a_node_that_is_lost_costs_no_row_and_changes_none(cluster: Any, here: list[bytes], tmp_path: Path) -> None:
    second = next(node for node in cluster.list_all_nodes() if node is not cluster.head_node)

    def lose() -> None:
        """As soon as it has made a row."""
        wait_for(lambda: second.node_id in text_of(tmp_path / "timing.jsonl"))
        cluster.remove_node(second, allow_graceful=False)

    losing = threading.Thread(target=lose)
    losing.start()
    run_sweep(SPEC, tmp_path, backend="ray", address=cluster.address)
    losing.join()
    cluster.add_node(**NODE)
    timing = [json.loads(line) for line in text_of(tmp_path / "timing.jsonl").splitlines()]
    assert lines(tmp_path) == here
    assert {entry["node"] for entry in timing} == {second.node_id, cluster.head_node.node_id}
    assert all({"host", "worker", "trial_s"} <= set(entry) for entry in timing)


@pytest.mark.extras
def test_a_driver_that_is_stopped_goes_on_later(cluster: Any, here: list[bytes], tmp_path: Path) -> None:
    out = tmp_path / "run"
    asked = shlex.split("--noise-level 1 --human-error-scale 0 --method uncorrected,paper --trials 10 --out")
    command = [sys.executable, "-m", "apo_bench.cli.app", "sweep", "carried_bridge", *asked, str(out)]
    process = subprocess.Popen(
        [*command, "--backend", "ray", "--address", cluster.address],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    wait_for(lambda: text_of(out / "trials.jsonl").count("\n") >= 2)
    process.send_signal(signal.SIGTERM)
    printed = process.communicate(timeout=60)
    assert process.returncode == 143
    # on a slow machine Ray adds lines of its own, on either stream
    shown = "\n".join(printed)
    assert "0 of 20 trials" in shown
    assert "Traceback" not in shown
    assert "apo-bench: ended by SIGTERM; the trials that ended are kept, and the same command continues." in shown
    assert 2 <= len(lines(out)) < len(here)
    run_sweep(SPEC, out, backend="ray", address=cluster.address)
    assert lines(out) == here


@pytest.mark.extras
def test_a_trial_that_dies_or_hangs_is_one_failed_row(cluster: Any, own: Path) -> None:
    """And files of the current folder, with what they import, travel to the nodes."""
    methods = tuple(f"code_of_mine:{name}" for name in ("dies", "raises", "hangs"))
    shutil.copy(folder("scenarios") / "block_on_block.toml", own / "mine.toml")
    spec = replace(SPEC, scenario=("mine.toml",), method=methods, trials=1)
    rows = run_sweep(spec, own / "run", backend="ray", address=cluster.address, limit_s=4.0)
    assert {row["method"].partition(":")[2]: (row["failure_stage"], row["failure_code"]) for row in rows} == {
        "dies": ("worker", "worker_died"),
        "raises": ("correct", "raised"),
        "hangs": ("worker", "time_limit"),
    }
    assert len(rows) == 3


def test_files_below_the_current_folder_travel_and_no_others(
    own: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    far = tmp_path_factory.mktemp("far") / "far.toml"
    text = (folder("scenarios") / "block_on_block.toml").read_text()
    far.write_text(text.replace("block_on_block", "far"))
    (own / "deep").mkdir()
    (own / "deep" / "mine.toml").write_text(text.replace('file = "block"', 'file = "../part.xml"'))
    shutil.copy(folder("assets") / "parts" / "block.xml", own / "part.xml")
    shutil.copy(folder("assets") / "noise" / "megapose-lmo.toml", own / "noise.toml")
    loaded = load_all([replace(SPEC, scenario=("deep/mine.toml", str(far), "stick_in_tower"))])
    travel = list_user_files_for_nodes(
        loaded, (), ("code_of_mine:raises+probe", "noise.toml", "camera", "given", "six_axis")
    )
    code = {"code_of_mine.py", "helper_of_mine.py"}
    assert set(travel) == {"deep/mine.toml", "part.xml", "noise.toml"} | code
    assert all((own / name).samefile(path) for name, path in travel.items())


def test_pose_results_travel_with_the_trials_and_cameras_of_their_images(
    own: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A node that has these files alone runs the trial as here."""
    write_truth(make(own / "images", "block_on_block"))
    noise = "poses:images/results.csv"
    config = TrialConfig("block_on_block", noise=noise, human_error_scale=0.0, fidelity="near-contact")
    here = run_trial(config)
    travel = list_user_files_for_nodes(load_all([SPEC]), (), (noise,))
    assert set(travel) == {
        f"images/{each}" for each in ("results.csv", "apo_trials.json", "test/000001/scene_camera.json")
    }
    node = tmp_path_factory.mktemp("node")
    for name, path in travel.items():
        (node / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, node / name)
    monkeypatch.chdir(node)
    assert run_trial(config) == here


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str], out: Path) -> str:
    asked = ["sweep", "block_on_block", "--trials", "1", "--out", str(out), *arguments]
    assert main(asked) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n"), said.err[:11]) == ("", 1, "apo-bench: ")
    assert not out.exists()
    return said.err


def test_the_extra_is_named_where_it_is_missing(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(on_ray.importlib.util, "find_spec", lambda name: None)
    assert "pip install 'apo_bench[ray]'" in refused(["--backend", "ray"], capsys, tmp_path / "run")
