"""The package's corrector behind the shape of a peer: the one place that knows its calls."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from benchmarks.corrector_bench.peers import Run, Task


def contact(task: Task) -> Run:
    """Plain numpy: the whole solve, from the equations and a covariance to goals at rest."""
    from apo_bench.correction.compact import compact
    from apo_bench.correction.manifold import nearest

    return lambda: nearest(compact(task.system, len(task.seen)), task.seen, np.linalg.cholesky(task.covariance)).goals


def compiled(task: Task) -> Run:
    """The same by the optional compiled kernel."""
    from apo_bench.correction.compiled import nearest  # type: ignore[import-not-found]

    return lambda: nearest(task.system, task.seen, np.linalg.cholesky(task.covariance)).goals


COMPILED = "contact compiled"
PEERS: Mapping[str, Callable[[Task], Run]] = MappingProxyType({"contact": contact, COMPILED: compiled})
