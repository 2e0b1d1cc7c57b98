"""Tasks on a Ray cluster that share the work of a sweep; nodes and workers may go and come.

A node that is lost costs nothing but time: what was under way there runs again elsewhere. A trial that takes its worker
along, twice, is lost; so is one that takes too long. Ray decides where a task runs; it does not try it again, since it
would begin with the first trial of a unit, and count a lost node as it counts a trial that ends its worker.
"""

import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, final

from apo_bench.sweeps.work.dispatch import STARTING_S, Dispatch, Job

_TURN_S = 0.2
_AHEAD = 32
"""So many tasks wait at the cluster for a free CPU, so that a node that joins has work at once."""
DEATHS = 2
"""So many workers in a row die of one trial before it is lost: memory may be short for once."""
FALSE_STARTS_OF_TASKS = 5


@final
@dataclass(eq=False)
class Task:
    """A unit of work on the cluster."""

    job: Job
    messages: Any
    """Yields references of messages, as Ray's generators do."""
    worker: Mapping[str, Any] | None = None
    """Host, node and process; None until it runs."""


@final
class RayPool:
    """Has the jobs of a sweep done by a cluster; to be asked for a turn as long as it is busy."""

    def __init__(self, dispatch: Dispatch, start: Callable[[bytes], Any], workers: int | None) -> None:
        """Args:
        start: Starts a task for a pickled unit.
        workers: At most so many tasks; None for as many as the cluster takes.
        """
        self._dispatch = dispatch
        self._start = start
        self._workers = workers
        self._tasks: list[Task] = []
        self._is_stopping = False

    @property
    def is_busy(self) -> bool:
        """Whether there are trials without a row."""
        return bool(self._dispatch.waiting or self._tasks)

    def turn(self) -> None:
        """Hear what there is to hear, and act on it.

        Raises:
            InputError: A worker found that the request cannot be honoured.
            RuntimeError: A trial could not be run at all, or workers end before they have begun.
        """
        import ray

        self._fill()
        waited_for = [task.messages for task in self._tasks]
        ray.wait(waited_for, num_returns=1, timeout=_TURN_S)
        ready = ray.wait(waited_for, num_returns=len(waited_for), timeout=0)[0]
        self._dispatch.tick()
        for task in list(self._tasks):
            if task.messages in ready:
                self._hear(task)
            elif self._dispatch.is_late(task.job):
                self._cancel(task)
                self._ended(task, "time_limit", f"no trial began within {STARTING_S:g} s")

    def stop(self) -> None:
        """Begin no other trial; those under way may end."""
        self._is_stopping = True
        self._dispatch.waiting.clear()
        for task in list(self._tasks):
            if task.job.since is None:
                self._cancel(task)

    def _fill(self) -> None:
        """Start as many tasks as there may be, as long as few of them wait for a CPU."""
        while (
            self._dispatch.waiting
            and sum(task.worker is None for task in self._tasks) < _AHEAD
            and (self._workers is None or len(self._tasks) < self._workers)
        ):
            job = self._dispatch.waiting.popleft()
            self._tasks.append(Task(job, self._start(pickle.dumps(job.unit))))

    def _hear(self, task: Task) -> None:
        """Take the next message of a task."""
        import ray
        from ray.exceptions import NodeDiedError, ObjectLostError, RayError, RayTaskError

        try:
            message = ray.get(next(task.messages))
        except StopIteration:
            self._tasks.remove(task)
        except RayTaskError as error:
            raise RuntimeError(f"a task on the Ray cluster could not run:\n{error}") from error
        except (NodeDiedError, ObjectLostError):
            self._ended(task, None, "")
        except RayError as error:
            self._ended(task, "worker_died", " ".join(str(error).split()))
        else:
            self._dispatch.hear(task.job, message)
            if message[0] == "here":
                task.worker = message[1]
            elif message[0] == "row" and self._is_stopping:
                self._cancel(task)

    def _ended(self, task: Task, code: str | None, why: str) -> None:
        if task in self._tasks:
            self._tasks.remove(task)
        why = f"workers on the Ray cluster end before they have begun a trial: {why}"
        self._dispatch.ended(task.job, code, why, task.worker or {"worker": -1})

    def _cancel(self, task: Task) -> None:
        import ray

        self._tasks.remove(task)
        ray.cancel(task.messages, force=True)
