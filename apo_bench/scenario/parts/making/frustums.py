"""Frustums: the lengths of a bore or a shaft along its axis."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from apo_bench.geometry import Array, RoundFace
from apo_bench.scenario.parts.making.moments import Moments, frustum_moments, sum_moments
from apo_bench.scenario.parts.making.outline import needed_sides

_SAME_MM = 1e-6


@final
@dataclass(frozen=True)
class Frustum:
    """One length of a bore or of a shaft, a cylinder or a cone, [mm]."""

    low: float
    """Where it begins along the axis."""
    high: float
    radius: float
    """Where it begins."""
    end_radius: float | None = None
    """Where it ends, of a cone."""
    name: str = ""
    """Of its wall; else one is found."""
    fit: bool = False
    sides: int | None = None
    """Into how many its wall is cut; else as a contact needs if it has a name, and few if not."""

    @property
    def radii(self) -> tuple[float, float]:
        return self.radius, self.radius if self.end_radius is None else self.end_radius

    @property
    def count(self) -> int:
        """Into how many sides its wall is cut."""
        return needed_sides(self.sides, self.name, max(self.radii))

    def at(self, height: float) -> float:
        """Its radius at a height."""
        a, b = self.radii
        return a + (b - a) * (height - self.low) / (self.high - self.low)

    def covers(self, low: float, high: float) -> bool:
        """Whether a shorter length lies in it."""
        return self.low - _SAME_MM <= low and high <= self.high + _SAME_MM

    def moments(self) -> Moments:
        """[mm]."""
        return frustum_moments(self.low, self.high, *self.radii)

    def wall(self, at: tuple[float, float], hole: bool) -> RoundFace:
        """Its face, about an axis along z."""
        a, b = self.radii
        span = (1e-3 * self.low, 1e-3 * self.high)
        point = np.array([1e-3 * at[0], 1e-3 * at[1], 0.0])
        return RoundFace(self.name, point, np.array([0.0, 0.0, 1.0]), span, (1e-3 * a, 1e-3 * b), hole, self.fit)


def chamfer(wall: Frustum, at_low: float, at_high: float, sign: float) -> list[Frustum]:
    """A cylinder with chamfers of 45 degrees in its length, [mm]; those of `name` are `name_chamfer_low` and `.._high`.

    Args:
        at_low: How long the chamfer at its beginning is; 0: there is none.
        sign: 1 if they are wider than the cylinder, as in a bore, -1 if they are narrower, as on a shaft.
    """
    r = wall.radius
    called = wall.name and f"{wall.name}_chamfer"
    plain = replace(wall, fit=False)
    steps = [replace(wall, low=wall.low + at_low, high=wall.high - at_high)]
    if at_low:
        begin = replace(plain, high=wall.low + at_low, radius=r + sign * at_low, end_radius=r)
        steps.insert(0, replace(begin, name=called and f"{called}_low"))
    if at_high:
        end = replace(plain, low=wall.high - at_high, end_radius=r + sign * at_high)
        steps.append(replace(end, name=called and f"{called}_high"))
    return steps


def subtract_steps(moments: Moments, steps: Sequence[Frustum], at: tuple[float, float] = (0.0, 0.0)) -> Moments:
    """What is left of moments without those of some lengths about an axis along z."""
    there = np.array([*at, 0.0])
    return sum_moments(moments, (step.moments().moved(np.eye(3), there) for step in steps), -1.0)


def raise_to(flat: Array, z: float) -> Array:
    """Points of a plane, (k, 2), at a height, (k, 3)."""
    return np.column_stack([flat, np.full(len(flat), z)])


def prism(flat: Array, low: float, high: float) -> Array:
    """The corners, (2 k, 3), of a prism over points of a plane, (k, 2)."""
    return np.concatenate([raise_to(flat, low), raise_to(flat, high)])


def at_height(steps: Sequence[Frustum], height: float, above: bool) -> tuple[float, int]:
    """Radius and sides just above or just below a height; (0, 0) where no step is."""
    for step in steps:
        up = step.low - _SAME_MM <= height < step.high - _SAME_MM
        down = step.low + _SAME_MM < height <= step.high + _SAME_MM
        if (down, up)[above]:
            return step.at(height), step.count
    return 0.0, 0


def heights_of(steps: Sequence[Frustum], *more: float) -> list[float]:
    """Where steps begin and end, and other heights, ascending, each once."""
    every = np.sort([*more, *(h for step in steps for h in (step.low, step.high))])
    return [float(h) for h in every[np.diff(every, prepend=-np.inf) > _SAME_MM]]


def circumscribe_polygon(at: tuple[float, float], radius: float, sides: int) -> Array:
    """A polygon, (k, 2), counter-clockwise, whose sides touch a circle from outside."""
    return inscribe_polygon(at, radius / np.cos(np.pi / sides), sides)


def inscribe_polygon(at: tuple[float, float], radius: float, sides: int) -> Array:
    """A polygon, (k, 2), counter-clockwise, whose corners lie on a circle; no corner, but a side lies towards +x."""
    angle = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    return np.asarray(np.array(at) + radius * np.column_stack([np.cos(angle), np.sin(angle)]))
