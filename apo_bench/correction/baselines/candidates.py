"""Choice of the motion parameters to adjust (Section 3.3.2): those of failing arcs, and all connected to them.

An arc of the relation graph is all contacts that one operation makes between one pair of parts. It connects the motion
parameters in the ODLs of its two parts at that time, also after it has disappeared. Fixed parts and parts that were
never moved have no ODL, so nothing is connected through them.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import (
    Assembly,
)


def candidates(assembly: Assembly, failing: NDArray[np.bool_]) -> tuple[int, ...]:
    """The operations whose motion parameters may have to change, the most recent first; none if nothing fails.

    Args:
        failing: (c,), in the order of `assembly.relations()`: contacts with a residual above the threshold.
    """
    arcs = _arcs(assembly)
    chosen = frozenset[int]().union(*(arc for arc, fails in zip(arcs, failing, strict=True) if fails))
    return tuple(sorted(_connected(chosen, arcs), reverse=True))


def _connected(chosen: frozenset[int], graph: Sequence[frozenset[int]]) -> frozenset[int]:
    """The chosen operations and all that are connected to them, directly or indirectly."""
    while True:
        grown = chosen.union(*(arc for arc in graph if arc & chosen))
        if grown == chosen:
            return chosen
        chosen = grown


def _arcs(assembly: Assembly) -> list[frozenset[int]]:
    """The operations in the ODLs of both ends of each contact, when it was made."""
    history = assembly.odls()
    return [
        frozenset(term.operation for end in relation.contact for term in history[relation.made].get(end.part, ()))
        for relation in assembly.relations()
    ]
