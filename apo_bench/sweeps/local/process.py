"""A process on this machine that works for this one: how it is started, what it does first, how it is ended.

It has a pipe of its own, so that no other can take its messages along by dying; a session of its own, so that Ctrl-C is
for the one who started it, who tells it; and it ends when that one does.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from typing import Any

from apo_bench.io.processes import end_descendants
from apo_bench.sweeps.stopping import SIGNALS

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def start(target: Callable[..., None], *given: Any) -> tuple[Any, Any]:
    """A process that calls `target(*given, pipe)`, and our end of its pipe."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=target, args=(*given, theirs))
    resource_tracker.ensure_running()
    with _one_thread_each(), _undisturbed():
        process.start()
    theirs.close()
    return process, ours


def enter() -> None:
    """What such a process does first."""
    if hasattr(os, "setsid"):
        os.setsid()
    for one in SIGNALS:
        signal.signal(one, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def speaker(pipe: Any) -> Callable[..., None]:
    """What sends its arguments as one message; code that forked and came back from both has one say."""
    own = os.getpid()

    def say(*news: Any) -> None:
        if os.getpid() != own:
            os._exit(1)
        pipe.send(news)

    return say


def kill(process: Any) -> None:
    """End a process with all that it started, and its session if it has one of its own by now."""
    end_descendants(process.pid)
    with suppress(OSError, AttributeError):
        if os.getpgid(process.pid) == process.pid:
            os.killpg(process.pid, signal.SIGKILL)
    process.kill()


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
