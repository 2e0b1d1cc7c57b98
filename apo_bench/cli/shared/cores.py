"""The number of processor cores that this process may use."""

import os
from typing import Any

_MOST = 64  # more processes gain little


def count_cores() -> int:
    """Return the number of cores that this process may use, at most 64."""
    affinity: Any = getattr(os, "sched_getaffinity", None)
    return max(1, min(_MOST, len(affinity(0)) if affinity else os.cpu_count() or 1))
