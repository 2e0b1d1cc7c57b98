"""Check an arm at the table of a scenario: reach, tip errors, stiffness, grip force, joint limits."""

from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.assembly import Plan
from apo_bench.errors import InputError
from apo_bench.geometry import Array
from apo_bench.scenario import Scenario, draw_layout
from apo_bench.simulation.arm_checks.tip_error import SPEEDS, STAND_S, STRETCH_M, TipError, error_on, rise, trace
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.home import tip_down
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.execution import plan_moves, solve_key_angles
from apo_bench.simulation.robot import (
    ExecutionAborted,
    Robot,
    measure_turn,
    plan_steady_trajectory,
    smooth_trajectory,
    translate,
)
from apo_bench.simulation.scene import Scene, build_scene

# Positions over the table, [m].
_GRID = [(x, y) for x in np.arange(-0.3, 0.41, 0.1) for y in np.arange(-0.4, 0.41, 0.1)]
_TABLE_M = 0.03  # height of the tip over the table
_TURNS = (-1.2, 0.0, 1.2)  # yaws of the tip relative to home, [rad], that are tried
_PUSH_N = 5.0  # force by which stiffness is measured
_PUSH_S = 0.5  # duration of that force
_LAYOUTS = 20  # drawn layouts whose plans are checked
_LEAST_FORCE_N = 10.0
"""Least force of each pad; below it parts slip."""
_LEAST_MARGIN_DEG = 5.0  # least distance of a joint from its limit


@final
@dataclass(frozen=True, eq=False)
class ArmCheck:
    """The measurements of an arm at the table of a scenario."""

    arm: Arm
    scenario: str
    reached: Array
    """(k, 3): x, y [m] of a grid over the table, and the share of yaws that are in reach there."""
    tip_errors: tuple[TipError, ...]
    rest_error_mm: float
    """Error of the tip after it has come to rest."""
    mm_per_n: tuple[float, float, float]
    """Displacement of the tip per newton along x, y, z of the world."""
    opening_mm: float
    force_n: float
    """Force of each pad."""
    margins_deg: Array
    """(joints,), the least distance of each joint from its limits over the plans in reach; infinite for a joint without
    limits; not a number if no plan is in reach."""
    layouts: int
    layouts_reached: int
    clearance_mm: float
    missing: tuple[str, ...]
    """Missing data and insufficient values, each with the remedy."""


def check_arm(arm: Arm, scenario: Scenario, layouts: int = _LAYOUTS) -> ArmCheck:
    """Measure an arm at the table of a scenario.

    Args:
        layouts: Number of drawn layouts whose plans are checked.
    """
    missing = missing_data(arm)
    try:
        scene = build_scene(scenario, arm=arm)
    except InputError as error:
        scene = build_scene(scenario, arm=arm, grasp="weld")
        missing.append(str(error))
    reached = _reach(scene.kinematics, arm)
    errors, rest, soft = _errors(scene)
    force = _force(arm, scene)
    drawn = [draw_layout(scenario, np.random.default_rng([seed, 0])) for seed in range(layouts)]
    of_layouts = [_margins(scene, Plan(scenario.assembly, each.start, each.poses)) for each in drawn]
    in_reach = [each for each in of_layouts if not np.isnan(each).any()]
    margins = np.min(in_reach or of_layouts, axis=0)
    across = max((each.across_mm for each in errors if each.speed < SPEEDS[-1]), default=0.0)
    if not errors:
        missing.append("the tip has no line of 150 mm aside of its home; move 'base' or state 'home_deg'.")
    if across > scene.clearance_mm:
        missing.append(
            f"the tip goes up to {across:.2f} mm beside its line and the clearance is {scene.clearance_mm:g} mm; "
            "give its motors more 'armature' in the MJCF, so that its servos get stiffer, or make the clearance larger."
        )
    if force < _LEAST_FORCE_N:
        missing.append(f"each pad pushes with {force:.1f} N; parts slip below some {_LEAST_FORCE_N:g} N.")
    if len(in_reach) < layouts:
        missing.append(
            f"{layouts - len(in_reach)} of {layouts} layouts are not reached; move 'base' nearer, or state another "
            "'home_deg'."
        )
    if np.nanmin(margins, initial=np.inf) < _LEAST_MARGIN_DEG:
        joint = arm.joints[int(np.nanargmin(margins))]
        missing.append(
            f"the joint '{joint}' comes near its limit along the plan; state another 'home_deg' or turn 'base'."
        )
    return ArmCheck(
        arm=arm,
        scenario=scenario.name,
        reached=reached,
        tip_errors=errors,
        rest_error_mm=rest,
        mm_per_n=soft,
        opening_mm=2e3 * arm.opening_m,
        force_n=force,
        margins_deg=margins,
        layouts=layouts,
        layouts_reached=len(in_reach),
        clearance_mm=scene.clearance_mm,
        missing=tuple(missing),
    )


def missing_data(arm: Arm) -> list[str]:
    """Data that the files of an arm do not state, each with the consequence."""
    missing = []
    if arm.limits.payload_kg is None:
        missing.append("no payload is stated ('payload_kg'): all is lifted that friction holds.")
    if arm.limits.speed_rad_s is None:
        missing.append("no speed of the joints is stated ('speed_deg_s'): none is kept.")
    if arm.limits.torque_nm is not None and not np.isfinite(arm.limits.torque_nm).all():
        missing.append("the torque of a joint has no limit in the model; state 'torque_nm'.")
    if arm.hand is not None and not arm.hand.graded:
        missing.append("the gripper knows open and closed only: it opens fully beside other parts.")
    return missing


def _reach(kinematics: Kinematics, arm: Arm) -> Array:
    """`ArmCheck.reached`, by inverse kinematics."""
    rows = []
    rest = measure_turn(tip_down(np.zeros(3)), kinematics.forward(arm.home))
    for x, y in _GRID:
        q = np.array(arm.home)
        reached = 0
        for turn in _TURNS:
            reached += kinematics.inverse(tip_down(np.array([x, y, _TABLE_M]), rest + turn), q, 25) is not None
        rows.append((x, y, reached / len(_TURNS)))
    return np.array(rows)


def _errors(scene: Scene) -> tuple[tuple[TipError, ...], float, tuple[float, float, float]]:
    """The tip errors of an arm in free air.

    Returns:
        (errors at `SPEEDS`, error at rest [mm], displacement per newton along x, y, z [mm/N]); () and not a number if
        the arm has no such line in reach.
    """
    robot = Robot(scene, scene.scenario.start)
    errors = []
    try:
        with robot.watch_stability():
            rise(robot, 0.3)
            for i, speed in enumerate(SPEEDS):
                # A tenth of the line at the lowest speed, which would take too long.
                length = STRETCH_M if speed > SPEEDS[0] else STRETCH_M / 10
                end = translate(robot.T, np.array([0.0, 1.0 if i % 2 else -1.0, 0.0]), length)
                line = (
                    smooth_trajectory(robot.T, end, speed)
                    if speed == SPEEDS[-1]
                    else plan_steady_trajectory(robot.T, end, speed)
                )
                errors.append(error_on(line, trace(robot, line), speed))
                robot.wait(STAND_S)
            rest = float(np.linalg.norm(_push(robot, np.zeros(3)) - robot.T[:3, 3]))
            before = _push(robot, np.zeros(3))
            x, y, z = (1e3 * abs(float((_push(robot, _PUSH_N * a) - before) @ a)) / _PUSH_N for a in np.eye(3))
    except ExecutionAborted:
        return (), np.nan, (np.nan, np.nan, np.nan)
    return tuple(errors), 1e3 * rest, (x, y, z)


def _push(robot: Robot, force: Array) -> Array:
    """The position of the tip, (3,), world frame, [m], after a force [N] has acted on it for `_PUSH_S`."""
    body = robot.model.body(f"arm/{robot.arm.mount}").id
    robot.data.xfrc_applied[body, :3] = force
    # Moment of the force about the body's centre of mass.
    robot.data.xfrc_applied[body, 3:] = np.cross(robot.tip()[:3, 3] - robot.data.xipos[body], force)
    robot.wait(_PUSH_S)
    robot.data.xfrc_applied[body] = 0.0
    return robot.tip()[:3, 3]


def _force(arm: Arm, scene: Scene) -> float:
    """The force of each pad, [N]; slides that one actuator drives together share its force."""
    if arm.hand is not None:
        return arm.hand.force_n
    return float(scene.work.model.actuator(f"arm/{arm.grip}").forcerange[1]) / len(arm.fingers)


def _margins(scene: Scene, plan: Plan) -> Array:
    """The least distance of each joint from its limits along a plan, (joints,), [deg]; not a number if out of reach."""
    least = np.full(len(scene.arm.joints), np.inf)
    for move in plan_moves(plan, scene, False):
        angles = solve_key_angles(move.transfer, scene)
        if angles.code:
            return np.full(len(least), np.nan)
        least = np.minimum(least, np.min(list(map(scene.kinematics.limit_margins, angles.reached)), axis=0))
    return np.degrees(least)
