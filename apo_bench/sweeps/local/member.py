"""One worker process on this machine, as the process that started it sees it, and as it sees itself."""

from __future__ import annotations

import os
import time
import traceback
from contextlib import suppress
from typing import Any, final

from apo_bench.errors import InputError
from apo_bench.sweeps.environment_lock import EnvironmentLock
from apo_bench.sweeps.grid import Unit
from apo_bench.sweeps.local.process import enter, kill, speaker, start
from apo_bench.sweeps.worker import Emit, Worker

STARTING_S = 300.0
"""What a process gets to be ready, and to compile a scene."""
GOING_S = 2.0
"""What a process without work gets to end by itself."""


@final
class Member:
    """A process, and what it is doing."""

    def __init__(self, number: int, lock: EnvironmentLock) -> None:
        self.number = number
        self.lock = lock
        self.unit: Unit | None = None
        self.done = 0
        """How many trials of its unit have a row."""
        self.since: float | None = None
        """When the trial under way began; None where none is."""
        self.heard = 0.0
        """When it last said something, or was given work."""
        self.has_begun = False
        """Whether it has ever begun a trial."""
        self.false_starts = 0
        """How often in a row it ended before a trial had begun."""
        self.process: Any = None
        self.pipe: Any = None

    def give(self, unit: Unit) -> None:
        """Have it do a unit of work; it is started where it is not running."""
        if self.process is None:
            self.process, self.pipe = start(_work, self.number, self.lock)
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
            self.since, self.has_begun = self.heard, True
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
            kill(self.process)
        self.process.join()
        self.process.close()
        self.pipe.close()
        self.process = self.pipe = self.unit = None


def _work(number: int, lock: EnvironmentLock, pipe: Any) -> None:
    """The life of a worker process."""
    enter()
    with suppress(EOFError, OSError):
        pipe.send(_last_word(number, lock, pipe))


def _last_word(number: int, lock: EnvironmentLock, pipe: Any) -> tuple[str, ...]:
    """Do unit after unit, and say why there is no next."""
    say, worker = speaker(pipe), None
    try:
        worker = Worker(number, lock)
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
