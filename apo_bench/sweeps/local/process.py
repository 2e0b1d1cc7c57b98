"""A process on this machine that works for this one: how it is started, what it does first, how it is ended.

It has a pipe of its own, so that no other can take its messages along by dying; a session of its own, so that Ctrl-C is
for the one who started it, who tells it; and it ends when that one does. `pebble.ProcessPool` keeps none of this: what
a task has started outlives its limit, a worker outlives a parent that is killed, and the exit code of a worker that
dies before its first task is not said. Nor does `concurrent.futures`, where one death breaks the pool.
"""

import math
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import connection, resource_tracker
from typing import Any, final

from apo_bench.io import SAFE_PATH, end_descendants, environment
from apo_bench.names import folder_of_own_modules, own_modules_in
from apo_bench.sweeps.work.environment_lock import SIGNALS, Check, Message, checked, last_message

_TURN_S = 0.1
"""How often the clock and the signals are looked at while nothing else happens."""
_CLOSING_S = 0.25
"""Between the end of its pipe and that of a process."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Children inherit one thread per linear algebra library: the processes already fill the cores."""


@final
class Process:
    """A process that works for this one, as this one sees it."""

    def __init__(self, work: Callable[..., None], *arguments: Any) -> None:
        """Start it.

        Args:
            work: What it calls: `work(*arguments, say, pipe)`. `say` sends what it is given as one message, and what is
                sent to the process comes out of `pipe`.
        """
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        surroundings = (folder_of_own_modules(), os.environ.get(SAFE_PATH))
        self._process = context.Process(target=_live, args=(work, arguments, theirs, *surroundings))
        self._is_open = True
        with environment(dict.fromkeys((*THREADS, SAFE_PATH), "1")):
            resource_tracker.ensure_running()
            with _undisturbed():
                self._process.start()
        theirs.close()

    @property
    def signs(self) -> list[Any]:
        """What `connection.wait` waits for: a message, or the end of the process."""
        return [self._pipe, self._process.sentinel] if self._is_open else [self._process.sentinel]

    @property
    def exit_code(self) -> int | None:
        """None while it is alive."""
        return self._process.exitcode

    def send(self, what: Any) -> None:
        """Send it something; None asks it to end."""
        with suppress(OSError):
            self._pipe.send(what)

    def receive(self) -> Message | None:
        """The next message; None if there is none, or never will be."""
        try:
            return self._pipe.recv() if self._is_open and self._pipe.poll() else None
        except (EOFError, OSError):
            self._is_open = False
            self._process.join(_CLOSING_S)
            return None

    def wait(self, check: Check, seconds: float = math.inf) -> Message | None:
        """The next message; None if there is none in that time, or never will be.

        Raises:
            InputError, RuntimeError: As `checked`.
        """
        deadline = time.monotonic() + seconds
        while True:
            check()
            is_alive = self.exit_code is None
            message = self.receive()
            if message is not None:
                return checked(message)
            if not (is_alive and self._is_open) or time.monotonic() >= deadline:
                return None
            connection.wait(self.signs, _TURN_S)

    def end(self, patience_s: float = 0.0) -> None:
        """Ask it to end; by force, with all that it started, if it does not in that time."""
        self.send(None)
        self._process.join(patience_s)
        pid = self._process.pid
        if self.exit_code is None and pid is not None:
            end_descendants(pid)
            with suppress(OSError, AttributeError):
                if os.getpgid(pid) == pid:
                    os.killpg(pid, signal.SIGKILL)
            self._process.kill()
        self._process.join()
        self._process.close()
        self._pipe.close()


def _live(work: Callable[..., None], arguments: tuple[Any, ...], pipe: Any, folder: str, safe: str | None) -> None:
    """The life of the process: its work, and why that ends if it does too early.

    Args:
        folder: Of modules that are named as `module:name`.
        safe: PYTHONSAFEPATH of the one that starts it, for what it starts in turn.
    """
    del os.environ[SAFE_PATH]
    if safe is not None:
        os.environ[SAFE_PATH] = safe
    if hasattr(os, "setsid"):
        os.setsid()
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    own = os.getpid()

    def say(*message: Any) -> None:
        if os.getpid() != own:
            os._exit(1)  # code that forked and came back from both is heard once
        pipe.send(message)

    with suppress(OSError), own_modules_in(folder):
        try:
            work(*arguments, say, pipe)
        except Exception as error:
            say(*last_message(error))
        except KeyboardInterrupt:
            os._exit(1)  # signals are ignored here: it is a noise model's own, and ends its process as `sys.exit` does


def _end_with_parent() -> None:
    """Rows of a process whose parent was killed would be written by nobody."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    parent.join()
    end_descendants(os.getpid())
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
