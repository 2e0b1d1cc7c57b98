"""Choose the grasp of a part from planned poses, so that the gripper collides with nothing."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array, Solid, all_boxes, find_holds, holds_whole_width, remember
from apo_bench.scenario.scenario import Grasp
from apo_bench.simulation.execution.grasp_clearance import (
    GRID_M,
    MARGINS_M,
    STAND_OFF_M,
    RestingPart,
    Stroke,
    closed_gripper_depth,
    find_clear_grasp,
    list_clear_grasps,
    measure_stop_distance,
)
from apo_bench.simulation.execution.grasp_frame import upwards
from apo_bench.simulation.robot import translate
from apo_bench.simulation.scene import Scene

_END_M = 0.018
"""Least distance of a grasp from the end of a long part, so that the whole pads lie on it."""
_MOST_LEFT_M = 0.1
"""Greatest distance to the goal at a change of grip, so that the part already lies in its hole or slot."""
_HEIGHT = 0.65
"""Height of the grasp over the part's lowest point, as a fraction of the part's height."""


class Grips(NamedTuple):
    """One grasp for a whole stroke, or two with a change of grip `left`, [m], before its end."""

    first: Grasp
    left: float | None = None
    second: Grasp | None = None


def grasp_at(scene: Scene, part: str, preferred: Grasp, places: Sequence[RestingPart]) -> Grasp:
    """Return the preferred grasp if the open gripper is clear at every place, else the first candidate that is.

    If none is clear, the preferred one is returned.
    """
    solid = scene.scenario.assembly.solids[part]
    if any(list_clear_grasps(scene.kinematics, solid, [preferred], places, MARGINS_M[-1])):
        return preferred
    return find_clear_grasp(scene.kinematics, solid, _candidates(scene, solid, places[0].T), places) or preferred


def clear_across(scene: Scene, part: str, across: Array, place: RestingPart) -> Grasp | None:
    """Return the first clear grasp that closes along the level component of a direction, or None.

    It is clear open and closed, since fingers that close flush with a wall next to the part jam against it.

    Args:
        across: Direction in the frame of the part, (3,); its sign does not matter.
    """
    up = upwards(place.T)
    level = across - (across @ up) * up  # without its vertical part
    level /= np.linalg.norm(level)
    stays = Stroke(place.T, up, 0.0, place.around)  # of length zero, to check the closed gripper
    solid = scene.scenario.assembly.solids[part]
    able = [grasp for grasp in _candidates(scene, solid, place.T) if abs(grasp.across @ level) > 0.99]
    able = [
        grasp
        for grasp in able
        if closed_gripper_depth(scene.kinematics, solid, grasp, stays, np.zeros(1), MARGINS_M[-1])[0] <= 0.0
    ]
    return find_clear_grasp(scene.kinematics, solid, able, [place])


def grips_along(scene: Scene, part: str, preferred: Grasp, places: Sequence[RestingPart], stroke: Stroke) -> Grips:
    """Return one grasp that is clear along a whole stroke, else two with a change of grip on the way.

    Of two, each is clear with closed fingers on its part of the stroke, and both with open fingers at the change. The
    preferred grasp is tried first, and returned if nothing is clear.

    Args:
        places: Further places at which the part is picked up or put down, before the stroke.
        stroke: A straight motion to the goal; the part can also be pulled out backwards along it.
    """
    ends = (*places, RestingPart(stroke.T, stroke.around))
    solid = scene.scenario.assembly.solids[part]
    least = MARGINS_M[-1]
    if any(list_clear_grasps(scene.kinematics, solid, [preferred], ends, least)) and not measure_stop_distance(
        scene.kinematics, solid, preferred, stroke, least
    ):
        return Grips(preferred)
    everything = _candidates(scene, solid, places[0].T)
    if one := find_clear_grasp(scene.kinematics, solid, everything, ends, [stroke]):
        return Grips(one)
    for margin in MARGINS_M:
        able = [
            (measure_stop_distance(scene.kinematics, solid, grasp, stroke, margin), grasp)
            for grasp in list_clear_grasps(scene.kinematics, solid, everything, places, margin)
        ]
        pair = _pair(scene, solid, stroke, sorted(able, key=lambda pair: -pair[0]), margin)
        if pair is not None:
            return pair
    return Grips(preferred)


def _pair(
    scene: Scene, solid: Solid, stroke: Stroke, able: Sequence[tuple[float, Grasp]], margin: float
) -> Grips | None:
    """Return the first pair of grasps with a change of grip on the way, or None.

    Args:
        able: First grasps, each with the distance from the end at which the gripper collides, [m], best first.
        margin: Room around the gripper, [m].
    """
    goal = RestingPart(stroke.T, stroke.around)
    last = list(list_clear_grasps(scene.kinematics, solid, _candidates(scene, solid, stroke.T), [goal], margin))
    for left, first in able:
        change = RestingPart(translate(stroke.T, stroke.direction, -left), stroke.around)
        # The change happens where the first grasp must stop, if the open gripper is clear there.
        if 0.0 < left < _MOST_LEFT_M and any(list_clear_grasps(scene.kinematics, solid, [first], [change], margin)):
            near = Stroke(stroke.T, stroke.direction, left, stroke.around)
            for second in list_clear_grasps(scene.kinematics, solid, last, [change], margin):
                if measure_stop_distance(scene.kinematics, solid, second, near, margin) == 0.0:
                    return Grips(first, left, second)
    return None


def _candidates(scene: Scene, solid: Solid, T: Array) -> tuple[Grasp, ...]:
    """Return candidate grasps of a part at T, best first."""
    return _list_candidates(solid, tuple(upwards(T).tolist()), scene.arm.opening_m)


@remember
def _list_candidates(solid: Solid, vertical: tuple[float, ...], opening_m: float) -> tuple[Grasp, ...]:
    """Return candidate grasps of a part, best first; cached, since a plan asks for them several times.

    They lie on the bounding box if the part consists of boxes and all of them hold its full width. Else they are found
    from the shape.

    Args:
        vertical: The vertical in the frame of the part, (3,).
        opening_m: Widest opening per finger.
    """
    up = np.array(vertical)
    if all_boxes(solid.pieces):
        around = _around_box(solid, up, opening_m)
        if around and all(holds_whole_width(solid.pieces, grasp.point, grasp.across, up) for grasp in around):
            return around
    return tuple(Grasp(*hold) for hold in find_holds(solid, up, opening_m))


def _around_box(solid: Solid, vertical: Array, opening_m: float) -> tuple[Grasp, ...]:
    """Return grasps across both level axes of the bounding box, the narrower one first, from the middle outwards."""
    low, high = solid.bounds
    size = high - low
    middle = (high + low) / 2
    up = int(np.abs(vertical).argmax())
    # From the middle of the box up to the height of the tip, in the frame of the part.
    rise = np.sign(vertical[up]) * (_HEIGHT - 0.5) * size[up] * np.eye(3)[up]
    # For each level axis across which the fingers close, the candidates are spread along the other one.
    level = sorted((axis for axis in range(3) if axis != up), key=lambda axis: size[axis])
    grasps = []
    for axis, along in (level, level[::-1]):
        reach = max(0.0, size[along] / 2 - _END_M)
        offsets = np.arange(-reach, reach + 1e-9, GRID_M) if reach > GRID_M else np.zeros(1)
        if size[axis] / 2 + STAND_OFF_M / 2 <= opening_m:
            for offset in sorted(offsets, key=abs):
                grasps.append(Grasp(middle + rise + offset * np.eye(3)[along], np.eye(3)[axis]))
    return tuple(grasps)
