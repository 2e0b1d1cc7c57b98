"""Model files of arms that other people wrote: what is read, and what is refused."""

from pathlib import Path

import pytest

from apo_bench import InputError, read_arm
from apo_bench.io import list_named_files
from apo_bench.resources import folder
from apo_bench.simulation.arms.loading import compile_model, load_model

ARMS = folder("assets") / "arms"


def with_gripper(folder: Path, arm: str) -> Path:
    """An arm file, the MJCF of a UR5e as it was changed, and a gripper."""
    (folder / "arm.xml").write_text(arm)
    path = folder / "arm.toml"
    home = "base = { at_mm = [-480, 0, 0] }\nhome_deg = [18, -79, -105, -86, 90, -72]\n"
    gripper = f'[gripper]\nmjcf = "{ARMS / "linkage_gripper.xml"}"\nhand = "linkage_gripper"\n'
    path.write_text(f'schema = "apo-bench/arm/1"\nmjcf = "arm.xml"\n{home}{gripper}')
    return path


URDF = """<robot name="two"><link name="base"/>
<link name="link1"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="joint1" type="revolute"><parent link="base"/><child link="link1"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="10" velocity="1"/></joint>
<link name="tool"/><joint name="fixed" type="fixed"><parent link="link1"/><child link="tool"/></joint></robot>"""


def test_a_urdf_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(URDF)
    model = compile_model(load_model(tmp_path / "arm.urdf", "arm"), tmp_path)
    assert [model.joint(j).name for j in range(model.njnt)] == ["joint1"]
    assert model.body("tool").parentid == model.body("link1").id, "a link without a joint stays"


FEATURES = """<mujoco model="strange">
  <option integrator="implicitfast" impratio="10" cone="elliptic"><flag multiccd="enable"/></option>
  <visual><map force="0.1"/></visual>
  <default><default class="painted"><material specular="0.5"/><geom material="white" type="mesh" group="2"/></default>
  </default>
  <asset>
    <material name="white" rgba="1 1 1 1"/><texture type="2d" name="t" builtin="flat" width="8" height="8"/>
    <mesh file="link.obj"/>
  </asset>
  <worldbody><light pos="0 0 1"/><camera name="c" pos="1 0 0"/></worldbody>
  <include file="parts/rest.xml"/>
  <sensor><jointpos joint="joint1"/></sensor>
  <keyframe><key qpos="0 0 0 0 0 0"/></keyframe>
</mujoco>"""


def test_an_arm_in_parts_with_materials_in_its_classes_is_built(tmp_path: Path) -> None:
    """As Menagerie's xarm7 and rizon4 have them; it is the arm that the whole file is."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "rest.xml").write_text((ARMS / "ur5e_primitive.xml").read_text())
    (tmp_path / "link.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    path = with_gripper(tmp_path, FEATURES)
    arm = read_arm(path)
    plain = read_arm(ARMS / "ur5e_primitive.toml")
    assert arm.joints == plain.joints
    assert arm.opening_m == pytest.approx(plain.opening_m, abs=1e-4)
    names = {each.name for each in list_named_files(tmp_path / "arm.xml")}
    assert names == {"arm.xml", "rest.xml", "link.obj"}
    assert {each.name for each in arm.files} == {*names, "arm.toml", "linkage_gripper.xml", "linkage_gripper.toml"}


def test_meshes_are_found_where_the_compiler_says(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(
        '<mujoco><compiler meshdir="assets"/><asset><mesh name="a" file="a.stl"/></asset>'
        '<worldbody><body><geom type="mesh" mesh="a"/></body></worldbody></mujoco>'
    )
    with pytest.raises(InputError, match=r"assets/a\.stl of the arm is missing"):
        load_model(tmp_path / "arm.xml", "arm")
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "a.stl").write_bytes(b"")
    (mesh,) = load_model(tmp_path / "arm.xml", "arm").meshes
    assert mesh.file == str(tmp_path / "assets" / "a.stl")
    assert list_named_files(tmp_path / "arm.xml") == (tmp_path / "arm.xml", tmp_path / "assets" / "a.stl")
