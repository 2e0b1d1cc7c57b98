"""The gripper of two sliding fingers that is found in the model of an arm."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from apo_bench.errors import InputError
from apo_bench.resources import folder
from apo_bench.scenario import load_scenario
from apo_bench.simulation.arms.building import read_arm
from apo_bench.simulation.robot.gripper import open_hand
from apo_bench.simulation.scene import build_scene

LENGTHS_M = (0.2, 0.1, 0.4, 0.35, 0.08, 0.08)
AXES = ("0 0 1", "0 1 0", "0 1 0", "0 1 0", "0 0 1", "0 1 0")
INERTIAL = '<inertial><mass value="{}"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>'
COLLISION = "<collision><geometry>{}</geometry></collision>"


def link(name: str, mass: float, shape: str) -> str:
    return f'<link name="{name}">{INERTIAL.format(mass)}{COLLISION.format(shape)}</link>'


def joint(name: str, kind: str, parent: str, child: str, at: str, axis: str, low: float, high: float) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/>'
        f'<axis xyz="{axis}"/><limit lower="{low}" upper="{high}" effort="100" velocity="3"/></joint>'
    )


def write_arm(place: Path, second: str = "-1 0 0", low: float = 0.0, high: float = 0.045) -> Path:
    """Write an arm of six hinges with two fingers, and its arm file, which states no more than the model."""
    body = [link(f"l{k}", 1.0, '<cylinder radius="0.03" length="0.05"/>') for k in range(7)]
    body += [link(name, 0.1, '<box size="0.01 0.02 0.05"/>') for name in ("left", "right")]
    for k, (length, axis) in enumerate(zip(LENGTHS_M, AXES, strict=True)):
        body.append(joint(f"j{k}", "revolute", f"l{k}", f"l{k + 1}", f"0 0 {length}", axis, -3.0, 3.0))
    body.append(joint("f1", "prismatic", "l6", "left", "0.005 0 0.1", "1 0 0", 0.0, 0.045))
    body.append(joint("f2", "prismatic", "l6", "right", "-0.005 0 0.1", second, low, high))
    (place / "arm.urdf").write_text(f'<robot name="six">{"".join(body)}</robot>')
    path = place / "arm.toml"
    path.write_text('schema = "apo-bench/arm/1"\nmjcf = "arm.urdf"\n')
    return path


@pytest.mark.parametrize(("second", "low", "high"), [("-1 0 0", 0.0, 0.045), ("1 0 0", -0.045, 0.0)])
def test_the_fingers_of_a_urdf_arm_are_found_coupled_and_driven(
    tmp_path: Path, second: str, low: float, high: float
) -> None:
    arm = read_arm(write_arm(tmp_path, second, low, high))
    assert arm.hand is not None
    assert arm.hand.joints == ("f1", "f2")
    assert arm.hand.opening[1] == pytest.approx(0.0, abs=1e-9), "the pads touch when closed"
    assert arm.opening_m == pytest.approx(0.045, abs=1e-9)
    assert arm.hand.force_n == 20.0
    scene = build_scene(load_scenario("block_on_block"), arm=arm)
    data, T_tip = open_hand(scene.kinematics, 0.02)
    pads = np.array([data.geom_xpos[scene.kinematics.model.geom(name).id] for name in arm.hand.pads])
    # Pads of 10 mm are 40 mm apart, and their ends are 10 mm beyond the tip.
    np.testing.assert_allclose(
        (pads - T_tip[:3, 3]) @ T_tip[:3, :3], [[0.025, 0, -0.015], [-0.025, 0, -0.015]], atol=1e-9
    )


def test_the_drive_opens_both_fingers_by_its_command(tmp_path: Path) -> None:
    arm = read_arm(write_arm(tmp_path))
    model = mujoco.MjModel.from_xml_string(str(arm.model))
    data = mujoco.MjData(model)
    data.ctrl[model.actuator("grip").id] = 0.03
    mujoco.mj_step(model, data, 2000)
    fingers = data.qpos[[model.jnt_qposadr[model.joint(name).id] for name in ("f1", "f2")]]
    np.testing.assert_allclose(fingers, 0.03, atol=1e-4)  # far below the play of any part


def test_a_model_without_two_sliding_fingers_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(f'schema = "apo-bench/arm/1"\nmjcf = "{folder("assets") / "arms" / "ur5e_primitive.xml"}"\n')
    with pytest.raises(InputError, match="no two sliding fingers"):
        read_arm(path)
