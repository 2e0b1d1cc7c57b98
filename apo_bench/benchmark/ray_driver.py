"""The process between a sweep and a Ray cluster.

Ray writes what it likes to the terminal, handles signals its own way, and ends the process when the cluster is lost; so
it has a process of its own. What is worth saying goes through a pipe to the sweep, which alone writes rows.
"""

from __future__ import annotations

import os
import pickle
import shutil
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import parent_process
from pathlib import Path
from typing import Any, final

from apo_bench.benchmark.crew_member import THREADS
from apo_bench.benchmark.grid import Unit
from apo_bench.benchmark.parcel import Wanted
from apo_bench.benchmark.ray_crew import Crew
from apo_bench.benchmark.stopping import SIGNALS
from apo_bench.benchmark.terms import Terms
from apo_bench.errors import InputError

GRACE_S = 5.0
"""After a stop: what trials under way get to end."""
ANSWER_S = 120.0
"""What a node gets to start a process and to import the package."""
OBJECT_STORE = 100 * 2**20
"""Bytes, of a cluster that is started here; rows are small."""
SETTINGS = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",
    "RAY_OVERRIDE_JOB_RUNTIME_ENV": "1",
}
"""Ray tells nobody that it runs, hides no GPU from the renderer, and takes our files instead of those of a job."""


@final
@dataclass(frozen=True)
class Job:
    """What the sweep wants of the cluster."""

    work: Sequence[Unit]
    terms: Terms
    wanted: Wanted
    files: Mapping[str, Path]
    """From `parcel`."""
    address: str | None
    workers: int | None
    """At most so many; None for as many as the cluster has CPUs."""
    limit_s: float


def drive(pipe: Any, job: Job, log: str) -> None:
    """The life of the process: connect, have the nodes checked, spread the work, say one last word.

    Sends ("connected",), ("row", row, timing), and last ("done",), ("refused", sentence) or ("failed", text); ends
    early when it is sent anything, or when the sweep is gone.
    """
    _live_apart(log)
    with suppress(EOFError, OSError):
        pipe.send(_last_word(pipe, job))


def _live_apart(log: str) -> None:
    if hasattr(os, "setsid"):
        os.setsid()
    for one in SIGNALS:
        signal.signal(one, signal.SIG_IGN)
    file = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    os.dup2(file, 1)
    os.dup2(file, 2)
    os.environ.update(SETTINGS)
    os.environ.update(dict.fromkeys(THREADS, "1"))
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Rows of a process whose parent was killed would be written by nobody; Ray ends its workers when it is gone."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _last_word(pipe: Any, job: Job) -> tuple[str, ...]:
    import ray

    try:
        _connect(job)
        pipe.send(("connected",))
        _check_nodes(job)
        _work(pipe, job)
    except InputError as error:
        return ("refused", str(error))
    except Exception as error:
        return ("failed", f"{type(error).__name__}: {error}" if str(error) else type(error).__name__)
    finally:
        with suppress(Exception):
            ray.shutdown()
    return ("done",)


def _connect(job: Job) -> None:
    """Join the cluster that was named, or the one that runs here, or start one for the time of the sweep."""
    import ray

    with tempfile.TemporaryDirectory() as folder:
        runtime: dict[str, Any] = {"env_vars": dict.fromkeys(THREADS, "1")}
        if "MUJOCO_GL" in os.environ:
            runtime["env_vars"]["MUJOCO_GL"] = os.environ["MUJOCO_GL"]
        if job.files:
            for name, path in job.files.items():
                (Path(folder) / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(path, Path(folder) / name)
            runtime["working_dir"] = folder
        quiet = {"runtime_env": runtime, "log_to_driver": False, "logging_level": "error"}
        try:
            if job.address != "local":
                ray.init(address=job.address or "auto", **quiet)
                return
        except (ConnectionError, ValueError, RuntimeError) as error:
            if job.address is not None or not isinstance(error, ConnectionError):
                raise InputError(f"the Ray cluster cannot be joined: {' '.join(str(error).split())}") from error
        cpus = max(job.workers or 1, len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1)
        ray.init(address="local", num_cpus=cpus, include_dashboard=False, object_store_memory=OBJECT_STORE, **quiet)


def _check_nodes(job: Job) -> None:
    """Every node that may get work must have the same code, packages and files."""
    import ray
    from ray.exceptions import GetTimeoutError, RayError
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

    packed = pickle.dumps((job.terms, job.wanted))
    task = ray.remote(num_cpus=0, max_retries=0)(_question())
    asked = [
        (
            node,
            task.options(scheduling_strategy=NodeAffinitySchedulingStrategy(node["NodeID"], soft=False)).remote(packed),
        )
        for node in ray.nodes()
        if node["Alive"] and node["Resources"].get("CPU", 0.0) >= 1.0
    ]
    for node, answer in asked:
        host = node["NodeManagerHostname"]
        try:
            refusal = ray.get(answer, timeout=ANSWER_S)
        except GetTimeoutError as error:
            raise InputError(
                f"the node '{host}' of the Ray cluster did not answer within {ANSWER_S:g} s; mend it or take it out."
            ) from error
        except RayError as error:
            if not any(other["Alive"] and other["NodeID"] == node["NodeID"] for other in ray.nodes()):
                continue
            said = " ".join(str(error).split())
            raise InputError(f"the node '{host}' of the Ray cluster cannot work: {said[:500]}") from error
        if refusal is not None:
            raise InputError(refusal)


def _question() -> Callable[[bytes], str | None]:
    """A function that travels as a whole, to nodes that may have no such package."""

    def question(packed: bytes) -> str | None:
        try:
            from apo_bench.benchmark.ray_hand import refusal
        except ImportError as error:
            import platform
            import sys

            return (
                f"the node '{platform.node()}' cannot import this version of apo_bench ({error}); "
                f"install it for {sys.executable}, which Ray runs there."
            )
        return refusal(packed)

    return question


def _work(pipe: Any, job: Job) -> None:
    import ray

    from apo_bench.benchmark.ray_hand import Hand

    kind = ray.remote(num_cpus=1, max_restarts=0, max_task_retries=0, max_concurrency=4)(Hand)
    crew = Crew(job.work, job.terms, lambda number: kind.remote(number, job.terms), lambda: _size(job), job.limit_s)

    def emit(row: dict[str, Any], timing: dict[str, Any]) -> None:
        pipe.send(("row", row, timing))

    deadline = float("inf")
    while crew.busy and time.monotonic() < deadline:
        crew.turn(emit)
        if pipe.poll():
            pipe.recv()
            crew.stop()
            deadline = time.monotonic() + GRACE_S
    crew.end()


def _size(job: Job) -> int:
    import ray

    cpus = sum(int(node["Resources"].get("CPU", 0.0)) for node in ray.nodes() if node["Alive"])
    return max(1, cpus if job.workers is None else min(cpus, job.workers))
