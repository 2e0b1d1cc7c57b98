"""The only room that knows MuJoCo, mink and dm-control: scenes, hands, the arm, replay, pictures."""

from apo_bench.simulation.scene.graphics import import_mujoco

import_mujoco()
