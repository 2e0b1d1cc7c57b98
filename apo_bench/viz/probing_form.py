"""The probing motions of a plan for a real robot: touches, squaring grips, laying flat, the spiral search.

All places and numbers are those of the simulation. Planes are in the frame of the base. Contact points and the pose of
a part in the hand are in the frame of the tip, even if other poses are those of the flange.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from apo_bench.assembly import Plan
from apo_bench.formats.json_forms import TO_MM_DEG
from apo_bench.formats.robot_frames import RobotFrames
from apo_bench.geometry import Array, pose
from apo_bench.records import FtNoise, parse_ft_noise
from apo_bench.simulation.execution import (
    OPEN_TO_PICK_M,
    STAND_OFF_M,
    Grip,
    Move,
    Transfer,
    plan_moves,
    search,
    search_laws,
)
from apo_bench.simulation.execution.probing import lay_flat, touching
from apo_bench.simulation.execution.probing.places import (
    OPENING_M,
    TouchPlace,
    floor_places,
    opposite_places,
    wall_places,
)
from apo_bench.simulation.execution.probing.state import FOOT_SIGMA_M, SQUARED, TOUCH_SIGMA_M, touch_guard
from apo_bench.simulation.robot import compute_low_pass_gain, filter_noise
from apo_bench.simulation.scene import Scene
from apo_bench.viz.robot_form import format_robot_pose, make_tip_form


def make_probing_form(plan: Plan, scene: Scene, frames: RobotFrames, sensor: str) -> dict[str, Any]:
    """Return the probing motions as a JSON object: mm, N, Nm, s, degrees and unit vectors.

    Args:
        frames: Frames of the robot that poses are converted to.
        sensor: Force-torque sensor of the wrist, as in `parse_ft_noise`.

    Raises:
        InputError: The sensor is unknown.
    """
    noise = parse_ft_noise(sensor)
    filtered = filter_noise(noise, compute_low_pass_gain())
    guard = touch_guard(filtered.force_n)
    touches = {"floor": floor_places, "walls": wall_places, "one_wall_from_both_sides": opposite_places}
    return {
        "sensor": {"name": sensor, "noise_n": noise.force_n, "noise_nm": noise.torque_nm},
        "touch": {
            "each_finger_open_mm": _to_mm(OPENING_M),
            "guard_n": round(guard, 6),
            "speed_mm_s": _to_mm(touching.SPEED),
            "expected_after_mm": _to_mm(STAND_OFF_M),
            "at_most_mm": _to_mm(2.0 * STAND_OFF_M + touching.BEYOND_M),
            "sigma_mm": _to_mm(TOUCH_SIGMA_M),
            **{
                name: [_make_touch_form(place, frames) for place in places(plan, scene)]
                for name, places in touches.items()
            },
        },
        "lay_flat": {
            "press_n": lay_flat.PRESS_N,
            "from_above_mm": _to_mm(lay_flat.NEAR_M),
            "yield_mm_s_per_n": _to_mm(lay_flat.YIELD_M),
            "fastest_mm_s": _to_mm(lay_flat.FASTEST),
            "fastest_deg_s": _to_deg(lay_flat.FASTEST_RAD),
            "lies_when": {
                "press_within_n": round(lay_flat.CALM * lay_flat.PRESS_N, 6),
                "turns_slower_than_deg_s": _to_deg(lay_flat.CALM_RAD),
                "for_s": lay_flat.CALM_S,
            },
            "gives_up": {"after_s": lay_flat.MOST_S, "below_begin_mm": _to_mm(lay_flat.DEEPEST_M)},
            "sigma_mm": _to_mm(FOOT_SIGMA_M),
        },
        "search": {
            "radius_mm": _to_mm(search.RADIUS_M),
            "pitch_mm": _to_mm(search_laws.PITCH_M),
            "then_turned_deg": list(search.YAWS_DEG),
            "radius_turned_mm": _to_mm(search.YAWED_RADIUS_M),
            "at_most_times": search.SEARCHES,
        },
        "squared_within_mm_deg": (SQUARED * TO_MM_DEG).round(6).tolist(),
        "steps": [_make_step_form(move, scene, frames, filtered) for move in plan_moves(plan, scene, True, True)],
    }


def _make_touch_form(place: TouchPlace, frames: RobotFrames) -> dict[str, Any]:
    """Return one touch: the tip's start, its direction, the contact patch in the tip's frame, the expected plane."""
    return {
        "from": make_tip_form(place.T_world_tip, frames),
        "direction": _rotate_to_base(place.direction, frames),
        "point_in_tip_mm": _point_in_mm(place.patch.mean(axis=0)),
        "corners_in_tip_mm": [_point_in_mm(corner) for corner in place.patch],
        **_make_plane_form(place.normal, place.offset, frames),
    }


def _make_step_form(move: Move, scene: Scene, frames: RobotFrames, filtered: FtNoise) -> dict[str, Any]:
    """Return the probing motions around one move of a part."""
    t = move.transfer
    first = t.grips[0]
    return {
        "operation": move.step.operation + 1,
        "undo": move.step.undo,
        "part": t.part,
        "square": [_make_grip_form(grip, t.T_world_start, scene, frames) for grip in t.squaring],
        "grasp_twice": _make_grip_form(first, t.T_world_start, scene, frames),
        "lay_flat": None if t.flat is None else _make_flat_placement_form(t, frames, filtered),
        "guards_n": {"down": round(t.place_n, 6), "insert": round(t.insert_n, 6), "slide": round(t.slide_n, 6)},
        "search_press_n": None if t.front is None else round(t.slide_n, 6),
    }


def _make_grip_form(grip: Grip, T: Array, scene: Scene, frames: RobotFrames) -> dict[str, Any]:
    """Return a grip on a part whose pose is T, (4, 4), world, [m]."""
    return {
        "at": make_tip_form(T @ grip.T_part_tip, frames),
        "each_finger_open_mm": _to_mm(min(grip.half_width + OPEN_TO_PICK_M, scene.arm.opening_m)),
        "closed_on_part_mm": _to_mm(grip.half_width),
    }


def _make_flat_placement_form(t: Transfer, frames: RobotFrames, filtered: FtNoise) -> dict[str, Any] | None:
    """Return how a part is laid flat on a surface, or None if the noise of the sensor is too large for that."""
    averaged = lay_flat.averaged_s(t.flat, filtered)
    if averaged > lay_flat.LONGEST_S:
        return None
    # a part that is regrasped while it is pulled out is then held by its second grip
    grip = t.grips[0 if t.out.left is None else 1]
    foot = pose.apply(t.flat.T, t.flat.feet[:1])[0]
    return {
        "when": "before the last motion" if t.into.level else "before it is carried",
        "at": make_tip_form(t.flat.T @ grip.T_part_tip, frames),
        "part_in_tip": format_robot_pose(pose.inverse(grip.T_part_tip), frames),
        "feet_in_part_mm": [_point_in_mm(foot) for foot in t.flat.feet],
        **_make_plane_form(t.flat.normal, float(t.flat.normal @ foot), frames),
        "yield_deg_s_per_nm": _to_deg(lay_flat.turn_yield(t.flat)),
        "averaged_over_s": round(averaged, 6),
        "then_walls": [
            {
                "from": make_tip_form(place.T @ grip.T_part_tip, frames),
                "direction": _rotate_to_base(place.direction, frames),
                "point_in_part_mm": _point_in_mm(place.point),
                **_make_plane_form(place.normal, float(place.normal @ place.edge), frames),
            }
            for place in t.side_touches
        ],
    }


def _make_plane_form(normal: Array, offset: float, frames: RobotFrames) -> dict[str, Any]:
    """Return the plane normal . x = offset in the frame of the base.

    Args:
        normal: Unit vector, (3,), world.
        offset: Of the plane in the world, [m].
    """
    return {
        "normal": _rotate_to_base(normal, frames),
        "offset_mm": _to_mm(offset - float(normal @ frames.T_world_base[:3, 3])),
    }


def _rotate_to_base(way: Array, frames: RobotFrames) -> list[float]:
    """Rotate a world vector, (3,), to the frame of the base."""
    return _round_values(frames.T_world_base[:3, :3].T @ way, 12)


def _point_in_mm(point: Array) -> list[float]:
    return _round_values(1e3 * point, 9)


def _round_values(values: Array | Sequence[float], digits: int) -> list[float]:
    return (np.round(values, digits) + 0.0).tolist()  # + 0.0 turns -0.0 into 0.0


def _to_mm(metres: float) -> float:
    return round(1e3 * metres, 9)


def _to_deg(radians: float) -> float:
    return round(float(np.degrees(radians)), 9)
