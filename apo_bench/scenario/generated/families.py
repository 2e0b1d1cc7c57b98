"""Families of generated assemblies: the stations that each combines, its sizes and its probability."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.scenario.generated.assembly import (
    BOARD,
    GeneratedAssembly,
    Station,
    draw_partition,
    merge_orders,
    shift_station,
)
from apo_bench.scenario.generated.bodies import TOP
from apo_bench.scenario.generated.linked import (
    make_bridged,
    make_castled,
    make_grooved,
    make_keyed,
    make_pinned,
    make_threaded,
)
from apo_bench.scenario.generated.stations import make_carried, make_corner, make_covered, make_peg, make_post
from apo_bench.scenario.parts.making import Body, extrude, join, make_rectangle

_GAP = 10.0
"""Distance between stations, [mm]."""
_EDGE = 6.0
"""Margin of the board around stations, [mm]."""
_LONGEST = 226.0
"""Largest length of a board, all of which the arm can reach, [mm]."""


class StationKind(NamedTuple):
    """One kind of station."""

    make: Callable[[np.random.Generator, str, int], Station]
    """(rng, number of the station as text for names, number of parts) -> station."""
    least: int
    """Least number of parts."""
    most: int
    """Largest number of parts."""


class Family(NamedTuple):
    """A family of assemblies."""

    title: str
    kinds: tuple[str, ...]
    """Kinds of stations that may stand on the board."""
    sizes: tuple[int, int]
    """Least and largest number of parts, the board included."""
    weight: int
    """Relative probability that a seed without a family draws it; 0: held out for tests."""

    def draw(self, rng: np.random.Generator) -> GeneratedAssembly:
        """Draw one assembly of the family; drawing is repeated until the board is short enough."""
        stations = list[Station]()
        while not stations or _measure_board_length(stations) > _LONGEST:
            size = int(rng.integers(self.sizes[0], self.sizes[1] + 1)) - 1
            count = int(rng.integers(1, _MOST + 1))
            kinds = [_KINDS[self.kinds[int(k)]] for k in rng.integers(len(self.kinds), size=count)]
            least = [kind.least for kind in kinds]
            most = [kind.most for kind in kinds]
            if sum(least) <= size <= sum(most):
                parts = draw_partition(rng, size, least, most)
                stations = [kind.make(rng, str(i), n) for i, (kind, n) in enumerate(zip(kinds, parts, strict=True), 1)]
        return place_stations(self.title, stations, rng)


def _measure_board_length(stations: Sequence[Station]) -> float:
    """Length of the board that the stations need, [mm]."""
    return sum(station.length for station in stations) + _GAP * (len(stations) - 1) + 2 * _EDGE


def place_stations(title: str, stations: Sequence[Station], rng: np.random.Generator) -> GeneratedAssembly:
    """Place stations next to each other on one board, and interleave their operations."""
    length = _measure_board_length(stations)
    placed = list[Station]()
    x = _EDGE - length / 2
    for station in stations:
        placed.append(shift_station(station, x + station.length / 2))
        x += station.length + _GAP
    bodies = [body for station in placed for body in station.bodies]
    ys = [float(np.abs(piece.corners[:, 1]).max()) for body in bodies for piece in body.pieces]
    deep = max(60.0, 2e3 * max(ys, default=0.0) + 2 * _EDGE)
    bores = [bore for station in placed for bore in station.bores]
    board = extrude(make_rectangle(length, deep), 0, TOP, bores=bores, bottom="bottom", top="top")
    parts: dict[str, Body] = {BOARD: join(board, *bodies) if bodies else board}
    fixed = {BOARD: (0.0, 0.0, 0.0)}
    for station in placed:
        parts |= station.parts
        fixed |= station.fixed
    return GeneratedAssembly(title, parts, fixed, merge_orders(rng, [station.acts for station in placed]))


_MOST = 4
"""Largest number of stations on a board."""
_KINDS: Mapping[str, StationKind] = {
    "corner": StationKind(make_corner, 1, 3),
    "peg": StationKind(make_peg, 1, 2),
    "post": StationKind(make_post, 1, 3),
    "covered": StationKind(make_covered, 3, 9),
    "pinned": StationKind(make_pinned, 3, 5),
    "bridged": StationKind(make_bridged, 3, 9),
    "keyed": StationKind(make_keyed, 3, 6),
    "grooved": StationKind(make_grooved, 3, 6),
    "carried": StationKind(make_carried, 3, 3),
    "castled": StationKind(make_castled, 3, 7),
    "threaded": StationKind(make_threaded, 2, 3),
}
_EVERY = ("corner", "peg", "post", "covered", "pinned", "bridged", "keyed", "grooved", "carried")

FAMILIES: Mapping[str, Family] = {
    "corners": Family("Blocks in corners of walls, and piles of blocks", ("corner",), (3, 10), 2),
    "pegs": Family("Axles with collars in bores, and rings over them", ("peg",), (3, 9), 2),
    "posts": Family("Plates over one post or two", ("post",), (3, 10), 2),
    "covers": Family("A cover over axles, and rings on it", ("covered",), (4, 10), 2),
    "carried": Family("Axles that carry their rings from a stand", ("carried",), (4, 10), 2),
    "pinned": Family("Loose plates that axles join", ("pinned",), (4, 12), 3),
    "bridges": Family("Loose towers that plates join", ("bridged",), (4, 10), 3),
    "keys": Family("Keys in a slot that a bar joins", ("keyed",), (4, 12), 3),
    "grooves": Family("Keys with tilted faces that a bar joins", ("grooved",), (4, 12), 3),
    "mixed": Family("Stations of all kinds", _EVERY, (5, 12), 6),
    "castles": Family("Loose blocks that a stick in their slots joins", ("castled",), (4, 8), 0),
    "rods": Family("Loose brackets that a level rod joins", ("threaded",), (3, 4), 0),
}
"""All families by name. Those with weight 0 are held out: no `generated:SEED` draws them or their kinds of stations."""
