"""Minimal sets of relations that fix an operation as much as all relations together do.

Relations are added in order of their distance from the operation in the graph of operations and relations, until the
rank is reached. Then those that are not needed are removed, farthest and latest first. The result is irreducible:
without any one of its relations the part would be freer.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import ODL, Assembly, invert, simplify_odl
from apo_bench.correction.solvers import (
    RANK_CUT_OFF,
    CompactEquations,
)
from apo_bench.geometry import Array


@final
@dataclass(frozen=True)
class RelationHold:
    """A relation with its history, as one that fixes a part."""

    relation: str
    """R1, R2, ... as in the relation graph."""
    parts: tuple[str, str]
    """Manipulated, environment."""
    made: int
    """The operation that made it, counted from 0."""
    lost: int | None
    """The operation at which it disappeared, or None while it stands."""
    word: ODL
    """The product D_a^-1 D_b in its equations (Eq. 26), without start poses."""


def relation_holds(assembly: Assembly) -> tuple[RelationHold, ...]:
    """Every relation of an assembly."""
    relations = assembly.relations()
    history = assembly.odls()
    holds = []
    for i, arc in enumerate(assembly.arcs(), start=1):
        contact, made, lost = relations[arc[0]]
        a, b = assembly.given(contact)
        word = simplify_odl((*invert(history[made].get(a.part, ())), *history[made].get(b.part, ())))
        holds.append(RelationHold(f"R{i}", (a.part, b.part), made, lost, word))
    return tuple(holds)


@final
@dataclass(frozen=True, eq=False)
class RelationEquations:
    """The Jacobian of an assembly, grouped by relation."""

    Jt: Array
    """(6 n, 3 c): the transposed Jacobian at a solution; columns of contacts that are left out are zero."""
    arcs: tuple[tuple[int, ...], ...]
    """The contacts of each relation, numbers in `relations()`."""
    operations: tuple[frozenset[int], ...]
    """The operations that occur in the equations of each relation."""

    def rank(self, k: int, some: Sequence[int]) -> int:
        """Number of directions of operation k that some relations fix, if earlier operations are fixed and later ones
        adapt.

        It is the rank of the columns of operation k and later ones, minus the rank of the columns of later ones.
        """
        later = sorted({j for i in some for j in self.operations[i] if j > k})
        rows = [3 * c + i for arc in some for c in self.arcs[arc] for i in range(3)]
        behind = self._blocks(later)[:, rows]
        return _rank(np.concatenate([self._blocks([k])[:, rows], behind])) - _rank(behind)

    def holding(self, k: int, rank: int) -> tuple[int, ...]:
        """An irreducible set of relations that fixes `rank` directions of operation k; relations near to it come
        first.
        """
        order = [i for ring in self._rings(k) for i in ring]
        count = next((m for m in range(len(order) + 1) if self.rank(k, order[:m]) >= rank), len(order))
        kept = order[:count]
        for i in reversed(order[:count]):
            without = [j for j in kept if j != i]
            if self.rank(k, without) >= rank:
                kept = without
        return tuple(sorted(kept))

    def direct(self, k: int) -> tuple[int, ...]:
        """The relations in whose equations operation k occurs."""
        return tuple(i for i, operations in enumerate(self.operations) if k in operations)

    def _rings(self, k: int) -> list[list[int]]:
        """Relations grouped by distance from operation k in the graph, through operations that are not earlier than
        k.
        """
        reached = {k}
        left = set(range(len(self.arcs)))
        rings = list[list[int]]()
        while ring := sorted(i for i in left if self.operations[i] & reached):
            rings.append(ring)
            left.difference_update(ring)
            reached.update(j for i in ring for j in self.operations[i] if j >= k)
        return rings

    def _blocks(self, operations: Sequence[int]) -> Array:
        """The rows of the transposed Jacobian of some operations, (6 m, 3 c)."""
        return self.Jt[[6 * j + i for j in operations for i in range(6)]]


def by_relation(assembly: Assembly, system: CompactEquations, Jt: Array, kept: NDArray[np.bool_]) -> RelationEquations:
    """Group the equations of all contacts by relation.

    Args:
        system: The equations of all contacts, in the order of `assembly.relations()`.
        Jt: (6 n, 3 c), their transposed Jacobian.
        kept: (c,): the contacts that count.
    """
    arcs = assembly.arcs()
    contact, letter = system.words.incidence
    known = system.words.operation[letter]
    operations = tuple(frozenset(known[np.isin(contact, [i for i in arc if kept[i]])].tolist()) for arc in arcs)
    return RelationEquations(np.where(np.repeat(kept, 3), Jt, 0.0), arcs, operations)


def _rank(Jt: Array) -> int:
    """The numerical rank at a solution."""
    if not Jt.size:
        return 0
    w = np.linalg.svd(Jt, compute_uv=False)
    return int(np.count_nonzero(w > RANK_CUT_OFF * w[0]))
