"""The data of a generated assembly: a board with stations, and the operations that assemble them.

Lengths in mm, in the frame of the assembly: x along the board, z up from the table.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from apo_bench.scenario.parts.making import Body, Bore

BOARD = "board"
"""Name of the part on which everything stands, fixed to the table at the site."""
Point = tuple[float, float, float]


class DrawnOperation(NamedTuple):
    """One generated operation."""

    part: str
    """The main part."""
    at: Point
    """Target position of the frame of the part."""
    contacts: tuple[tuple[str, str], ...]
    """Pairs of a face of the part, or `other.face` of a part that it carries, and the face that it touches."""
    grasp: Point
    """Centre between the fingertips, frame of the part."""
    across: str = "y"
    """Axis of the part along which the fingers close."""
    carries: tuple[str, ...] = ()
    vary_mm: tuple[tuple[str, float], ...] = ()
    """Axis of the part that no contact fixes, and largest shift of the true pose along it, in either direction."""


class Station(NamedTuple):
    """A place on the board, about x = 0, with its features of the board, its parts and its operations."""

    length: float
    """Length along the board."""
    parts: Mapping[str, Body]
    """Its parts without the board."""
    acts: tuple[DrawnOperation, ...]
    """Its operations, in order."""
    bores: tuple[Bore, ...] = ()
    """Bores through the board."""
    bodies: tuple[Body, ...] = ()
    """Walls, rails and posts on the board."""
    fixed: Mapping[str, Point] = {}
    """Fixed parts next to the board -> position."""


class GeneratedAssembly(NamedTuple):
    """A complete assembly."""

    title: str
    parts: Mapping[str, Body]
    """All parts, the board first."""
    fixed: Mapping[str, Point]
    """Fixed part -> position."""
    acts: tuple[DrawnOperation, ...]
    """All operations, in order."""


def draw_length(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a length from an interval, in steps of half a millimetre."""
    return float(rng.integers(round(2 * low), round(2 * high) + 1)) / 2


def draw_partition(rng: np.random.Generator, total: int, least: Sequence[int], most: Sequence[int]) -> list[int]:
    """Draw whole numbers between bounds with a given sum.

    If the upper bounds do not allow the sum, their sum is reached.

    Args:
        least: Lower bound of each number.
        most: Upper bound of each number.
    """
    counts = list(least)
    while sum(counts) < total:
        room = [i for i, count in enumerate(counts) if count < most[i]]
        if not room:
            break
        counts[int(rng.choice(room))] += 1
    return counts


def shift_station(station: Station, x: float) -> Station:
    """The station shifted by x along the board."""
    return station._replace(
        acts=tuple(act._replace(at=(act.at[0] + x, *act.at[1:])) for act in station.acts),
        bores=tuple(replace(bore, at=(bore.at[0] + x, bore.at[1])) for bore in station.bores),
        bodies=tuple(body.moved((x, 0.0, 0.0)) for body in station.bodies),
        fixed={name: (at[0] + x, *at[1:]) for name, at in station.fixed.items()},
    )


def merge_orders(rng: np.random.Generator, orders: Sequence[Sequence[DrawnOperation]]) -> tuple[DrawnOperation, ...]:
    """Interleave the operations of several stations at random; those of each station keep their order."""
    turns = rng.permutation([i for i, order in enumerate(orders) for _ in order])
    left = [iter(order) for order in orders]
    return tuple(next(left[i]) for i in turns)
