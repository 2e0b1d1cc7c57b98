"""The work of a sweep on a Ray cluster, as the sweep sees it; Ray itself stays in another process (`ray_driver`)."""

from __future__ import annotations

import importlib.util
import math
import multiprocessing
import os
import pickle
import re
import socket
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, final

from apo_bench.errors import InputError
from apo_bench.sweeps.environment_lock import EnvironmentLock
from apo_bench.sweeps.grid import Unit
from apo_bench.sweeps.ray.driver import GRACE_S, Job, drive
from apo_bench.sweeps.ray.runtime_files import parcel, wanted
from apo_bench.sweeps.stopping import Check, never
from apo_bench.sweeps.worker import Emit, lost, timing

Take = Callable[[tuple[Any, ...]], bool]

TURN_S = 0.2
JOINING_S = 30.0
"""What a cluster gets to answer."""
STARTING_S = 120.0
"""What a cluster on this machine gets to start."""
TOUCH_S = 5.0
"""What its port gets to open."""
NO_TOKEN = "InvalidAuthToken"
"""In what Ray writes when a cluster wants a token."""


def check_ray(address: str | None) -> None:
    """Raise an `InputError` unless Ray is installed, and something listens at the address.

    Args:
        address: `HOST:PORT` of the head of a cluster, `auto` for the one that runs on this machine, `local` for one of
            one's own; None for `auto` if there is one, else `local`.
    """
    if importlib.util.find_spec("ray") is None:
        raise InputError("the backend 'ray' needs a package that is not installed; pip install 'apo_bench[ray]'.")
    named = (os.environ.get("RAY_ADDRESS") or "auto") if address in (None, "auto") else str(address)
    if named in ("auto", "local"):
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
    lock: EnvironmentLock,
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
    job = Job(tuple(work), pickle.dumps((lock, asked)), parcel(asked), address, workers, limit_s)

    def take(news: tuple[Any, ...]) -> bool:
        """Emit what is a row, or what stands for one; False for anything else."""
        kind, *said = news
        if kind == "row":
            emit(*said)
        elif kind == "lost":
            spec, code, number, seconds, place = said
            row = lost(spec, lock.content[spec.scenario], code)
            emit(row, timing(row, number, None, None, seconds) | place)
        return kind in ("row", "lost")

    try:
        _drive(job, take, check)
    except _TokenWanted:
        _drive(replace(job, token=True), take, check)


class _TokenWanted(Exception):
    """The cluster does not let anybody in."""


def _drive(job: Job, take: Take, check: Check) -> None:
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "ray.log"
        process = context.Process(target=drive, args=(there, job, str(log)))
        process.start()
        there.close()
        try:
            _listen(here, _Joining(process, job, log), take, check)
        except KeyboardInterrupt:
            _end_cleanly(here, take)
            raise
        finally:
            here.close()
            process.join(GRACE_S)
            process.kill()
            process.join()


def _listen(pipe: Any, joining: _Joining, take: Take, check: Check) -> None:
    """Take rows until the last word."""
    while True:
        check()
        if not pipe.poll(TURN_S):
            joining.look()
            continue
        try:
            news = pipe.recv()
        except (EOFError, OSError) as error:
            raise RuntimeError(
                f"the Ray cluster was lost{joining.last_line()}; finished rows are kept, and the same command goes on."
            ) from error
        if news[0] == "starting":
            joining.give(STARTING_S)
        elif news[0] == "connected":
            joining.give(math.inf)
        elif news[0] == "refused":
            raise InputError(news[1])
        elif news[0] == "failed":
            raise RuntimeError(news[1])
        elif not take(news):
            return


@final
class _Joining:
    """Watches a process that may wait for a cluster for ever, and for one that does not let it in."""

    def __init__(self, process: Any, job: Job, log: Path) -> None:
        self._process, self._job, self._log = process, job, log
        self._named = job.address or os.environ.get("RAY_ADDRESS")
        self.give(JOINING_S)

    def give(self, seconds: float) -> None:
        """So much time from now on."""
        self._seconds, self._deadline = seconds, time.monotonic() + seconds

    def look(self) -> None:
        """Raise an `InputError` if there is no hope, after ending the process."""
        if math.isinf(self._seconds):
            return
        if NO_TOKEN in self._text():
            self._process.kill()
            if not self._job.token and "RAY_AUTH_MODE" not in os.environ:
                raise _TokenWanted
            raise InputError(
                "the Ray cluster wants another token; have the ~/.ray/auth_token of its head here, and "
                "RAY_AUTH_MODE=token or unset."
            )
        if time.monotonic() > self._deadline:
            self._process.kill()
            where = f"at {self._named}" if self._named else "where one last ran on this machine (ray stop forgets it)"
            raise InputError(
                f"no Ray cluster answered {where} within {self._seconds:g} s; look there with: ray status, or give "
                "--address local for one of your own."
            )

    def last_line(self) -> str:
        """What Ray said last, if anything."""
        lines = [line.strip() for line in self._text().splitlines() if line.strip()]
        said = re.sub(r"^\[[^\]]*\] \S+: ", "", lines[-1]).rstrip(".") if lines else ""
        return f" ({said[:200]})" if said else ""

    def _text(self) -> str:
        try:
            return self._log.read_text(errors="replace")
        except OSError:
            return ""


def _end_cleanly(pipe: Any, take: Take) -> None:
    """After a stop: no new trials, and the rows of those that end in time."""
    with suppress(EOFError, OSError):
        pipe.send("stop")
        deadline = time.monotonic() + 2 * GRACE_S
        while time.monotonic() < deadline:
            if pipe.poll(TURN_S):
                news = pipe.recv()
                if not take(news) and news[0] != "connected":
                    return
