"""MJCF files of arms that somebody else wrote: one sentence for what they may not say, and no waiting."""

import os
from pathlib import Path

import pytest

from apo_bench import InputError, read_arm
from apo_bench.resources import folder
from apo_bench.simulation.arms import apart
from apo_bench.simulation.arms.loading import check_surroundings, compiled, files_of, load_model
from apo_bench.simulation.arms.tree import read_model_tree

ARMS = folder("assets") / "arms"
WORLD = "<worldbody>"
END = "</mujoco>"
BALL = "<body><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>{}</body>"


def with_gripper(folder: Path, arm: str) -> Path:
    """An arm file, the MJCF of a UR5e as it was changed, and a gripper."""
    (folder / "arm.xml").write_text(arm)
    path = folder / "arm.toml"
    home = "base = { at_mm = [-480, 0, 0] }\nhome_deg = [18, -79, -105, -86, 90, -72]\n"
    gripper = f'[gripper]\nmjcf = "{ARMS / "linkage_gripper.xml"}"\n'
    path.write_text(f'schema = "apo-bench/arm/1"\nmjcf = "arm.xml"\n{home}{gripper}')
    return path


def test_a_file_of_another_language_is_named_by_its_outermost_element(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text('<robot name="a"><link name="b"/></robot>')
    with pytest.raises(InputError, match="the outermost element is <robot>; an MJCF file begins with <mujoco>"):
        load_model(tmp_path / "arm.xml", "arm")
    (tmp_path / "arm.xml").write_text("<worldbody/>")
    with pytest.raises(InputError, match="the outermost element is <worldbody>"):
        load_model(tmp_path / "arm.xml", "arm")


def test_a_model_that_is_a_link_to_itself_is_refused(tmp_path: Path) -> None:
    path = with_gripper(tmp_path, "")
    (tmp_path / "arm.xml").unlink()
    (tmp_path / "arm.xml").symlink_to(tmp_path / "arm.xml")
    with pytest.raises(InputError, match="Too many levels of symbolic links"):
        read_arm(path)


ATTACKS = {
    "an include of a pipe": (END, '<include file="pipe"/></mujoco>', "a pipe was given"),
    "an include of itself": (END, '<include file="arm.xml"/></mujoco>', "arm.xml: the file is included twice"),
    "an include of a device": (END, '<include file="/dev/zero"/></mujoco>', "a device was given"),
    "a mesh that is a pipe": (
        END,
        '<asset><mesh name="m" file="pipe.stl"/></asset></mujoco>',
        "a pipe was given; give a mesh of the arm",
    ),
    "a document type": ("<mujoco", '<!DOCTYPE mujoco [<!ENTITY a "b">]><mujoco', "<!DOCTYPE> is given"),
    "a million copies": (WORLD, '<worldbody><replicate count="1000000"><body/></replicate>', "<replicate> stands in"),
    "soft bodies": (WORLD, '<worldbody><flexcomp name="f" type="grid" count="99 99 99"/>', "<flexcomp> stands in"),
    "a field of heights": (
        END,
        '<asset><hfield name="h" nrow="60000" ncol="60000"/></asset></mujoco>',
        "the table bel",
    ),
    "a plugin": (END, '<extension><plugin plugin="mujoco.pid"/></extension></mujoco>', "plugins are code"),
    "20,000 geoms": (WORLD, f"<worldbody><body>{'<geom/>' * 20_000}</body>", "more than 1,000 <geom>"),
    "a body that is led": (
        WORLD,
        '<worldbody><body name="led" mocap="true"/>',
        "has mocap=.* an arm stands",
    ),
    "a free body": (WORLD, f"<worldbody>{BALL.format('<freejoint/>')}", "<freejoint> stands in <body>"),
    "a free joint": (WORLD, "<worldbody>" + BALL.format("<joint type='free'/>"), "neither turns nor slides"),
    "a ball joint": (WORLD, "<worldbody>" + BALL.format("<joint type='ball'/>"), "neither turns nor slides"),
    "a second arm": (WORLD, f"<worldbody>{BALL.format('<joint/>')}", "2 bodies that move on their own"),
    "a margin for all": (WORLD, '<option o_margin="0.05"/><worldbody>', "<option> has o_margin"),
    "no contact": (WORLD, '<option><flag contact="disable"/></option><worldbody>', "<option> has contact"),
    "a margin of a class": (
        WORLD,
        '<default><geom margin="0.05"/></default><worldbody>',
        '0.05"; numbers of 0',
    ),
    "no number": (WORLD, '<default><joint range="nan nan"/></default><worldbody>', 'range="nan nan"; numbers of'),
    "endless": (WORLD, '<default><geom density="inf"/></default><worldbody>', 'density="inf"; numbers of 0 to 25000'),
    "heavy": (WORLD, '<default><geom mass="1e9"/></default><worldbody>', 'mass="1e9"; numbers of 0 to 1000'),
    "rough": (WORLD, '<default><geom friction="1e6"/></default><worldbody>', 'friction="1e6"; numbers of 0 to 10'),
    "tied to the world": (
        END,
        '<equality><weld name="w" body1="link6"/></equality></mujoco>',
        "the equality 'w' ties something to the world",
    ),
}


@pytest.mark.parametrize("attack", ATTACKS)
def test_what_an_arm_may_not_say_is_one_sentence(tmp_path: Path, attack: str) -> None:
    """Each is refused before MuJoCo builds anything of it."""
    old, new, words = ATTACKS[attack]
    text = (ARMS / "ur5e_primitive.xml").read_text()
    assert old in text
    os.mkfifo(tmp_path / "pipe")
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "arm.xml").write_text(text.replace(old, new, 1) if old != END else text.replace(END, new))
    with pytest.raises(InputError, match=words) as found:
        load_model(tmp_path / "arm.xml", "arm")
    assert "\n" not in str(found.value)


@pytest.mark.parametrize("beside", ['<geom type="plane" size="1 1 1"/>', '<body pos="1 0 0"><geom size="0.1"/></body>'])
def test_what_stands_around_an_arm_is_refused_and_its_base_is_not(tmp_path: Path, beside: str) -> None:
    """A base may stand in the world itself, as that of Menagerie's rizon4."""
    text = (ARMS / "ur5e_primitive.xml").read_text()
    (tmp_path / "arm.xml").write_text(text.replace(WORLD, f"{WORLD}{beside}", 1))
    with pytest.raises(InputError, match=r"reaches farther than 0\.5 m from the arm; remove it"):
        check_surroundings(compiled(load_model(tmp_path / "arm.xml", "arm"), tmp_path), tmp_path)
    (tmp_path / "arm.xml").write_text(text.replace(WORLD, f'{WORLD}<geom size="0.1"/>', 1))
    check_surroundings(compiled(load_model(tmp_path / "arm.xml", "arm"), tmp_path), tmp_path)


FEATURES = """<mujoco model="strange">
  <option integrator="implicitfast" impratio="10" cone="elliptic"><flag multiccd="enable"/></option>
  <visual><map force="0.1"/></visual>
  <default><default class="painted"><material specular="0.5"/><geom material="white" type="mesh" group="2"/></default>
  </default>
  <asset>
    <material name="white" rgba="1 1 1 1"/><texture type="2d" name="t" builtin="flat" width="8" height="8"/>
    <mesh file="link.obj"/><mesh file="link.obj"/>
  </asset>
  <worldbody><light pos="0 0 1"/><camera name="c" pos="1 0 0"/></worldbody>
  <include file="parts/rest.xml"/>
  <sensor><jointpos joint="joint1"/></sensor>
  <keyframe><key qpos="0 0 0 0 0 0"/></keyframe>
</mujoco>"""


def test_an_arm_in_parts_with_materials_in_its_classes_is_built_in_a_process_of_its_own(tmp_path: Path) -> None:
    """As Menagerie's xarm7 and rizon4 have them; it is the arm that the whole file is."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "rest.xml").write_text((ARMS / "ur5e_primitive.xml").read_text())
    (tmp_path / "link.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    path = with_gripper(tmp_path, FEATURES)
    arm = read_arm(path)
    plain = read_arm(ARMS / "ur5e_primitive.toml")
    assert arm.joints == plain.joints
    assert arm.opening_m == pytest.approx(plain.opening_m, abs=1e-4)
    names = {each.name for each in files_of(tmp_path / "arm.xml")}
    assert names == {"arm.xml", "rest.xml", "link.obj"}
    assert {each.name for each in arm.files} == {*names, "arm.toml", "linkage_gripper.xml"}


def test_what_a_scene_says_anew_changes_nothing_that_is_measured(tmp_path: Path) -> None:
    text = (ARMS / "ur5e_primitive.xml").read_text()
    (tmp_path / "arm.xml").write_text(text.replace(WORLD, '<option timestep="0.1" gravity="0 0 9"/><worldbody>', 1))
    assert (
        load_model(tmp_path / "arm.xml", "arm").option.timestep
        == load_model(ARMS / "six_axis.xml", "arm").option.timestep
    )


def test_meshes_are_found_where_the_compiler_says(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(
        '<mujoco><compiler meshdir="assets" strippath="true"/><asset><mesh file="far/away/a.stl"/></asset></mujoco>'
    )
    mesh = next(read_model_tree(tmp_path / "arm.xml", "arm").root.iter("mesh"))
    assert (mesh.get("name"), mesh.get("file")) == ("a", str(tmp_path / "assets" / "a.stl"))


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("_WALL_S", 0.05, "needs more than 0.05 s for this arm"),
        ("_START", "import os; os.abort()", "ends without a word, or needs more than 60 s or 4 GB"),
        ("_START", "print('no pickle')", "ends without a word"),
        ("_LIMIT_BYTES", 1, "ends without a word|needs more than"),
    ],
)
def test_what_takes_too_much_or_ends_its_process_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, value: object, words: str
) -> None:
    monkeypatch.setattr(apart, name, value)
    if name == "_LIMIT_BYTES":
        start = "import sys; sys.path[:] = sys.argv[1:]; from apo_bench.simulation.arms import apart; "
        monkeypatch.setattr(apart, "_START", start + "apart._LIMIT_BYTES = 100_000_000; apart.run_child()")
    path = with_gripper(tmp_path, (ARMS / "ur5e_primitive.xml").read_text())
    with pytest.raises(InputError, match=words):
        read_arm(path)


def test_a_gripper_that_is_unstable_leaves_no_log_in_the_users_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = with_gripper(tmp_path, (ARMS / "ur5e_primitive.xml").read_text())
    path.write_text(path.read_text().replace("-105", "2147483648"))
    names = set(os.listdir(tmp_path))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="the gripper is unstable when it is driven"):
        read_arm(path)
    assert set(os.listdir(tmp_path)) == names
