"""Where to hold a part, chosen from the planned poses so that the gripper strikes nothing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.intrusion import depths
from apo_bench.geometry.solid import Box, Solid
from apo_bench.program import Poses
from apo_bench.scenario import Grasp
from apo_bench.simulation.gripper import gripper_boxes
from apo_bench.simulation.scene import Scene

STAND_OFF_M = 0.012
"""How far each finger stands off the part before it closes or after it has let go."""
MARGINS_M = (0.004, 0.003, 0.002)
"""Room around the gripper, as much as there is."""
GRID_M = 0.003
"""Candidates along a part, and looks along a stroke, are this far apart."""
END_M = 0.034
"""No grasp is nearer to the end of a long part."""
HEIGHT = 0.65
"""Height of the tip over the part's lowest point, as a part of its height."""


class Obstacle(NamedTuple):
    """A part that rests while another is moved."""

    boxes: tuple[Box, ...]
    T: Array


class Place(NamedTuple):
    """The part at rest, and what stands around it."""

    T: Array
    around: tuple[Obstacle, ...]


class Stroke(NamedTuple):
    """A straight way of the part to `T`."""

    T: Array
    way: Array
    """Unit vector, (3,), world."""
    travel: float
    around: tuple[Obstacle, ...]


class Grips(NamedTuple):
    """One grasp for a whole stroke, or two with a change of grip `left` before its end."""

    first: Grasp
    left: float | None = None
    second: Grasp | None = None


def obstacles(solids: Mapping[str, Solid], poses: Poses, without: Sequence[str]) -> tuple[Obstacle, ...]:
    """Every part but these, where it is believed to be."""
    return tuple(Obstacle(solid.boxes, poses[part]) for part, solid in solids.items() if part not in without)


def grasp_at(scene: Scene, part: str, preferred: Grasp, places: Sequence[Place]) -> Grasp:
    """The first grasp at which the open gripper is clear at every place; the preferred one if there is none."""
    if _clear_everywhere(scene, part, preferred, places, MARGINS_M[-1]):
        return preferred
    for margin in MARGINS_M:
        for grasp in _candidates(scene, part, places[0].T):
            if _clear_everywhere(scene, part, grasp, places, margin):
                return grasp
    return preferred


def clear_across(scene: Scene, part: str, across: Array, place: Place) -> Grasp | None:
    """The first clear grasp that closes along a direction of the part, or None."""
    for margin in MARGINS_M:
        for grasp in _candidates(scene, part, place.T):
            if abs(grasp.across @ across) > 0.99 and _clear(scene, part, grasp, place, margin):
                return grasp
    return None


def grips_along(scene: Scene, part: str, preferred: Grasp, places: Sequence[Place], stroke: Stroke) -> Grips:
    """The grasp for a stroke; if the gripper would strike something on the way, one to begin and one to end with.

    Both are clear at the change of grip, with fingers open, and on their part of the way, with fingers closed.

    Args:
        places: Where the part is picked up or put down besides, clear for either grasp that is used there.
    """
    ends = (*places, Place(stroke.T, stroke.around))
    least = MARGINS_M[-1]
    if _clear_everywhere(scene, part, preferred, ends, least) and not _nearest(scene, part, preferred, stroke, least):
        return Grips(preferred)
    for margin in MARGINS_M:
        able = [
            (grasp, _nearest(scene, part, grasp, stroke, margin))
            for grasp in _candidates(scene, part, places[0].T)
            if _clear_everywhere(scene, part, grasp, places, margin)
        ]
        for grasp, left in able:
            if left == 0.0 and _clear_everywhere(scene, part, grasp, ends, margin):
                return Grips(grasp)
        found = _pair(scene, part, stroke, sorted(able, key=lambda pair: pair[1])[:8], margin)
        if found is not None:
            return found
    return Grips(preferred)


def tip_frame(grasp: Grasp, T_part: Array) -> Array:
    """The tip in the part's frame, (4, 4): looking down where the part stands like this, closing along `across`."""
    ahead = T_part[:3, :3].T @ np.array([0.0, 0.0, -1.0])
    T = np.eye(4)
    T[:3, 0], T[:3, 1], T[:3, 2], T[:3, 3] = grasp.across, np.cross(ahead, grasp.across), ahead, grasp.point
    return T


def half_width(solid: Solid, grasp: Grasp) -> float:
    """Half the nominal part's width between the fingers, [m]."""
    low, high = solid.bounds
    return float(np.abs(grasp.across) @ (high - low)) / 2


def _pair(scene: Scene, part: str, stroke: Stroke, able: Sequence[tuple[Grasp, float]], margin: float) -> Grips | None:
    goal = Place(stroke.T, stroke.around)
    for first, left in able:
        if left >= stroke.travel:
            continue
        change = Place(_back(stroke, left), stroke.around)
        if not _clear(scene, part, first, change, margin):
            continue
        for second in _candidates(scene, part, stroke.T):
            if _clear_everywhere(scene, part, second, (goal, change), margin):
                near = Stroke(stroke.T, stroke.way, left, stroke.around)
                if _nearest(scene, part, second, near, margin) == 0.0:
                    return Grips(first, left, second)
    return None


def _candidates(scene: Scene, part: str, T: Array) -> Iterator[Grasp]:
    """Across either level axis, the narrower one first, from the middle outwards."""
    solid = scene.scenario.assembly.solids[part]
    low, high = solid.bounds
    size, middle = high - low, (high + low) / 2
    up = int(np.abs(T[2, :3]).argmax())
    rise = np.sign(T[2, up]) * (HEIGHT - 0.5) * size[up] * np.eye(3)[up]
    level = sorted((axis for axis in range(3) if axis != up), key=lambda axis: size[axis])
    for axis in level:
        if size[axis] / 2 + STAND_OFF_M / 2 > scene.arm.opening_m:
            continue
        along = next(other for other in level if other != axis)
        reach = max(0.0, size[along] / 2 - END_M)
        for offset in sorted(np.arange(-reach, reach + 1e-9, GRID_M) if reach > GRID_M else [0.0], key=abs):
            yield Grasp(middle + rise + offset * np.eye(3)[along], np.eye(3)[axis])


def _clear_everywhere(scene: Scene, part: str, grasp: Grasp, places: Sequence[Place], margin: float) -> bool:
    return all(_clear(scene, part, grasp, place, margin) for place in places)


def _clear(scene: Scene, part: str, grasp: Grasp, place: Place, margin: float) -> bool:
    """Whether the open gripper, about to close or having let go, strikes nothing."""
    width = half_width(scene.scenario.assembly.solids[part], grasp)
    opening = min(width + STAND_OFF_M, scene.arm.opening_m)
    return bool(_depth(scene, grasp, opening, place.T[None], place.around, margin)[0] <= 0.0)


def _nearest(scene: Scene, part: str, grasp: Grasp, stroke: Stroke, margin: float) -> float:
    """How near to its end the closed gripper comes along a stroke before it strikes something, [m]; 0 if it arrives."""
    width = half_width(scene.scenario.assembly.solids[part], grasp)
    lefts = np.linspace(stroke.travel, 0.0, max(2, round(stroke.travel / GRID_M) + 1))
    poses = np.array([_back(stroke, left) for left in lefts])
    struck = _depth(scene, grasp, width, poses, stroke.around, margin) > 0.0
    if not struck.any():
        return 0.0
    first = int(np.argmax(struck))
    return float(lefts[max(0, first - 1)])


def _depth(
    scene: Scene, grasp: Grasp, opening: float, T_part: Array, around: Sequence[Obstacle], margin: float
) -> Array:
    """How deep the gripper is in what stands around, at each of the poses of the part, (k,), [m]."""
    boxes = gripper_boxes(scene.kinematics, scene.arm, opening, margin)
    T_tip = T_part @ tip_frame(grasp, T_part[0])
    at, R = T_tip[:, :3, 3], T_tip[0, :3, :3]
    return np.max([depths(boxes, R, at, each.boxes, each.T) for each in around], axis=0, initial=-1.0)


def _back(stroke: Stroke, left: float) -> Array:
    """The part `left` before the end of a stroke."""
    T = np.array(stroke.T)
    T[:3, 3] -= left * stroke.way
    return T
