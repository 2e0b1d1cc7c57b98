"""Frustums: cylindrical or conical steps along the axis of a bore or a shaft, in mm."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from apo_bench.geometry import Array, RoundFace
from apo_bench.scenario.parts.making.moments import Moments, compute_frustum_moments, sum_moments
from apo_bench.scenario.parts.making.outline import count_needed_sides

_SAME_MM = 1e-6
"""Heights that differ by less are equal."""


@final
@dataclass(frozen=True)
class Frustum:
    """One step of a bore or a shaft, a cylinder or a cone, [mm]."""

    low: float
    """Height of its lower end."""
    high: float
    """Height of its upper end."""
    radius: float
    """Radius at the lower end."""
    end_radius: float | None = None
    """Radius at the upper end; None: a cylinder."""
    name: str = ""
    """Name of its wall; "": named later."""
    fit: bool = False
    """The wall recedes by the clearance."""
    sides: int | None = None
    """Number of sides of its polygon; None: as a contact needs if it has a name, else few."""

    @property
    def radii(self) -> tuple[float, float]:
        """Radius at the lower and at the upper end."""
        return self.radius, self.radius if self.end_radius is None else self.end_radius

    @property
    def count(self) -> int:
        """Number of sides of its polygon."""
        return count_needed_sides(self.sides, self.name, max(self.radii))

    def at(self, height: float) -> float:
        """Its radius at a height."""
        a, b = self.radii
        return a + (b - a) * (height - self.low) / (self.high - self.low)

    def covers(self, low: float, high: float) -> bool:
        """True if the step includes all heights from low to high."""
        return self.low - _SAME_MM <= low and high <= self.high + _SAME_MM

    def moments(self) -> Moments:
        """Its exact moments, [mm]."""
        return compute_frustum_moments(self.low, self.high, *self.radii)

    def wall(self, at: tuple[float, float], hole: bool) -> RoundFace:
        """Its round face, [m], about the axis along z through `at`, [mm]."""
        a, b = self.radii
        span = (1e-3 * self.low, 1e-3 * self.high)
        point = np.array([1e-3 * at[0], 1e-3 * at[1], 0.0])
        return RoundFace(self.name, point, np.array([0.0, 0.0, 1.0]), span, (1e-3 * a, 1e-3 * b), hole, self.fit)


def add_chamfers(wall: Frustum, at_low: float, at_high: float, sign: float) -> list[Frustum]:
    """Chamfer the ends of a cylinder by 45 degrees; return its steps from low to high.

    The total length does not change. The chamfers of `name` are called `name_chamfer_low` and `name_chamfer_high`.

    Args:
        at_low: Length of the chamfer at the lower end, [mm]; 0: none.
        at_high: Length of the chamfer at the upper end, [mm]; 0: none.
        sign: 1 if the chamfers are wider than the cylinder (bore), -1 if they are narrower (shaft).
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
    """Subtract the moments of steps about the axis along z through `at` from given moments, [mm]."""
    there = np.array([*at, 0.0])
    return sum_moments(moments, (step.moments().moved(np.eye(3), there) for step in steps), -1.0)


def raise_to_height(flat: Array, z: float) -> Array:
    """Points (k, 3) above points (k, 2) of the xy plane, at height z."""
    return np.column_stack([flat, np.full(len(flat), z)])


def make_prism(flat: Array, low: float, high: float) -> Array:
    """The corners, (2 k, 3), of a prism over points of a plane, (k, 2)."""
    return np.concatenate([raise_to_height(flat, low), raise_to_height(flat, high)])


def find_steps_at_height(steps: Sequence[Frustum], height: float, above: bool) -> tuple[float, int]:
    """Radius and number of sides just above or just below a height; (0, 0) if no step is there."""
    for step in steps:
        up = step.low - _SAME_MM <= height < step.high - _SAME_MM
        down = step.low + _SAME_MM < height <= step.high + _SAME_MM
        if (down, up)[above]:
            return step.at(height), step.count
    return 0.0, 0


def list_heights(steps: Sequence[Frustum], *more: float) -> list[float]:
    """All heights at which steps begin or end, and `more` heights, ascending, each once."""
    every = np.sort([*more, *(h for step in steps for h in (step.low, step.high))])
    return [float(h) for h in every[np.diff(every, prepend=-np.inf) > _SAME_MM]]


def circumscribe_polygon(at: tuple[float, float], radius: float, sides: int) -> Array:
    """A regular polygon (k, 2), counter-clockwise, whose sides are tangent to a circle from outside."""
    return inscribe_polygon(at, radius / np.cos(np.pi / sides), sides)


def inscribe_polygon(at: tuple[float, float], radius: float, sides: int) -> Array:
    """A regular polygon (k, 2), counter-clockwise, with corners on a circle; the middle of one side faces +x."""
    angle = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    return np.asarray(np.array(at) + radius * np.column_stack([np.cos(angle), np.sin(angle)]))
