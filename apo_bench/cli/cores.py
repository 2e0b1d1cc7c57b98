"""How many processes the machine gives this one."""

import os
from typing import Any

_MOST = 64


def cores() -> int:
    """The cores that this process may use, at most 64."""
    affinity: Any = getattr(os, "sched_getaffinity", None)
    return max(1, min(_MOST, len(affinity(0)) if affinity else os.cpu_count() or 1))
