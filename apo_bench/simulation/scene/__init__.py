"""The scene: room, parts and arm as MuJoCo models, pictures of them, and where parts come to rest when let go."""

from apo_bench.simulation.scene.composing import HANDS
from apo_bench.simulation.scene.marks import Marks, ShiftArrows, TurnRing, pixels
from apo_bench.simulation.scene.render import (
    aim_camera,
    arm_home,
    check_film,
    copy_data,
    data_with_arm,
    draw_picture,
    place_for_picture,
    save_film,
)
from apo_bench.simulation.scene.scene import Scene, build_scene
from apo_bench.simulation.scene.world import (
    WRIST_SENSORS,
    World,
    allow_sleep,
    has_failed,
    initial_state,
    is_unstable,
    part_pose,
    sensors_off,
    set_part_pose,
    snapshot,
    timestep,
    touches_others,
    wake,
    wrist_sensors_on,
)

__all__ = (
    "HANDS",
    "WRIST_SENSORS",
    "Marks",
    "Scene",
    "ShiftArrows",
    "TurnRing",
    "World",
    "aim_camera",
    "allow_sleep",
    "arm_home",
    "build_scene",
    "check_film",
    "copy_data",
    "data_with_arm",
    "draw_picture",
    "has_failed",
    "initial_state",
    "is_unstable",
    "part_pose",
    "pixels",
    "place_for_picture",
    "save_film",
    "sensors_off",
    "set_part_pose",
    "snapshot",
    "timestep",
    "touches_others",
    "wake",
    "wrist_sensors_on",
)
