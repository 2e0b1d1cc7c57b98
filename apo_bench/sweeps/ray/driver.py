"""The process between a sweep and a Ray cluster.

Ray writes what it likes to the terminal, handles signals its own way, and ends the process when the cluster is lost; so
it has a process of its own. What is worth saying goes through a pipe to the sweep, which alone writes rows.
"""

import os
import pickle
import shutil
import site
import sys
import sysconfig
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

from apo_bench.errors import InputError
from apo_bench.observation.noise_file import noise_path
from apo_bench.parts import part_files_of
from apo_bench.scenario import Scenario
from apo_bench.scenario.file import is_named, load_scenario
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.sweeps.local.pool import GRACE_S
from apo_bench.sweeps.local.process import THREADS
from apo_bench.sweeps.ray.pool import DEATHS, FALSE_STARTS_OF_TASKS, RayPool
from apo_bench.sweeps.ray.task import made_task
from apo_bench.sweeps.work.dispatch import Dispatch
from apo_bench.sweeps.work.environment_lock import EnvironmentLock, Message, Names, Unit, last_message
from apo_bench.trial.inputs import own_files

_OBJECT_STORE = 100 * 2**20
"""Bytes, of a cluster that is started here; rows are small."""
_SETTINGS = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",
    "RAY_OVERRIDE_JOB_RUNTIME_ENV": "1",
}
"""Ray tells nobody that it runs, hides no GPU from the renderer, and takes our files instead of those of a job."""
_ONE_TRY = {"num_cpus": 1, "max_retries": 0, "_generator_backpressure_num_objects": 1}
"""Options of tasks; a task goes on when its last message has arrived, so that none is lost with its worker."""


@final
@dataclass(frozen=True)
class ClusterPlan:
    """What the sweep wants of the cluster."""

    work: Sequence[Unit]
    lock: EnvironmentLock
    files: Mapping[str, Path]
    """From `runtime_files`."""
    address: str | None
    workers: int | None
    limit_s: float
    auth: str | None = None
    """What RAY_AUTH_MODE is for Ray: `disabled`, `token` to show that of this machine's user, or None to leave it."""


def drive(plan: ClusterPlan, log: str, say: Callable[..., None], pipe: Any) -> None:
    """The work of the process: connect, spread the work, say one last word.

    Says "starting" if it starts a cluster, "connected", "row" with row and timing, and last "none" where no cluster
    runs, "done", "refused" or "failed"; ends early when it is sent anything, or when the sweep is gone.
    """
    file = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    os.dup2(file, 1)
    os.dup2(file, 2)
    os.environ.update(_SETTINGS | ({} if plan.auth is None else {"RAY_AUTH_MODE": plan.auth}))
    import ray

    last: Message = ("done",)
    try:
        _connect(plan, say)
        say("connected")
        _spread(plan, say, pipe)
    except _NoCluster:
        last = ("none",)
    except InputError as error:
        last = last_message(error)
    except Exception as error:
        last = "failed", f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    with suppress(Exception):
        ray.shutdown()
    say(*last)


class _NoCluster(Exception):
    """None runs on this machine."""


def _connect(plan: ClusterPlan, say: Callable[..., None]) -> None:
    """Join the cluster that was named, or the one that runs here, or start one for the time of the sweep.

    Raises:
        InputError: It cannot be joined.
        _NoCluster: None runs here, and no other was named.
    """
    import ray
    from ray.exceptions import RayError

    with tempfile.TemporaryDirectory() as folder:
        for name, path in plan.files.items():
            (Path(folder) / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, Path(folder) / name)
        if not plan.files:
            (Path(folder) / "no-files").touch()
        rendering = {name: os.environ[name] for name in ("MUJOCO_GL",) if name in os.environ}
        # without a working folder, Ray puts the current one first on the path of its workers
        runtime = {"env_vars": dict.fromkeys(THREADS, "1") | rendering, "working_dir": folder}
        quiet: dict[str, Any] = {"runtime_env": runtime, "log_to_driver": False, "logging_level": "error"}
        try:
            if plan.address != "local":
                ray.init(address=plan.address or "auto", **quiet)
                return
        except (ConnectionError, ValueError, RuntimeError, RayError) as error:
            if plan.address is None and isinstance(error, ConnectionError):
                raise _NoCluster from error
            raise InputError(f"the Ray cluster cannot be joined: {' '.join(str(error).split())}") from error
        cpus = max(plan.workers or 1, len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1)
        say("starting")
        ray.init(address="local", num_cpus=cpus, include_dashboard=False, object_store_memory=_OBJECT_STORE, **quiet)


def _spread(plan: ClusterPlan, say: Callable[..., None], pipe: Any) -> None:
    import ray

    def emit(row: Any, timing: Any) -> None:
        say("row", row, timing)

    task = ray.remote(**_ONE_TRY)(made_task())
    packed = pickle.dumps(plan.lock)
    pool = RayPool(
        Dispatch(plan.work, plan.lock, plan.limit_s, emit, deaths=DEATHS, false_starts=FALSE_STARTS_OF_TASKS),
        lambda unit: task.remote(packed, unit),
        plan.workers,
    )
    deadline = float("inf")
    while pool.is_busy and time.monotonic() < deadline:
        pool.turn()
        if pipe.poll():
            pipe.recv()
            pool.stop()
            deadline = time.monotonic() + GRACE_S


def runtime_files(names: Names) -> dict[str, Path]:
    """The user's files below the current folder: path from there -> file. What lies elsewhere does not travel.

    Scenario files and the files of their parts, noise files, arms, the modules of what is given as `module:name`, and
    every Python module that importing these brought in.
    """
    arm = find_arm(names.arm)
    files = (
        *(Path(name) for name in names.scenarios if not is_named(name)),
        *(file for name in names.scenarios if not is_named(name) for file in _of_parts(load_scenario(name))),
        *(path for name in names.noises if (path := noise_path(name)) is not None),
        *arm.files,
        *(file for name in (*names.noises, *names.relations, *names.methods, names.arm) for file in own_files(name)),
        *(Path(path) for module in list(sys.modules.values()) if (path := getattr(module, "__file__", None))),
    )
    here = Path.cwd()
    own = [Path(path) for path in _installed()]
    below = {}
    for path in files:
        whole = Path(os.path.normpath(here / path))
        if whole.is_relative_to(here) and not any(map(whole.is_relative_to, own)):
            below[whole.relative_to(here).as_posix()] = whole
    return dict(sorted(below.items()))


def _of_parts(scenario: Scenario) -> Iterator[Path]:
    return (file for part in scenario.part_files.values() for file in part_files_of(part))


def _installed() -> set[str]:
    """Where Python, its packages and this one are: every machine has its own."""
    import apo_bench
    from apo_bench.resources import folder

    main = getattr(sys.modules.get("__main__"), "__file__", None)
    return {
        *(path for key, path in sysconfig.get_paths().items() if key != "data"),
        *(*site.getsitepackages(), site.getusersitepackages()),
        *(str(Path(str(apo_bench.__file__)).parent), str(folder("assets")), str(folder("scenarios"))),
        *([] if main is None else [str(Path(main).absolute())]),
    }
