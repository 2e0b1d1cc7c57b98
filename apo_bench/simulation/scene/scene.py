"""Compile the MuJoCo models of a scenario, once per clearance, grasp, arm and time step (`Scene`)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, final

import mujoco

from apo_bench.arguments import check_arguments
from apo_bench.geometry import Piece, shrink_pieces
from apo_bench.records import Criteria, check
from apo_bench.scenario import Scenario, check_clearance
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.physics import Physics, physics
from apo_bench.simulation.scene.composing import fixed_parts, movable_parts, room_with_parts, with_arm, with_hands
from apo_bench.simulation.scene.holdable import check_holdable
from apo_bench.simulation.scene.world import World, disable_wrist_sensors, world

_Grasp = Literal["friction", "weld"]
_DROWSY_M_S = 5e-5
"""Speed below which parts fall asleep during a demonstration.

MuJoCo requires it for ten steps. Settling parts end within 2 micrometres of their pose without sleep.
"""


@final
@check_arguments
@dataclass(frozen=True, eq=False)
class Scene:
    """The compiled MuJoCo models of a scenario; any number of trials can use one scene."""

    scenario: Scenario
    """The scenario that was compiled."""
    clearance_mm: float
    """Clearance per side of parts that fit."""
    grasp: _Grasp
    """`friction` or `weld`."""
    arm: Arm
    """The robot arm with its gripper."""
    physics: Physics
    """Time step and solver settings."""
    pieces: Mapping[str, tuple[Piece, ...]]
    """Part -> its convex pieces, with clearance."""
    shown: World
    """The model in which the human demonstrates: parts and hands."""
    work: World
    """The model in which the robot replays: parts and arm."""
    kinematics: Kinematics
    """Inverse kinematics of the arm."""

    @property
    def criteria(self) -> Criteria:
        """The thresholds and the rule by which the judge decides."""
        return Criteria(self.scenario.thresholds, self.clearance_mm, self.scenario.success_means)


@check_arguments
def build_scene(
    scenario: Scenario,
    *,
    clearance_mm: float | None = None,
    grasp: str = "friction",
    arm: str | Arm = "six_axis",
    timestep_s: float = 0.001,
) -> Scene:
    """Compile a scenario to MuJoCo models.

    Args:
        scenario: From `load_scenario`.
        clearance_mm: Clearance per side of parts that fit. Default: that of the scenario.
        grasp: `friction`, or `weld` for an ideal gripper.
        arm: A name (`apo-bench arm list`), an arm file, or an `Arm`.
        timestep_s: Time step of the physics: 0.001, or 0.0005 to check.

    Returns:
        A scene for `demonstrate`, `replay` and pictures.

    Raises:
        InputError: Unknown grasp or arm, a clearance that a part cannot have or that leaves a shaft no play, a time
            step other than these, a part that the gripper cannot hold.

    Examples:
        >>> import apo_bench
        >>> scene = apo_bench.build_scene(apo_bench.load_scenario("block_on_block"), clearance_mm=0.1)
        >>> scene.criteria.clearance_mm
        0.1
    """
    check("grasp", grasp)
    clearance = scenario.clearance_mm if clearance_mm is None else clearance_mm
    check_clearance(scenario, clearance)
    robot = find_arm(arm)
    settings = physics(timestep_s)
    kinematics = Kinematics(robot)
    room = room_with_parts(scenario, clearance, settings)
    shown = _compiled(scenario, with_hands(room, scenario))
    shown.model.opt.sleep_tolerance = _DROWSY_M_S
    work = _compiled(scenario, with_arm(room, scenario, settings, robot, grasp, kinematics))
    disable_wrist_sensors(work.model)
    if grasp == "friction":
        check_holdable(scenario, work, robot)
    return Scene(
        scenario=scenario,
        clearance_mm=clearance,
        grasp="weld" if grasp == "weld" else "friction",
        arm=robot,
        physics=settings,
        pieces={name: shrink_pieces(s, clearance * 1e-3) for name, s in scenario.assembly.solids.items()},
        shown=shown,
        work=work,
        kinematics=kinematics,
    )


def scene_xml(
    scenario: Scenario,
    *,
    clearance_mm: float | None = None,
    grasp: str = "friction",
    arm: str | Arm = "six_axis",
    timestep_s: float = 0.001,
) -> str:
    """The replay world as MJCF text that opens in MuJoCo's viewer, with every part at its start.

    MuJoCo writes six digits, so the benchmark compiles no model from this text.
    """
    scene = build_scene(scenario, clearance_mm=clearance_mm, grasp=grasp, arm=arm, timestep_s=timestep_s)
    room = room_with_parts(scenario, scene.clearance_mm, scene.physics)
    spec = with_arm(room, scenario, scene.physics, scene.arm, scene.grasp, scene.kinematics)
    spec.compile()
    return str(spec.to_xml())


def _compiled(scenario: Scenario, spec: Any) -> World:
    """Compile a world; MuJoCo must not reset an unstable simulation by itself, since the trial has to fail."""
    model = spec.compile()
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return world(model, movable_parts(scenario), fixed_parts(scenario))
