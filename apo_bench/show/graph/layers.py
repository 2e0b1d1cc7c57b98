"""Rows for the picture of a relation graph: environment parts below, few crossings, short arrows.

Rows are longest paths from the ground (Sugiyama). An arc that passes a row takes a place of its own in it. No arc
leads back up: when it was made its environment part rested, and what stands moves together.
"""

from collections.abc import Iterable
from itertools import pairwise, permutations, product
from math import factorial, prod
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Arc, Graph, Node
from apo_bench.io import grouped


class Passing(NamedTuple):
    """The place at which an arc, counted from 0, passes a row."""

    arc: int
    row: int


LayerItem = Node | Passing
ArcChain = tuple[LayerItem, ...]
_Rows = tuple[tuple[LayerItem, ...], ...]
Links = list[tuple[LayerItem, LayerItem]]

_NODE_WIDTH = 1.0
_PASSING_WIDTH = 0.5
_SPACE = 0.35
"""Between neighbours, in widths of a node."""
_LOOSE = 0.01
"""How much an item without neighbours counts."""
_FEW = 3000
"""Up to this count every order is tried; else those that differ from the best so far by the place of one item."""


class Layers(NamedTuple):
    """A graph in rows."""

    ground: Node | None
    """The node below all rows, as wide as the picture: the work table."""
    rows: _Rows
    """From the lowest to the highest, each from left to right."""
    chains: tuple[ArcChain, ...]
    """The way of each arc from its manipulated to its environment node, the ground left out."""


def arrange_layers(graph: Graph) -> Layers:
    """Put every node into a row and order the rows."""
    # the part that never moved and that most arcs end on
    resting = [node for node in graph.nodes if node.placed is None]
    ground = max(resting, key=lambda node: sum(arc.environment == node for arc in graph.arcs), default=None)
    heights = _heights(graph, ground)
    chains = tuple(_chain(i, arc, heights, ground) for i, arc in enumerate(graph.arcs))
    rows: list[list[LayerItem]] = [[] for _ in range(1 + max(heights.values(), default=-1))]
    for node, height in heights.items():
        rows[height].append(node)
    for item in dict.fromkeys(item for chain in chains for item in chain):
        if isinstance(item, Passing):
            rows[item.row].append(item)
    return Layers(ground, _ordered(tuple(map(tuple, rows)), links_of(chains)), chains)


def links_of(chains: Iterable[ArcChain]) -> Links:
    """What stands one above the other in some chain."""
    return [pair for chain in chains for pair in pairwise(chain)]


def abscissas(layers: Layers, rounds: int = 60) -> dict[LayerItem, float]:
    """Where each item stands from left to right, in widths of a node: near what it is linked with, none overlapping.

    Rows take turns: each moves as little as possible, in squares, from the means of its neighbours; what has none
    closes up with the others. The leftmost item stands at half its width.
    """
    near = grouped(pair for a, b in links_of(layers.chains) for pair in ((a, b), (b, a)))
    from scipy.optimize import isotonic_regression

    x: dict[LayerItem, float] = {}
    # how far right of the first item of its row each one stands at least
    steps = ([(width(a) + width(b)) / 2 + _SPACE for a, b in pairwise(row)] for row in layers.rows)
    offsets = [np.concatenate([[0.0], np.cumsum(step)]) for step in steps]
    for row, offset in zip(layers.rows, offsets, strict=True):
        x.update(zip(row, offset - offset[-1] / 2, strict=True))
    for _ in range(rounds):
        for row, offset in zip(layers.rows, offsets, strict=True):
            # towards the mean of what each is linked with, in the rows above and below
            middle = float(np.mean([x[item] for item in row]))
            wanted = np.array([np.mean([x[other] for other in near.get(item, ())] or [middle]) for item in row])
            weights = [1.0 if item in near else _LOOSE for item in row]
            # x_i - offset_i may not fall from left to right: the nearest such numbers in weighted squares
            x.update(zip(row, isotonic_regression(wanted - offset, weights=weights).x + offset, strict=True))
    left = min((x[item] - width(item) / 2 for item in x), default=0.0)
    return {item: float(at - left) for item, at in x.items()}


def width(item: LayerItem) -> float:
    """How much room an item takes, in widths of a node."""
    return _PASSING_WIDTH if isinstance(item, Passing) else _NODE_WIDTH


def _heights(graph: Graph, ground: Node | None) -> dict[Node, int]:
    """The longest path of each node down to the ground."""
    heights = {node: 0 for node in graph.nodes if node != ground}
    for _ in heights:
        for arc in graph.arcs:
            if arc.environment != ground:
                heights[arc.manipulated] = max(heights[arc.manipulated], heights[arc.environment] + 1)
    return heights


def _chain(i: int, arc: Arc, heights: dict[Node, int], ground: Node | None) -> ArcChain:
    end = () if arc.environment == ground else (arc.environment,)
    return (
        arc.manipulated,
        *(Passing(i, row) for row in range(heights[arc.manipulated] - 1, heights[arc.environment] if end else -1, -1)),
        *end,
    )


def _ordered(rows: _Rows, links: Links) -> _Rows:
    """The order of least cost; of equal ones the first."""
    if prod(factorial(len(row)) for row in rows) <= _FEW:
        return min(product(*(permutations(row) for row in rows)), key=lambda each: _cost(each, links))
    best = rows
    least = _cost(rows, links)
    while True:
        better = min(_neighbours(best), key=lambda each: _cost(each, links))
        if _cost(better, links) >= least:
            return best
        best = better
        least = _cost(better, links)


def _neighbours(rows: _Rows) -> list[_Rows]:
    """Every order in which one item stands elsewhere in its row."""
    out = []
    for j, row in enumerate(rows):
        for item in row:
            rest = tuple(other for other in row if other != item)
            out += [(*rows[:j], (*rest[:k], item, *rest[k:]), *rows[j + 1 :]) for k in range(len(row))]
    return out


def _cost(rows: _Rows, links: Links) -> tuple[int, float]:
    """Crossings, then the squared lengths of all links from left to right."""
    place = {item: (j, k - (len(row) - 1) / 2) for j, row in enumerate(rows) for k, item in enumerate(row)}
    ends = [(place[a][0], place[a][1], place[b][1]) for a, b in links]
    # two links between the same rows cross if their ends stand in opposite order above and below
    return sum(
        row == other and (top - top_other) * (end - end_other) < 0
        for i, (row, top, end) in enumerate(ends)
        for other, top_other, end_other in ends[:i]
    ), sum((top - end) ** 2 for _, top, end in ends)
