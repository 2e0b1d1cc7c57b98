"""Run the batches of a sweep on a Ray cluster.

Only the process that started the sweep writes records. Ray runs the batches of a lost node again on another one.
"""

import importlib.util
import os
import shutil
import signal
import socket
import tempfile
import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

from pebble import ProcessPool

from apo_bench.benchmark.sweeps.grid import Batch
from apo_bench.benchmark.sweeps.pool import THREADS, Emit, make_process_pool, run_in_pool
from apo_bench.benchmark.sweeps.worker import Ended, SweepInputs
from apo_bench.errors import InputError, require
from apo_bench.io import set_environment

_TOUCH_S = 5.0
"""Time limit to connect to the port of a cluster."""
_AHEAD = 2
"""Number of tasks per CPU that are submitted: one runs, the others wait."""
_TASK_S = 4.0
"""Seconds that a task lasts: long against what Ray takes to hand out a task, short against an interruption."""
_OBJECT_STORE = 100 * 2**20
"""Size in bytes of the object store of a cluster that is started here; records are small."""
_SETTINGS = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",
    "RAY_OVERRIDE_JOB_RUNTIME_ENV": "1",
}
"""Ray sends no usage statistics, hides no GPU from the renderer, and uses our files instead of those of a job."""

_POOLS = ExitStack()
"""In a worker process of Ray: its pool of one process, which ends with it."""


def check_ray(address: str | None) -> None:
    """Raise an `InputError` unless Ray is installed, and a server listens at the address.

    Args:
        address: `HOST:PORT` of the head of a cluster; `auto` for the one on this machine; `local` to start one for the
            sweep. None means `auto` if there is one, else `local`.
    """
    require(
        importlib.util.find_spec("ray") is not None,
        "the backend 'ray' needs a package that is not installed; pip install 'apo_bench[ray]'.",
    )
    named = (os.environ.get("RAY_ADDRESS") or "auto") if address in (None, "auto") else str(address)
    if named in ("auto", "local"):
        return
    host, _, port = named.rpartition(":")
    require(
        host and "/" not in host and port.isdecimal() and 0 < int(port) < 2**16,
        f"the address '{named}' of a Ray cluster was given; HOST:PORT of its head is allowed, such as 10.0.0.5:6379, "
        "or auto, or local.",
    )
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=_TOUCH_S).close()
    except (OSError, UnicodeError) as error:
        raise InputError(
            f"no Ray cluster answers at {named} ({error}); start one there with: ray start --head --port={port}"
        ) from error


def run_on_cluster(
    batches: Sequence[Batch],
    inputs: SweepInputs,
    workers: int | None,
    limit_s: float,
    emit: Emit,
    address: str | None,
    files: Mapping[str, Path],
) -> None:
    """Run all batches on a Ray cluster.

    Args:
        workers: Largest number of tasks at a time; None for as many as the cluster takes.
        limit_s: Wall time limit of a trial.
        emit: Called with each record and its timing.
        address: As in `check_ray`.
        files: Files that every node needs: path relative to its current folder -> file here.

    Raises:
        InputError: There is no such cluster, or its nodes cannot run the same trials as this machine.
        RuntimeError: The cluster was lost, or a trial could not be run.
    """
    import ray
    from ray.exceptions import RayError, RayTaskError

    _join_cluster(address, workers, files)
    task = ray.remote(num_cpus=1)(run_on_node)
    at_once = workers or _AHEAD * int(ray.cluster_resources().get("CPU", 1))
    inputs_there = ray.put(inputs)
    waiting = deque(batches)
    running: dict[Any, int] = {}  # task -> number of its batches
    many = 1
    try:
        while waiting or running:
            while waiting and len(running) < at_once:
                share = [waiting.popleft() for _ in range(count_batches(many, len(waiting), at_once))]
                running[task.remote(share, inputs_there, limit_s)] = len(share)
            (done,), _ = ray.wait(list(running))
            ended, took_s = ray.get(done)
            many = max(1, int(_TASK_S * running.pop(done) / took_s))
            for each in ended:
                emit(*each)
    except RayTaskError as error:
        kind = InputError if isinstance(error.cause, InputError) else RuntimeError  # the exception of the task itself
        raise kind(str(error.cause)) from error
    except RayError as error:
        raise RuntimeError(
            f"the Ray cluster was lost ({' '.join(str(error).split())[:200]}); finished records are kept, and the same "
            "command goes on."
        ) from error
    finally:
        ray.shutdown()


def count_batches(many: int, waiting: int, at_once: int) -> int:
    """Return the number of batches of the next task: `many`, or fewer towards the end, so that no node waits long."""
    return max(1, min(many, waiting // at_once))


def run_on_node(batches: Sequence[Batch], inputs: SweepInputs, limit_s: float) -> tuple[list[Ended], float]:
    """Run batches in a child process of a node, so that a crash does not end the worker process of Ray.

    Returns:
        Records and timings, and the seconds that the batches took.
    """
    import ray

    node = {"node": ray.get_runtime_context().get_node_id()}
    ended: list[Ended] = []
    start = time.perf_counter()
    run_in_pool(_get_node_pool(), batches, inputs, 1, limit_s, lambda record, wall: ended.append((record, wall | node)))
    return ended, time.perf_counter() - start


@lru_cache(maxsize=1)
def _get_node_pool() -> ProcessPool:
    """Return the pool of one process that serves a CPU of a node; Ray reuses its worker processes for later tasks."""
    return _POOLS.enter_context(make_process_pool(1))


def _join_cluster(address: str | None, workers: int | None, files: Mapping[str, Path]) -> None:
    """Join the named cluster, or the one on this machine, or one that is started for the duration of the sweep.

    Raises:
        InputError: The cluster cannot be joined.
    """
    import ray
    from ray.exceptions import RayError

    handler = signal.getsignal(signal.SIGTERM)  # restored below
    # settings of a cluster of our own
    alone = {"num_cpus": max(workers or 1, os.cpu_count() or 1), "object_store_memory": _OBJECT_STORE}
    with tempfile.TemporaryDirectory() as folder, set_environment(_SETTINGS):
        for name, path in files.items():
            (Path(folder) / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, Path(folder) / name)
        # Ray ignores an empty working folder and takes the current one
        (Path(folder) / "made-for-a-sweep").touch()
        rendering = {name: os.environ[name] for name in ("MUJOCO_GL",) if name in os.environ}
        runtime = {"env_vars": dict.fromkeys(THREADS, "1") | rendering, "working_dir": folder}
        quiet: dict[str, Any] = {"runtime_env": runtime, "log_to_driver": False, "logging_level": "error"}
        try:
            ray.init(address=address or "auto", **quiet, **(alone if address == "local" else {}))
        except (ConnectionError, ValueError, RuntimeError, RayError) as error:
            # a missing cluster is no error if none was named
            if address is not None or not isinstance(error, ConnectionError):
                raise InputError(f"the Ray cluster cannot be joined: {' '.join(str(error).split())}") from error
            ray.init(address="local", include_dashboard=False, **quiet, **alone)
    with suppress(ValueError):
        signal.signal(signal.SIGTERM, handler)  # Ray replaces it in the main thread
