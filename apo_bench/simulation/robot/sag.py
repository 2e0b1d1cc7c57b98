"""How far the joints of an arm yield to its own weight, behind their encoders.

Each joint turns by its compliance times the torque of the weight. Compliances are in proportion to those of the servos.
"""

import numpy as np

from apo_bench.geometry import Array
from apo_bench.simulation.scene import Scene


def compute_sag_per_metre(scene: Scene) -> Array:
    """Return the compliance of each joint, (joints,), [rad/(N m)], with which the tip hangs 1 m lower, to first order.

    The height counts over the middle of the nominal target poses, or at home if the arm does not reach it.
    """
    kinematics = scene.kinematics
    model = scene.work.model
    home = np.array(scene.arm.home)
    over = kinematics.forward(home)
    over[:3, 3] = scene.scenario.nominal_poses[:, :3, 3].mean(axis=0)
    there = kinematics.inverse(over, home)
    q = home if there is None else there
    softness = 1.0 / model.actuator_gainprm[[model.actuator(f"arm/{name}").id for name in scene.arm.joints], 0]
    lowered = kinematics.forward(q)[2, :3] @ (kinematics.jacobian(q)[:3] @ (softness * kinematics.gravity_torque(q)))
    return np.asarray(softness / lowered)
