"""Where boxes, arrows and labels of the picture of a relation graph lie, in inches, y upwards.

Rows for the picture of a relation graph: environment parts below, few crossings, short arrows.

Rows are longest paths from the ground (Sugiyama). An arc that passes a row takes a place of its own in it. No arc
leads back up: when it was made its environment part rested, and what stands moves together.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, permutations, product
from math import factorial, prod
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import Arc, Graph, Node
from apo_bench.geometry import Array
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


_NODE_HEIGHT = 0.5
_GAP = 0.72
"""Between rows: room for a label of two lines."""
_LETTER = 0.082
"""A letter of a name."""
_TERM = 0.19
_INVERSE = 0.16
"""A term of an ODL, and what its exponent adds."""
_LABEL_LETTER = 0.07
_LABEL_LINE = 0.135
_ALONG = (0.5, 0.4, 0.6, 0.3, 0.7, 0.22, 0.78)
"""Places of a label on a straight piece of its arrow, the best first."""


class Rectangle(NamedTuple):
    """Centre and full size."""

    x: float
    y: float
    width: float
    height: float


@final
@dataclass(frozen=True, eq=False)
class GraphLayout:
    """A picture of a graph, yet to be drawn."""

    width: float
    height: float
    boxes: Mapping[Node, Rectangle]
    routes: tuple[Array, ...]
    """The corners of each arrow, (k, 2), from the manipulated part to the environment part."""
    labels: tuple[Rectangle, ...]
    """The room of the label of each arrow."""


def layout_graph(graph: Graph, texts: Sequence[str]) -> GraphLayout:
    """Lay out a graph whose arcs are labelled with these texts."""
    layers = arrange_layers(graph)
    odls = {node: sum(_TERM + _INVERSE * term.inverse for term in node.odl) for node in graph.nodes}
    unit = max((max(0.85, _LETTER * len(node.part) + 0.2, odl + 0.2) for node, odl in odls.items()), default=1.0)
    x = {item: unit * at for item, at in abscissas(layers).items()}
    wide = max((at + unit * width(item) / 2 for item, at in x.items()), default=unit)
    nodes = ((j, item) for j, row in enumerate(layers.rows) for item in row if isinstance(item, Node))
    boxes = {item: Rectangle(x[item], _level(j), unit, _NODE_HEIGHT) for j, item in nodes}
    if layers.ground is not None:
        boxes[layers.ground] = Rectangle(wide / 2, _level(-1), wide, _NODE_HEIGHT)
    routes = tuple(_routes(layers, x, unit))
    return GraphLayout(
        wide, _level(len(layers.rows) - 1) + _NODE_HEIGHT / 2, boxes, routes, tuple(_labels(routes, texts))
    )


def _level(row: int) -> float:
    """The middle of a row; the ground is row -1."""
    return _NODE_HEIGHT / 2 + (row + 1) * (_NODE_HEIGHT + _GAP)


def _routes(layers: Layers, x: Mapping[LayerItem, float], unit: float) -> Iterator[Array]:
    """Straight from row to row, upright past a row, upright to the ground."""
    rows = {item: j for j, row in enumerate(layers.rows) for item in row}
    leave = _ports(layers.chains, x, unit, 0, lambda chain: chain[1] if len(chain) > 1 else chain[0])
    enter = _ports(layers.chains, x, unit, -1, lambda chain: chain[-2])
    for i, chain in enumerate(layers.chains):
        points = [(leave[i], _level(rows[chain[0]]) - _NODE_HEIGHT / 2)]
        for item in chain[1:]:
            middle = _level(rows[item])
            if isinstance(item, Passing):
                points += [(x[item], middle + _NODE_HEIGHT / 2), (x[item], middle - _NODE_HEIGHT / 2)]
            else:
                points.append((enter[i], middle + _NODE_HEIGHT / 2))
        if len(chain) == 1 or isinstance(chain[-1], Passing):
            points.append((points[-1][0], _NODE_HEIGHT))
        yield np.array(points)


def _ports(
    chains: Sequence[ArcChain],
    x: Mapping[LayerItem, float],
    unit: float,
    end: int,
    neighbour: Callable[[ArcChain], LayerItem],
) -> dict[int, float]:
    """Where each arrow meets the box at that end of its chain: side by side, in the order of where they come from."""
    meeting = grouped(
        (chain[end], i)
        for i, chain in enumerate(chains)
        if isinstance(chain[end], Node) and (end == 0 or len(chain) > 1)
    )
    ports: dict[int, float] = {}
    for node, arcs in meeting.items():
        arcs.sort(key=lambda i: x[neighbour(chains[i])])
        # at the middles of equal parts of 0.8 of the box, from left to right
        aside = 0.8 * unit * ((np.arange(len(arcs)) + 0.5) / len(arcs) - 0.5)
        ports.update(zip(arcs, (x[node] + aside).tolist(), strict=True))
    return ports


def _labels(routes: Sequence[Array], texts: Sequence[str]) -> Iterator[Rectangle]:
    """One by one, each where it hides the least of other labels and arrows."""
    dots = [_dots(route) for route in routes]
    placed: list[Rectangle] = []
    for i, (route, text) in enumerate(zip(routes, texts, strict=True)):
        others = np.concatenate([np.zeros((0, 2)), *dots[:i], *dots[i + 1 :]])
        lines = text.split("\n")
        size = _LABEL_LETTER * max(map(len, lines)) + 0.06, _LABEL_LINE * len(lines) + 0.06
        room = (Rectangle(*point, *size) for point in _candidates(route))
        placed.append(min(room, key=lambda r: (sum(shared_area(r, p) for p in placed), _covered(r, others))))
        yield placed[-1]


def _candidates(route: Array) -> Iterator[tuple[float, float]]:
    """Points on the pieces between rows, those further up first."""
    for along in _ALONG:
        for a, b in pairwise(route):
            if a[1] - b[1] > _NODE_HEIGHT * 1.01:
                x, y = a + along * (b - a)
                yield float(x), float(y)


def _dots(route: Array, step: float = 0.03) -> Array:
    """Points along an arrow, (k, 2)."""
    return np.concatenate([np.linspace(a, b, 2 + int(np.linalg.norm(b - a) / step)) for a, b in pairwise(route)])


def _covered(room: Rectangle, points: Array) -> int:
    """How many points, (k, 2), lie in a rectangle."""
    return int((np.abs(points - [room.x, room.y]) <= (np.array([room.width, room.height]) / 2)).all(axis=1).sum())


def shared_area(a: Rectangle, b: Rectangle) -> float:
    """The area that two rectangles have in common, [square inches]."""
    # how far the sides reach over each other, at most the whole of the smaller one
    wide = (a.width + b.width) / 2 - abs(a.x - b.x)
    high = (a.height + b.height) / 2 - abs(a.y - b.y)
    return max(0.0, min(wide, a.width, b.width)) * max(0.0, min(high, a.height, b.height))
