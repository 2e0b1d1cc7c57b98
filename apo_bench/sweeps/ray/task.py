"""What runs on the nodes of a Ray cluster: a task that runs one unit of work and yields messages."""

import os
import pickle
import platform
from collections.abc import Callable, Iterator
from functools import lru_cache

from apo_bench.errors import InputError
from apo_bench.sweeps.work.environment_lock import EnvironmentLock, Message, Unit, last_message
from apo_bench.sweeps.work.worker import Worker


def made_task() -> Callable[[bytes, bytes], Iterator[Message]]:
    """The task. It is made here, so that it travels as a whole, to nodes that may have no such package."""

    def run_unit(packed: bytes, unit: bytes) -> Iterator[Message]:
        import os
        import platform
        import sys

        import ray

        host = platform.node()
        node = ray.get_runtime_context().get_node_id()
        yield "here", {"host": host, "node": node, "worker": os.getpid()}
        try:
            from apo_bench.sweeps.ray.task import messages
        except ImportError as error:
            yield (
                "refused",
                f"the node '{host}' cannot import this version of apo_bench ({error}); "
                f"install it for {sys.executable}, which Ray runs there.",
            )
        else:
            yield from messages(packed, pickle.loads(unit), node)

    return run_unit


def messages(packed: bytes, unit: Unit, node: str) -> Iterator[Message]:
    """What the worker of this process says of a unit.

    Args:
        packed: The pickled `EnvironmentLock` of the sweep.
        node: The id of the node that it is on.
    """
    try:
        for kind, *content in _worker(packed).run(unit):
            yield (kind, content[0], content[1] | {"node": node}) if kind == "row" else (kind, *content)
    except Exception as error:
        yield last_message(error)
    except (KeyboardInterrupt, SystemExit):
        os._exit(1)  # code of the user's own that ends the process, as `sys.exit` does


@lru_cache(maxsize=1)
def _worker(packed: bytes) -> Worker:
    """Ray gives its processes task after task: scenes are compiled and modules imported once in each."""
    lock: EnvironmentLock = pickle.loads(packed)
    try:
        lock.check_here()
    except InputError as error:
        raise InputError(f"the node '{platform.node()}' cannot work as this machine does: {error}") from error
    return Worker(os.getpid(), lock)
