"""A generated assembly: operations, and the stations of a board.

Lengths in mm, in the frame of the assembly: x along the board, z up from the table.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from apo_bench.scenario.parts.making import Body, Bore

BOARD = "board"
"""What everything stands on: one part, bolted to the table where the site is."""
Point = tuple[float, float, float]


class DrawnOperation(NamedTuple):
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
    acts: tuple[DrawnOperation, ...]
    bores: tuple[Bore, ...] = ()
    """Through the board."""
    bodies: tuple[Body, ...] = ()
    """On the board: walls, rails, posts."""
    fixed: Mapping[str, Point] = {}
    """Parts that stand next to the board and are bolted down, too."""


class GeneratedAssembly(NamedTuple):
    """A whole assembly."""

    title: str
    parts: Mapping[str, Body]
    """The board first."""
    fixed: Mapping[str, Point]
    """Where fixed parts stand."""
    acts: tuple[DrawnOperation, ...]


def draw_length(rng: np.random.Generator, low: float, high: float) -> float:
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


def shift_station(station: Station, x: float) -> Station:
    """A station at another place along the board."""
    return station._replace(
        acts=tuple(act._replace(at=(act.at[0] + x, *act.at[1:])) for act in station.acts),
        bores=tuple(replace(bore, at=(bore.at[0] + x, bore.at[1])) for bore in station.bores),
        bodies=tuple(body.moved((x, 0.0, 0.0)) for body in station.bodies),
        fixed={name: (at[0] + x, *at[1:]) for name, at in station.fixed.items()},
    )


def merge_orders(rng: np.random.Generator, orders: Sequence[Sequence[DrawnOperation]]) -> tuple[DrawnOperation, ...]:
    """Operations of several stations, one after another at random, those of each in their own order."""
    turns = rng.permutation([i for i, order in enumerate(orders) for _ in order])
    left = [iter(order) for order in orders]
    return tuple(next(left[i]) for i in turns)
