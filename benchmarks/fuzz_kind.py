"""Files of one kind, and what is asked of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np


class Kind(NamedTuple):
    """Files of a folder, one of which is changed, and what is then asked of it."""

    files: Mapping[str, bytes]
    changed: Sequence[str]
    commands: Sequence[Sequence[str]]
    """Arguments of `apo-bench`; `read-plan` stands for the function of that name, which no command calls."""
    weight: int = 10
    """How often it is drawn."""
    writes: Sequence[str] = ()
    """Patterns of the paths that the commands write."""
    longest_s: float = 10
    """Of the processor."""
    largest_mb: float = 1000
    structure: Callable[[bytes, np.random.Generator], bytes] | None = None
    """How its structure is changed; None: as the ending of the file says."""
    may_be_refused: bool = False
    """Whether also the valid files may end in one sentence."""
