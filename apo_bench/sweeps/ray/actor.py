"""What runs on the nodes of a Ray cluster: a worker that is asked for its news."""

from __future__ import annotations

import os
import pickle
import platform
import queue
import threading
import traceback
from collections import deque
from typing import Any, final

from apo_bench.errors import InputError
from apo_bench.records.row import Row
from apo_bench.records.settings import TrialSettings
from apo_bench.scenario.file import load_scenario
from apo_bench.simulation.scene.arm import find_arm
from apo_bench.sweeps.environment_lock import EnvironmentLock
from apo_bench.sweeps.grid import Unit
from apo_bench.sweeps.ray.runtime_files import Wanted, check_here
from apo_bench.sweeps.worker import Timing, Worker
from apo_bench.trial.fingerprint import content_hash

News = tuple[Any, ...]
"""("began",), ("row", row, timing), ("done",), ("refused", sentence) or ("failed", traceback)."""


def refusal(packed: bytes) -> str | None:
    """Why trials cannot run on this machine as they do where the sweep was started; None if they can.

    Args:
        packed: The pickled `EnvironmentLock` and `Wanted` of the sweep.
    """
    try:
        lock, asked = _unpacked(packed)
        lock.check_versions()
        check_here(asked)
        for given in asked.scenarios:
            for arm in asked.arms:
                lock.check_content(given, content_hash(load_scenario(given), given, find_arm(arm).mjcf))
    except InputError as error:
        return f"the node '{platform.node()}' cannot work as this machine does: {error}"
    return None


def _unpacked(packed: bytes) -> tuple[EnvironmentLock, Wanted]:
    lock, asked = pickle.loads(packed)
    return lock, asked


@final
class Hand:
    """What an actor does. Trials run in one thread of their own, so that it can be asked and stopped meanwhile.

    News are numbered and kept until the next question shows that they have arrived: an answer that is lost on its way
    is asked for again.
    """

    def __init__(self, number: int, packed: bytes, node: str) -> None:
        """Args:
        number: Tells workers apart in `timing.jsonl`.
        packed: As in `refusal`.
        node: The id of the node that it is on.
        """
        self._number, self._node = number, node
        self._lock, _ = _unpacked(packed)
        self._orders: queue.SimpleQueue[Unit] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._news: deque[News] = deque()
        self._arrived = 0
        self._more = threading.Condition()
        threading.Thread(target=self._live, daemon=True).start()

    def take(self, unit: Unit) -> None:
        """Work on this unit when the one before is done."""
        self._orders.put(unit)

    def stop(self) -> None:
        """Begin no further trial."""
        self._stop.set()

    def news(self, heard: int, wait_s: float) -> list[News]:
        """All news after the first `heard` ones; waits for some."""
        with self._more:
            while self._arrived < heard:
                self._news.popleft()
                self._arrived += 1
            self._more.wait_for(lambda: self._news, timeout=wait_s)
            return list(self._news)

    def _live(self) -> None:
        """The life of the thread; code of the user's that ends it, as `sys.exit` does, ends the process."""
        try:
            worker = Worker(self._number, self._lock)
            while True:
                worker.run(self._orders.get(), self._emit, self._stop.is_set, self._began)
                self._say("done")
        except InputError as error:
            self._say("refused", str(error))
        except Exception:
            self._say("failed", traceback.format_exc())
        except BaseException:
            os._exit(1)

    def _began(self, spec: TrialSettings) -> None:
        self._say("began")

    def _emit(self, row: Row, timing: Timing) -> None:
        self._say("row", row, timing | {"node": self._node})

    def _say(self, *news: Any) -> None:
        with self._more:
            self._news.append(news)
            self._more.notify_all()
