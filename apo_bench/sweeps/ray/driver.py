"""The process between a sweep and a Ray cluster.

Ray writes what it likes to the terminal, handles signals its own way, and ends the process when the cluster is lost; so
it has a process of its own. What is worth saying goes through a pipe to the sweep, which alone writes rows.
"""

from __future__ import annotations

import os
import shutil
import signal
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import parent_process
from pathlib import Path
from typing import Any, final

from apo_bench.errors import InputError
from apo_bench.sweeps.grid import Unit
from apo_bench.sweeps.ray.pool import Crew
from apo_bench.sweeps.stopping import SIGNALS

GRACE_S = 5.0
"""After a stop: what trials under way get to end."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
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
    packed: bytes
    """The pickled `EnvironmentLock` and `Wanted`, for the workers."""
    files: Mapping[str, Path]
    """From `parcel`."""
    address: str | None
    workers: int | None
    """At most so many; None for as many as the cluster has CPUs."""
    limit_s: float
    token: bool = False
    """Show the token of this machine's user, as Ray does by itself only where no address is named."""


def drive(pipe: Any, job: Job, log: str) -> None:
    """The life of the process: connect, spread the work, say one last word.

    Sends ("starting",) if it starts a cluster, ("connected",), what a `Crew` tells, and last ("done",), ("refused",
    sentence) or ("failed", text); ends early when it is sent anything, or when the sweep is gone.
    """
    _live_apart(log)
    if job.token:
        os.environ["RAY_AUTH_MODE"] = "token"
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
    """Rows of a process whose parent was killed would be written by nobody; Ray ends its workers when it is gone.

    Where Ray answers, the pipe has said so by now, and all has ended in order.
    """
    parent = parent_process()
    if parent is not None:
        parent.join()
        time.sleep(2 * GRACE_S)
        os._exit(1)


def _last_word(pipe: Any, job: Job) -> tuple[str, ...]:
    import ray

    try:
        _connect(pipe, job)
        pipe.send(("connected",))
        _work(pipe, job)
    except InputError as error:
        return ("refused", str(error))
    except Exception as error:
        return ("failed", f"{type(error).__name__}: {error}" if str(error) else type(error).__name__)
    finally:
        with suppress(Exception):
            ray.shutdown()
    return ("done",)


def _connect(pipe: Any, job: Job) -> None:
    """Join the cluster that was named, or the one that runs here, or start one for the time of the sweep."""
    import ray
    from ray.exceptions import RayError

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
        except (ConnectionError, ValueError, RuntimeError, RayError) as error:
            if job.address is not None or not isinstance(error, ConnectionError):
                raise InputError(f"the Ray cluster cannot be joined: {' '.join(str(error).split())}") from error
        cpus = max(job.workers or 1, len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1)
        pipe.send(("starting",))
        ray.init(address="local", num_cpus=cpus, include_dashboard=False, object_store_memory=OBJECT_STORE, **quiet)


def _work(pipe: Any, job: Job) -> None:
    import ray

    kind = ray.remote(num_cpus=1, max_restarts=0, max_task_retries=0, max_concurrency=4)(_hand())
    crew = Crew(job.work, lambda number: kind.remote(number, job.packed), lambda: _size(job), job.limit_s)
    deadline = float("inf")
    while crew.busy and time.monotonic() < deadline:
        crew.turn(pipe.send)
        if pipe.poll():
            pipe.recv()
            crew.stop()
            deadline = time.monotonic() + GRACE_S
    crew.end()


def _hand() -> type:
    """The actor. It is made here, so that it travels as a whole, to nodes that may have no such package."""

    class Hand:
        def __init__(self, number: int, packed: bytes) -> None:
            import platform
            import sys

            self.host = platform.node()
            try:
                from apo_bench.sweeps.ray import actor as ray_hand
            except ImportError as error:
                self.refusal: str | None = (
                    f"the node '{self.host}' cannot import this version of apo_bench ({error}); "
                    f"install it for {sys.executable}, which Ray runs there."
                )
            else:
                self.refusal = ray_hand.refusal(packed)
                if self.refusal is None:
                    self.hand = ray_hand.Hand(number, packed, self._node())

        def _node(self) -> Any:
            import ray

            return ray.get_runtime_context().get_node_id()

        def where(self) -> tuple[Any, ...]:
            return self._node(), self.host, self.refusal

        def take(self, unit: Any) -> None:
            self.hand.take(unit)

        def stop(self) -> None:
            self.hand.stop()

        def news(self, heard: int, wait_s: float) -> Any:
            return self.hand.news(heard, wait_s)

    return Hand


def _size(job: Job) -> int:
    import ray

    cpus = sum(int(node["Resources"].get("CPU", 0.0)) for node in ray.nodes() if node["Alive"])
    return max(1, cpus if job.workers is None else min(cpus, job.workers))
