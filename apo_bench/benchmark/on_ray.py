"""The work of a sweep on a Ray cluster, as the sweep sees it; Ray itself stays in another process (`ray_driver`)."""

from __future__ import annotations

import importlib.util
import multiprocessing
import os
import re
import socket
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from apo_bench.benchmark.grid import Unit
from apo_bench.benchmark.parcel import parcel, wanted
from apo_bench.benchmark.ray_driver import GRACE_S, Job, drive
from apo_bench.benchmark.stopping import Check, never
from apo_bench.benchmark.terms import Terms
from apo_bench.benchmark.worker import Emit
from apo_bench.errors import InputError

TURN_S = 0.2
JOINING_S = 30.0
"""What a cluster gets to answer."""
STARTING_S = 120.0
"""What a cluster on this machine gets to start."""
TOUCH_S = 5.0


def check_ray(address: str | None) -> None:
    """Raise an `InputError` unless Ray is installed, and something listens at the address.

    Args:
        address: `HOST:PORT` of the head of a cluster, `auto` for the one that runs on this machine, `local` for one of
            one's own; None for `auto` if there is one, else `local`.
    """
    if importlib.util.find_spec("ray") is None:
        raise InputError("the backend 'ray' needs a package that is not installed; pip install 'apo_bench[ray]'.")
    named = os.environ.get("RAY_ADDRESS", "") if address in (None, "auto") else address or ""
    if named in ("", "auto", "local"):
        return
    found = re.fullmatch(r"\[?([^\[\]/]+)\]?:(\d{1,5})", named)
    if found is None or not 0 < int(found[2]) < 2**16:
        raise InputError(
            f"the address '{named}' of a Ray cluster was given; HOST:PORT of its head is allowed, such as "
            "10.0.0.5:6379, or auto, or local."
        )
    try:
        socket.create_connection((found[1], int(found[2])), timeout=TOUCH_S).close()
    except (OSError, UnicodeError) as error:
        raise InputError(
            f"no Ray cluster answers at {named} ({error}); start one there with: ray start --head --port={found[2]}"
        ) from error


def spread(
    work: Sequence[Unit],
    terms: Terms,
    *,
    workers: int | None,
    limit_s: float,
    emit: Emit,
    check: Check = never,
    address: str | None = None,
) -> None:
    """Run all units on a Ray cluster and emit one row per trial, in the order in which trials end.

    Args:
        workers: At most so many at a time; None for as many as the cluster has CPUs.
        limit_s: A trial that takes longer has a failed row.
        check: Asked now and then; when it raises `Stopped`, the trials under way get a moment to end.
        address: As in `check_ray`.

    Raises:
        InputError: No such cluster, or one whose nodes cannot work as this machine does.
        RuntimeError: A trial could not be run at all, or the cluster was lost.
        Stopped: Passed on after the rows of the trials that had ended were emitted.
    """
    if not work:
        return
    check_ray(address)
    asked = wanted(work)
    job = Job(tuple(work), terms, asked, parcel(asked), address, workers, limit_s)
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "ray.log"
        process = context.Process(target=drive, args=(there, job, str(log)))
        process.start()
        there.close()
        try:
            _listen(here, process, job, emit, check, log)
        except KeyboardInterrupt:
            _end_cleanly(here, emit)
            raise
        finally:
            here.close()
            process.join(GRACE_S)
            process.kill()
            process.join()


def _listen(pipe: Any, process: Any, job: Job, emit: Emit, check: Check, log: Path) -> None:
    """Take rows until the last word."""
    limit_s = JOINING_S if job.address not in (None, "local") or "RAY_ADDRESS" in os.environ else STARTING_S
    deadline = time.monotonic() + limit_s
    while True:
        check()
        if not pipe.poll(TURN_S):
            if time.monotonic() > deadline:
                process.kill()
                raise InputError(_no_answer(job.address, limit_s))
            continue
        try:
            kind, *said = pipe.recv()
        except (EOFError, OSError) as error:
            raise RuntimeError(
                f"the Ray cluster was lost{_last_line(log)}; finished rows are kept, and the same command continues."
            ) from error
        deadline = float("inf")
        if kind == "row":
            emit(*said)
        elif kind == "done":
            return
        elif kind == "refused":
            raise InputError(said[0])
        elif kind == "failed":
            raise RuntimeError(said[0])


def _end_cleanly(pipe: Any, emit: Emit) -> None:
    """After a stop: no new trials, and the rows of those that end in time."""
    with suppress(EOFError, OSError):
        pipe.send("stop")
        deadline = time.monotonic() + 2 * GRACE_S
        while time.monotonic() < deadline:
            if pipe.poll(TURN_S):
                kind, *said = pipe.recv()
                if kind == "row":
                    emit(*said)
                elif kind != "connected":
                    return


def _no_answer(address: str | None, limit_s: float) -> str:
    at = address or os.environ.get("RAY_ADDRESS") or "this machine"
    return (
        f"no Ray cluster answered at {at} within {limit_s:g} s; look there with: ray status, "
        "or give --address local for one of your own."
    )


def _last_line(log: Path) -> str:
    """What Ray said last, if anything."""
    try:
        lines = [line.strip() for line in log.read_text(errors="replace").splitlines() if line.strip()]
    except OSError:
        return ""
    return f" ({lines[-1][:200]})" if lines else ""
