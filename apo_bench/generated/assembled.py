"""What a generated assembly is made of: operations with the contacts that they make, and stations beside each other.

Lengths in mm, in the frame of the assembly: x along the board, z up from the table.

Where the site is, and where each part waits beside it: in reach, with room for the hand; lengths in mm.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array
from apo_bench.parts.making import Body, Bore

BOARD = "board"
"""What everything stands on: one part, bolted to the table where the site is."""
Point = tuple[float, float, float]


class Act(NamedTuple):
    """One operation."""

    part: str
    at: Point
    """Where the frame of the part is in the end."""
    contacts: tuple[tuple[str, str], ...]
    """A face of the part, or `other.face` of what it carries, and the face that it meets."""
    grasp: Point
    """Centre between the fingertips, frame of the part."""
    across: str = "y"
    carries: tuple[str, ...] = ()
    vary_mm: tuple[tuple[str, float], ...] = ()
    """How far its truth varies, either way, along axes of the part that no contact fixes."""


class Station(NamedTuple):
    """A place on the board, about x = 0: what the board has there, and what is put together there, in order."""

    length: float
    """Room that it takes along the board."""
    parts: Mapping[str, Body]
    acts: tuple[Act, ...]
    bores: tuple[Bore, ...] = ()
    """Through the board."""
    bodies: tuple[Body, ...] = ()
    """On the board: walls, rails, posts."""
    fixed: Mapping[str, Point] = {}
    """Parts that stand beside the board and are bolted down, too."""


class Assembled(NamedTuple):
    """A whole assembly."""

    title: str
    parts: Mapping[str, Body]
    """The board first."""
    fixed: Mapping[str, Point]
    """Where fixed parts stand."""
    acts: tuple[Act, ...]


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """A length out of an interval, in steps of half a millimetre."""
    return float(rng.integers(round(2 * low), round(2 * high) + 1)) / 2


def split(rng: np.random.Generator, total: int, least: Sequence[int], most: Sequence[int]) -> list[int]:
    """Whole numbers of this sum between bounds; as near as can be where none are.

    Args:
        least: Of each number.
        most: Of each number.
    """
    counts = list(least)
    while sum(counts) < total:
        room = [i for i, count in enumerate(counts) if count < most[i]]
        if not room:
            break
        counts[int(rng.choice(room))] += 1
    return counts


def shifted(station: Station, x: float) -> Station:
    """A station at another place along the board."""
    return station._replace(
        acts=tuple(act._replace(at=(act.at[0] + x, *act.at[1:])) for act in station.acts),
        bores=tuple(replace(bore, at=(bore.at[0] + x, bore.at[1])) for bore in station.bores),
        bodies=tuple(body.moved((x, 0.0, 0.0)) for body in station.bodies),
        fixed={name: (at[0] + x, *at[1:]) for name, at in station.fixed.items()},
    )


def merged(rng: np.random.Generator, orders: Sequence[Sequence[Act]]) -> tuple[Act, ...]:
    """Operations of several stations, one after another at random, those of each in their own order."""
    turns = rng.permutation([i for i, order in enumerate(orders) for _ in order])
    left = [iter(order) for order in orders]
    return tuple(next(left[i]) for i in turns)


_ARM = np.array([-420.0, 0.0])
"""Where the arm that comes with the benchmark stands; it reaches the table between two distances."""
_REACH = (285.0, 640.0)
_LEAST_ASIDE = 110.0
"""Nothing waits between the arm and the site, where its links pass."""
_CENTER = 95.0
_YAW_DEG = 20.0
_SPREAD_X = (5.0, 30.0)
_SPREAD_Y = (5.0, 40.0)
_ROOM = np.array([36.0, 58.0])
"""Between what waits: fingers close across y."""
_BESIDE = 45.0
"""Between what waits and wherever the site may be."""
_GRID = 6.0


class Table(NamedTuple):
    """How the table is laid."""

    starts: Mapping[str, tuple[float, float, float]]
    center: tuple[float, float]
    spread: tuple[float, float]
    yaw_deg: float


def lay(made: Assembled, rng: np.random.Generator) -> Table:
    """Draw where parts wait.

    Raises:
        RuntimeError: There is no room for all of them.
    """
    # The disc around the assembly that its fixed parts fill, wherever they are turned.
    corners = np.concatenate([_box(made.parts[part]) + at[:2] for part, at in made.fixed.items()])
    reach = float(np.hypot(*np.abs(corners).max(axis=0)))
    spread = (float(np.clip(150.0 - reach, *_SPREAD_X)), float(np.clip(150.0 - reach, *_SPREAD_Y)))
    yaw = np.radians(_YAW_DEG)
    half = np.abs(corners).max(axis=0)
    kept = spread + np.array([[np.cos(yaw), np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]) @ half + _BESIDE
    taken = [(np.array([_CENTER, 0.0]) - kept, np.array([_CENTER, 0.0]) + kept)]
    starts = dict[str, tuple[float, float, float]]()
    movable = [part for part in made.parts if part not in made.fixed]
    for part in sorted(
        rng.permutation(movable).tolist(), key=lambda part: -float(np.ptp(_box(made.parts[part]), axis=0)[0])
    ):
        low, high = _box(made.parts[part])
        size = (high - low) / 2
        places = _grid() + rng.uniform(-_GRID / 2, _GRID / 2, 2)
        free = np.ones(len(places), dtype=np.bool_)
        for a, b in taken:
            room = _ROOM if a is not taken[0][0] else 0.0
            free &= ((places - size > b + room) | (a > places + size + room)).any(axis=1)
        if not free.any():
            raise RuntimeError(f"no room for {part}")
        at = np.round(places[int(np.argmax(free))], 1)
        taken.append((at - size, at + size))
        starts[part] = (*(at - (low + high) / 2).round(3).tolist(), 0.0)
    return Table(starts, (_CENTER, 0.0), spread, _YAW_DEG)


def _grid() -> Array:
    """Places in reach on both sides of the site, (k, 2), the nearest first."""
    x, y = np.meshgrid(np.arange(-130.0, 190.0, _GRID), np.arange(-400.0, 401.0, _GRID), indexing="ij")
    places = np.column_stack([x.ravel(), y.ravel()])
    far = np.hypot(*(places - _ARM).T)
    places = places[(far > _REACH[0]) & (far < _REACH[1]) & (np.abs(places[:, 1]) > _LEAST_ASIDE)]
    return places[np.argsort(np.hypot(places[:, 0] - 20.0, places[:, 1]), kind="stable")]


def _box(body: Body) -> Array:
    """Lowest and highest corner of a body over the table, (2, 2)."""
    corners = np.concatenate([piece.corners for piece in body.pieces])[:, :2]
    return np.asarray(1e3 * np.array([corners.min(axis=0), corners.max(axis=0)]))
