"""Pairs of parts with play, each where it is in the other, for `colliding.py`, [mm]. They overlap by nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from manifold3d import CrossSection, JoinType, Manifold, Mesh64

SIDES = 128
"""Of a whole turn."""


class Pair(NamedTuple):
    """One part, and one that comes down into it or over it."""

    fixed: Any
    moving: Any
    play: float
    """Per side, square to the walls."""


def block(x: float, y: float, low: float, high: float) -> Any:
    return Manifold.cube((x, y, high - low), True).translate((0, 0, (low + high) / 2))


def rod(r: float, low: float, high: float, x: float = 0.0) -> Any:
    return Manifold.cylinder(high - low, r, r, SIDES).translate((x, 0, low))


def round_plug() -> Pair:
    """A shaft in a blind hole."""
    return Pair(block(40, 40, 0, 20) - rod(5.1, 5, 20), rod(5, 5, 45), 0.1)


def pocket() -> Pair:
    """With round corners and a draft of 2 degrees; a flange rests on its rim."""
    plug = drafted(30, 20, 4, 6, 21, 0.0) + block(44, 34, 20.5, 27) + block(24, 20, 26, 48)
    return Pair(block(50, 40, 0, 20.5) - drafted(30, 20, 4, 5.8, 21, 0.2), plug, 0.2)


def drafted(x: float, y: float, r: float, low: float, high: float, grow: float) -> Any:
    """A block with round corners that is wider at its top."""
    ends = []
    for z in (low, high):
        more = grow + (z - low) * np.tan(np.radians(2.0))
        angle = np.linspace(0, np.pi / 2, 11)
        ring = np.concatenate(
            [
                (i * (x / 2 - r), k * (y / 2 - r))
                + (r + more) * np.column_stack([np.cos(angle + turn), np.sin(angle + turn)])
                for turn, i, k in zip(np.arange(4) * np.pi / 2, (1, -1, -1, 1), (1, 1, -1, -1), strict=True)
            ]
        )
        ends.append(np.column_stack([ring, np.full(len(ring), z)]))
    return Manifold.hull_points(np.concatenate(ends))


def gear(module: float, teeth: int, grow: float, turn_deg: float = 0.0) -> Any:
    """The outline of a gear with involute flanks of 20 degrees, which grows by so much."""
    pressure = np.radians(20.0)
    pitch, add, root = module * teeth / 2, module * teeth / 2 + module, module * teeth / 2 - 1.25 * module
    base = pitch * np.cos(pressure)
    r = np.linspace(max(base, root) + 1e-6, add, 7)
    away = np.arccos(base / r)
    half = np.pi / (2 * teeth) + np.tan(pressure) - pressure - (np.tan(away) - away)
    r, half = np.append(root, r), np.append(half[0], half)
    angle = np.concatenate([2 * np.pi * k / teeth + np.append(-half, half[::-1]) for k in range(teeth)])
    every = np.tile(np.append(r, r[::-1]), teeth)
    outline = CrossSection([np.column_stack([every * np.cos(angle), every * np.sin(angle)])])
    return outline.rotate(turn_deg).offset(grow, JoinType.Miter)


def ring_gear() -> Pair:
    """A plug of 16 teeth in a ring."""
    plug = Manifold.extrude(gear(2.0, 16, 0.0), 16).translate((0, 0, 6)) + rod(12, 22, 34)
    ring = rod(26, 0, 20) - Manifold.extrude(gear(2.0, 16, 0.15), 30).translate((0, 0, 6))
    return Pair(ring, plug, 0.15)


def gears() -> Pair:
    """A gear of 18 teeth that comes down on its post, beside one of 20 that is fixed."""
    away = 2.0 * 38 / 2
    fixed = block(95, 50, 0, 6).translate((away / 2, 0, 0)) + rod(5, 0, 22, away)
    fixed = fixed + Manifold.extrude(gear(2.0, 20, -0.075), 10.5).translate((0, 0, 5.5))
    moving = Manifold.extrude(gear(2.0, 18, -0.075, 10.0), 10).translate((away, 0, 6)) - rod(5.15, 6, 16, away)
    return Pair(fixed, moving, 0.15)


def bottle_cap() -> Pair:
    """A cap with four grooves over a neck with four lugs."""
    neck = block(40, 40, 0, 10) + rod(12, 9, 26) - rod(8, 4, 30)
    cap = rod(19, 10, 32) - rod(12.25, 9, 27)
    for turn in range(0, 360, 90):
        lug, room = (
            Manifold.sphere(1.0, 48).scale((2.2 + g, 2.6 + g, 4.0 + g)).translate((12, 0, 18)).rotate((0, 0, turn))
            for g in (0.0, 0.25)
        )
        neck = neck + lug
        cap = cap - Manifold.batch_hull([room, room.translate((0, 0, -14))])
    return Pair(neck, cap, 0.25)


def wavy() -> Pair:
    """A steep and wavy free surface; a flange rests on the rim."""
    n = 41
    x, y = np.meshgrid(np.linspace(-18, 18, n), np.linspace(-14, 14, n), indexing="ij")
    across = np.clip(1 - (x / 18) ** 2, 0, 1) * np.clip(1 - (y / 14) ** 2, 0, 1)
    floor = 15 - 9 * across**0.8 * (1 + 0.25 * np.sin(x / 4) * np.cos(y / 5))
    plug = above(x, y, floor + 0.2, 16.0).trim_by_plane((0, 0, -1), -15) + block(46, 38, 15, 22)
    return Pair(block(48, 40, 0, 15) - above(x, y, floor, 25.0), plug, 0.2)


def above(x: Any, y: Any, floor: Any, top: float) -> Any:
    """The solid between a free surface and a level."""
    n, m = x.shape
    at = np.arange(n * m).reshape(n, m)
    a, b, c, d = (each.ravel() for each in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    under = np.concatenate([np.column_stack([a, c, b]), np.column_stack([a, d, c])])
    rim = np.concatenate([at[:, 0], at[-1, 1:], at[-2::-1, -1], at[0, -2:0:-1]])
    on = np.roll(rim, -1)
    sides = np.concatenate([np.column_stack([rim, on, on + n * m]), np.column_stack([rim, on + n * m, rim + n * m])])
    points = np.concatenate([np.stack([x, y, z], axis=-1).reshape(-1, 3) for z in (floor, np.full_like(floor, top))])
    triangles = np.concatenate([under, under[:, ::-1] + n * m, sides])
    return Manifold(Mesh64(points, triangles.astype(np.uint64)))


PAIRS: Mapping[str, Callable[[], Pair]] = {
    "round plug": round_plug,
    "pocket with round corners and draft": pocket,
    "ring of 16 involute teeth": ring_gear,
    "pair of gears": gears,
    "bottle cap": bottle_cap,
    "free surface, steep and wavy": wavy,
}
