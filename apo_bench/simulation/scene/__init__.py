"""Scenes: the parts of a scenario with human hands or an arm, as compiled MuJoCo models."""

from apo_bench.simulation.scene.clamps import list_clamps, release_clamp, weld_clamp
from apo_bench.simulation.scene.composing import HANDS
from apo_bench.simulation.scene.kept_renderer import KeptRenderer
from apo_bench.simulation.scene.marks import Marks, ShiftArrows, TurnRing, project_to_pixels
from apo_bench.simulation.scene.render import (
    aim_camera,
    build_data,
    build_data_with_arm,
    check_film,
    copy_data,
    draw_picture,
    move_arm_home,
    place_for_picture,
    save_film,
)
from apo_bench.simulation.scene.scaled_physics import PhysicsScale, ScaledPhysics
from apo_bench.simulation.scene.scene import Scene, build_scene
from apo_bench.simulation.scene.world import (
    WRIST_SENSORS,
    World,
    allow_sleep,
    compute_only,
    get_part_pose,
    has_failed,
    is_unstable,
    make_initial_state,
    move_part,
    set_part_pose,
    switch_wrist_sensors_on,
    take_snapshot,
    touches_others,
    use_timestep,
    wake,
)
from apo_bench.simulation.scene.wrist_camera import WRIST_CAMERA

__all__ = (
    "HANDS",
    "WRIST_CAMERA",
    "WRIST_SENSORS",
    "KeptRenderer",
    "Marks",
    "PhysicsScale",
    "ScaledPhysics",
    "Scene",
    "ShiftArrows",
    "TurnRing",
    "World",
    "aim_camera",
    "allow_sleep",
    "build_data",
    "build_data_with_arm",
    "build_scene",
    "check_film",
    "compute_only",
    "copy_data",
    "draw_picture",
    "get_part_pose",
    "has_failed",
    "is_unstable",
    "list_clamps",
    "make_initial_state",
    "move_arm_home",
    "move_part",
    "place_for_picture",
    "project_to_pixels",
    "release_clamp",
    "save_film",
    "set_part_pose",
    "switch_wrist_sensors_on",
    "take_snapshot",
    "touches_others",
    "use_timestep",
    "wake",
    "weld_clamp",
)
