"""Where boxes, arrows and labels of the picture of a relation graph lie, in inches, y upwards."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import Graph, Node
from apo_bench.geometry import Array
from apo_bench.io import grouped
from apo_bench.show.graph.layers import ArcChain, LayerItem, Layers, Passing, abscissas, arrange_layers, width

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
