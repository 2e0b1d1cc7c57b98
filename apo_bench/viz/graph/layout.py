"""Rows for a relation graph: every part above what it was put on, neighbours near each other."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from graphlib import TopologicalSorter
from itertools import pairwise
from statistics import fmean
from typing import NamedTuple, final

from apo_bench.assembly import Arc, Graph, Node
from apo_bench.io import grouped

_SWEEPS = 12
"""How often every row is ordered by where its neighbours stand."""


class Bend(NamedTuple):
    """The place in a row at which an arc, counted from 0, passes it."""

    arc: int
    row: int


RowItem = Node | Bend


@final
@dataclass(frozen=True, eq=False)
class GraphLayout:
    """Where everything stands: rows from 0 at the bottom, columns about 0 in the middle."""

    ground: Node | None
    """The part that never moved and that most arcs end on: alone in row 0, as wide as the picture."""
    row: Mapping[RowItem, int]
    column: Mapping[RowItem, float]
    routes: tuple[tuple[RowItem, ...], ...]
    """The way of each arc from its manipulated to its environment part."""


def layout_graph(graph: Graph) -> GraphLayout:
    """Put the parts into rows by what they stand on, and order each row by its neighbours."""
    fixed = [node for node in graph.nodes if node.placed is None]
    ground = max(fixed, key=lambda node: sum(arc.environment == node for arc in graph.arcs), default=None)
    rows = _rows(graph, ground)
    row = {item: j for j, items in enumerate(rows) for item in items}
    routes = tuple(_route(i, arc, row) for i, arc in enumerate(graph.arcs))
    for item in (item for route in routes for item in route):
        if isinstance(item, Bend):
            rows[item.row].append(item)
            row[item] = item.row
    return GraphLayout(ground, row, _columns(rows, routes, ground), routes)


def _rows(graph: Graph, ground: Node | None) -> list[list[RowItem]]:
    """A part stands one row above the highest part that it was put on."""
    sorter = TopologicalSorter[Node]({node: [] if ground in (None, node) else [ground] for node in graph.nodes})
    for arc in graph.arcs:
        sorter.add(arc.manipulated, arc.environment)
    sorter.prepare()
    rows = list[list[RowItem]]()
    while sorter.is_active():
        ready = sorter.get_ready()
        rows.append(sorted(ready, key=graph.nodes.index))
        sorter.done(*ready)
    return rows


def _route(i: int, arc: Arc, row: Mapping[RowItem, int]) -> tuple[RowItem, ...]:
    between = range(row[arc.manipulated] - 1, row[arc.environment], -1)
    return (arc.manipulated, *(Bend(i, j) for j in between), arc.environment)


def _columns(
    rows: Sequence[list[RowItem]], routes: Sequence[tuple[RowItem, ...]], ground: Node | None
) -> dict[RowItem, float]:
    """Columns of equal width, every row in the order of the means of its neighbours' columns."""
    links = [link for route in routes for link in pairwise(route) if ground not in link]
    near = grouped(pair for a, b in links for pair in ((a, b), (b, a)))
    column = {item: k - (len(row) - 1) / 2 for row in rows for k, item in enumerate(row)}
    for _ in range(_SWEEPS):
        for row in rows:
            row.sort(key=lambda item: fmean(column[other] for other in near.get(item, [item])))
            column.update((item, k - (len(row) - 1) / 2) for k, item in enumerate(row))
    return column
