"""The work of a sweep on a Ray cluster, as the sweep sees it; Ray itself stays in another process (`driver`)."""

import importlib.util
import math
import os
import re
import socket
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import final

from apo_bench.errors import InputError, require
from apo_bench.sweeps.local.pool import GOING_S, GRACE_S
from apo_bench.sweeps.local.process import Process
from apo_bench.sweeps.ray.driver import ClusterPlan, drive, runtime_files
from apo_bench.sweeps.work.environment_lock import Check, EnvironmentLock, Unit, never
from apo_bench.sweeps.work.worker import Emit

_TURN_S = 0.2
JOINING_S = 30.0
"""What a cluster gets to answer."""
_STARTING_S = 120.0
"""What a cluster on this machine gets to start."""
_TOUCH_S = 5.0
"""What its port gets to open."""
_NO_TOKEN = "InvalidAuthToken"
"""In what Ray writes when a cluster wants a token."""


def check_ray(address: str | None) -> None:
    """Raise an `InputError` unless Ray is installed, and something listens at the address.

    Args:
        address: `HOST:PORT` of the head of a cluster, `auto` for the one that runs on this machine, `local` for one of
            one's own; None for `auto` if there is one, else `local`.
    """
    require(
        importlib.util.find_spec("ray") is not None,
        "the backend 'ray' needs a package that is not installed; pip install 'apo_bench[ray]'.",
    )
    named = (os.environ.get("RAY_ADDRESS") or "auto") if address in (None, "auto") else str(address)
    if named in ("auto", "local"):
        return
    match = re.fullmatch(r"\[?([^\[\]/]+)\]?:(\d{1,5})", named)
    if match is None or not 0 < int(match[2]) < 2**16:
        raise InputError(
            f"the address '{named}' of a Ray cluster was given; HOST:PORT of its head is allowed, such as "
            "10.0.0.5:6379, or auto, or local."
        )
    try:
        socket.create_connection((match[1], int(match[2])), timeout=_TOUCH_S).close()
    except (OSError, UnicodeError) as error:
        raise InputError(
            f"no Ray cluster answers at {named} ({error}); start one there with: ray start --head --port={match[2]}"
        ) from error


def run_on_ray(
    work: Sequence[Unit],
    lock: EnvironmentLock,
    *,
    workers: int | None,
    limit_s: float,
    emit: Emit,
    check: Check = never,
    address: str | None = None,
) -> None:
    """Run all units on a Ray cluster, as an `Executor` does.

    Args:
        workers: None stands for as many as the cluster takes.
        address: The address of the cluster, as in `check_ray`.

    Raises:
        InputError: No such cluster, or one whose nodes cannot work as this machine does.
        RuntimeError: The cluster was lost, or a trial could not be run at all.
    """
    if not work:
        return
    check_ray(address)
    auth = None if address == "local" or os.environ.get("RAY_AUTH_MODE") == "disabled" else "disabled"
    plan = ClusterPlan(
        tuple(work), lock, {} if lock.names is None else runtime_files(lock.names), address, workers, limit_s, auth
    )
    while True:
        try:
            _drive(plan, emit, check)
            return
        except _OtherWay as error:
            (plan,) = error.args


@final
class _OtherWay(Exception):
    """The cluster wants a token, or there is none: to be tried once more.

    Ray tells neither in advance, and one process can try one way: a driver that shows a token to a cluster that wants
    none never hears of its tasks. It has the plan of that as its argument.
    """


@final
class _Joining:
    """Watches a process that may wait for a cluster for ever, and for one that does not let it in."""

    def __init__(self, plan: ClusterPlan, log: Path) -> None:
        self._plan = plan
        self._log = log
        self.give(JOINING_S)

    def give(self, seconds: float) -> None:
        """So much time from now on."""
        self._seconds = seconds
        self._deadline = time.monotonic() + seconds

    def look(self) -> None:
        """Raise an `InputError` if there is no hope, or what else to try."""
        if math.isinf(self._seconds):
            return
        if _NO_TOKEN in self._text():
            if self._plan.auth == "disabled":
                raise _OtherWay(replace(self._plan, auth="token"))
            raise InputError(
                "the Ray cluster wants another token; have the ~/.ray/auth_token of its head here, and "
                "RAY_AUTH_MODE=token or unset."
            )
        if time.monotonic() > self._deadline:
            named = self._plan.address or os.environ.get("RAY_ADDRESS")
            where = f"at {named}" if named else "where one last ran on this machine (ray stop forgets it)"
            raise InputError(
                f"no Ray cluster answered {where} within {self._seconds:g} s; look there with: ray status, or give "
                "--address local for one of your own."
            )

    def last_line(self) -> str:
        """What Ray said last, if anything."""
        lines = [line.strip() for line in self._text().splitlines() if line.strip()]
        text = re.sub(r"^\[[^\]]*\] \S+: ", "", lines[-1]).rstrip(".") if lines else ""
        return f" ({text[:200]})" if text else ""

    def _text(self) -> str:
        return self._log.read_text(errors="replace") if self._log.is_file() else ""


def _drive(plan: ClusterPlan, emit: Emit, check: Check) -> None:
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "ray.log"
        driver = Process(drive, plan, str(log))
        patience_s = 0.0
        try:
            _listen(driver, plan, _Joining(plan, log), emit, check)
            patience_s = GOING_S
        except KeyboardInterrupt:
            _end_cleanly(driver, emit)
            raise
        finally:
            driver.end(patience_s)


def _listen(driver: Process, plan: ClusterPlan, joining: _Joining, emit: Emit, check: Check) -> None:
    """Take rows until the last word."""
    while True:
        is_alive = driver.exit_code is None
        kind, *content = driver.wait(check, _TURN_S) or (None,)
        if kind == "row":
            emit(*content)
        elif kind == "starting":
            joining.give(_STARTING_S)
        elif kind == "connected":
            joining.give(math.inf)
        elif kind == "none":
            raise _OtherWay(replace(plan, address="local", auth=None))
        elif kind == "done":
            return
        elif is_alive:
            joining.look()
        else:
            raise RuntimeError(
                f"the Ray cluster was lost{joining.last_line()}; finished rows are kept, and the same command goes on."
            )


def _end_cleanly(driver: Process, emit: Emit) -> None:
    """After a stop: no new trials, and the rows of those that end in time."""
    driver.send(None)
    deadline = time.monotonic() + 2 * GRACE_S
    with suppress(InputError, RuntimeError):
        while message := driver.wait(never, deadline - time.monotonic()):
            if message[0] == "row":
                emit(*message[1:])
            elif message[0] == "done":
                return
