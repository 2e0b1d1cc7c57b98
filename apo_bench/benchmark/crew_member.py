"""One worker process on this machine, as the process that started it sees it, and as it sees itself.

It has a pipe of its own, so that no other can take its messages along by dying; a session of its own, so that Ctrl-C is
for the sweep, which tells it; and it ends when the process that started it does.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from typing import Any, final

from apo_bench.benchmark.grid import Unit
from apo_bench.benchmark.stopping import SIGNALS
from apo_bench.benchmark.terms import Terms
from apo_bench.benchmark.worker import Emit, Worker
from apo_bench.errors import InputError
from apo_bench.processes import end_descendants

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
STARTING_S = 300.0
"""What a process gets to be ready, and to compile a scene."""
GOING_S = 2.0
"""What a process without work gets to end by itself."""


@final
class Member:
    """A process, and what it is doing."""

    def __init__(self, number: int, terms: Terms) -> None:
        self.number = number
        self.terms = terms
        self.unit: Unit | None = None
        self.done = 0
        """How many trials of its unit have a row."""
        self.since: float | None = None
        """When the trial under way began; None where none is."""
        self.heard = 0.0
        """When it last said something, or was given work."""
        self.false_starts = 0
        """How often in a row it ended before a trial had begun."""
        self.process: Any = None
        self.pipe: Any = None

    def give(self, unit: Unit) -> None:
        """Have it do a unit of work; it is started where it is not running."""
        if self.process is None:
            self._start()
        self.unit, self.done, self.since, self.heard = unit, 0, None, time.monotonic()
        with suppress(OSError):
            self.pipe.send(unit)

    def hear(self, emit: Emit) -> bool:
        """Take the next message; False if there is none, or never will be."""
        try:
            if not self.pipe.poll():
                return False
            kind, *news = self.pipe.recv()
        except (EOFError, OSError):
            return False
        self.heard = time.monotonic()
        if kind == "began":
            self.since = self.heard
        elif kind == "row":
            self.done, self.since, self.false_starts = self.done + 1, None, 0
            emit(*news)
        elif kind == "done":
            self.unit = None
        elif kind == "refused":
            raise InputError(news[0])
        else:
            raise RuntimeError(f"a trial could not be run:\n{news[0]}")
        return True

    def stop(self) -> None:
        """Ask it to begin no other trial."""
        with suppress(OSError):
            self.pipe.send(None)

    def overdue(self, limit_s: float) -> bool:
        """Whether its time is up."""
        now = time.monotonic()
        return now - self.since > limit_s if self.since is not None else now - self.heard > STARTING_S

    def end(self) -> None:
        """Send it home; by force, with all that it started, if it is at work or does not go."""
        if self.process is None:
            return
        self.stop()
        self.process.join(0.0 if self.unit else GOING_S)
        if self.process.is_alive():
            _kill(self.process)
        self.process.join()
        self.process.close()
        self.pipe.close()
        self.process = self.pipe = self.unit = None

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_work, args=(self.number, self.terms, theirs))
        resource_tracker.ensure_running()
        with _one_thread_each(), _undisturbed():
            self.process.start()
        theirs.close()


def _kill(process: Any) -> None:
    """End a process with all that it started, and its session if it has one of its own by now."""
    end_descendants(process.pid)
    with suppress(OSError, AttributeError):
        if os.getpgid(process.pid) == process.pid:
            os.killpg(process.pid, signal.SIGKILL)
    process.kill()


def _work(number: int, terms: Terms, pipe: Any) -> None:
    """The life of a worker process."""
    if hasattr(os, "setsid"):
        os.setsid()
    for one in SIGNALS:
        signal.signal(one, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with suppress(EOFError, OSError):
        pipe.send(_last_word(number, terms, pipe))


def _last_word(number: int, terms: Terms, pipe: Any) -> tuple[str, ...]:
    """Do unit after unit, and say why there is no next."""
    own = os.getpid()

    def say(*news: Any) -> None:
        if os.getpid() != own:
            os._exit(1)  # a noise model forked and came back from both: only one of them has a say
        pipe.send(news)

    worker = None
    try:
        worker = Worker(number, terms)
        while (unit := pipe.recv()) is not None:
            worker.run(
                unit,
                lambda row, timing: say("row", row, timing),
                stopped=lambda: bool(pipe.poll()),
                began=lambda spec: say("began"),
            )
            say("done")
    except InputError as error:
        return ("refused", str(error))
    except Exception:
        return ("failed", traceback.format_exc())
    except KeyboardInterrupt:
        os._exit(1)  # signals are ignored here: it is a noise model's own, and ends its process as `sys.exit` does
    finally:
        if worker is not None:
            worker.close()
    return ("done",)


def _end_with_parent() -> None:
    """Rows of a process whose parent was killed would be written by nobody."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    parent.join()
    if hasattr(os, "killpg"):
        os.killpg(0, signal.SIGKILL)
    os._exit(1)


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Signals wait meanwhile; a process that is started here is deaf to them until it can ignore them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Children inherit one thread per linear algebra library: the processes already fill the cores."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
