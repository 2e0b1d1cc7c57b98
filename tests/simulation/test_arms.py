"""Arms that are described by a file: kinematics, drives and grippers are what the file and the model say."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from apo_bench import Arm, InputError, TrialConfig, load_scenario, read_arm, run_trial
from apo_bench.geometry import Array, pose
from apo_bench.records.user_code import list_user_code
from apo_bench.resources import folder
from apo_bench.simulation.arm_checks.arm_check import check_arm
from apo_bench.simulation.arms import finding
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.simulation.arms.home import tip_down
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.robot.reach import follow_waypoints, plan_waypoints
from apo_bench.viz.arm_text import arm_check_form

ARMS = folder("assets") / "arms"
UR5E = ((0.1625, 0, 90), (0, -0.425, 0), (0, -0.3922, 0), (0.1333, 0, 90), (0.0997, 0, -90), (0.0996, 0, 0))
"""d [m], a [m], alpha [degrees] of every joint, as Universal Robots publishes them."""
PANDA = ((0, 0, 0.333), (0, -90, 0), (0, 90, 0.316), (0.0825, 90, 0), (-0.0825, -90, 0.384), (0, 90, 0), (0.088, 90, 0))
"""a [m], alpha [degrees], d [m], as Franka publishes them; the flange is 0.107 m behind the last."""


def about(axis: int, angle: float) -> Array:
    T = np.eye(4)
    i, j = ((1, 2), (2, 0), (0, 1))[axis]
    T[i, i] = T[j, j] = np.cos(angle)
    T[i, j] = -np.sin(angle)
    T[j, i] = np.sin(angle)
    return T


def by(x: float = 0.0, z: float = 0.0) -> Array:
    T = np.eye(4)
    T[0, 3] = x
    T[2, 3] = z
    return T


def flange(name: str, q: Array) -> Array:
    model = mujoco.MjModel.from_xml_path(str(ARMS / f"{name}.xml"))
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    site = data.site("flange")
    T = np.eye(4)
    T[:3, :3] = site.xmat.reshape(3, 3)
    T[:3, 3] = site.xpos
    return T


def test_the_primitive_arms_have_the_published_kinematics() -> None:
    q = np.random.default_rng(1).uniform(-2.0, 2.0, 7)
    expected = np.eye(4)
    for angle, (d, a, alpha) in zip(q, UR5E, strict=False):
        expected = expected @ about(2, angle) @ by(x=a, z=d) @ about(0, np.radians(alpha))
    np.testing.assert_allclose(flange("ur5e_primitive", q[:6]), expected, atol=1e-8)
    expected = np.eye(4)
    for angle, (a, alpha, d) in zip(q, PANDA, strict=True):
        expected = expected @ about(0, np.radians(alpha)) @ by(x=a) @ about(2, angle) @ by(z=d)
    np.testing.assert_allclose(flange("panda_primitive", q), expected @ by(z=0.107), atol=1e-8)


@pytest.mark.parametrize("name", ["ur5e_primitive", "panda_primitive"])
def test_inverse_kinematics_brings_the_tip_there_and_keeps_the_elbow(name: str) -> None:
    arm = find_arm(name)
    kinematics = Kinematics(arm)
    q = np.array(arm.home)
    home = kinematics.forward(q)
    for shift in (0.1, -0.1, 0.0):
        T = np.array(home)
        T[1, 3] += shift
        reached = kinematics.inverse(T, q)
        assert reached is not None
        np.testing.assert_allclose(kinematics.forward(reached), T, atol=2e-5)
        q = reached
    np.testing.assert_allclose(q, arm.home, atol=1e-3)


@pytest.mark.parametrize("name", ["ur5e_primitive", "panda_primitive"])
def test_the_oracle_succeeds_with_the_arms_that_come_with_the_benchmark(name: str) -> None:
    row = run_trial(TrialConfig("block_on_block", method="oracle", fidelity="near-contact", arm=name))
    assert row["success"]
    assert row["joint_control"] == "position servos made from the model"


GOOD = 'schema = "apo-bench/arm/1"\nmjcf = "ARMS/ur5e_primitive.xml"\n'
GRIPPER = '[gripper]\nmjcf = "ARMS/linkage_gripper.xml"\nhand = "linkage_gripper"\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (GOOD + "joint = 1", r"unknown key 'joint' \(did you mean 'joints'"),
        (GOOD + GRIPPER.replace('"linkage_gripper"', '"linkage"'), "unknown gripper 'linkage'; known are franka_hand"),
        (GOOD + GRIPPER.replace('"linkage_gripper"', '"franka_hand"'), "unknown body 'gripper/hand'"),
    ],
)
def test_an_error_in_an_arm_file_is_refused_in_one_sentence(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(text.replace("ARMS", str(ARMS)))
    with pytest.raises(InputError, match=words) as found:
        read_arm(path)
    assert "\n" not in str(found.value)


def test_the_arm_check_measures_what_the_arm_can_do() -> None:
    """Of the arm with a linkage: all three layouts are reached, its tip keeps within half of the clearance."""
    report = check_arm(find_arm("ur5e_primitive"), load_scenario("block_on_block"), layouts=3)
    assert report.layouts_reached == 3
    assert report.opening_mm == pytest.approx(85.6, abs=0.5)
    assert [error.speed for error in report.tip_errors] == [0.01, 0.06, 0.5]
    assert report.tip_errors[1].across_mm < report.clearance_mm / 2
    assert report.rest_error_mm < 0.01
    assert (report.margins_deg > 5.0).all()
    assert report.missing == ()
    assert len(arm_check_form(report)) == 12


def test_arms_of_collections_are_looked_up_and_never_fetched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder that looks like robosuite, with the linkage in it; menagerie, which is not there."""
    robots, grippers = (tmp_path / "models" / "assets" / each for each in ("robots", "grippers"))
    (robots / "ur5e").mkdir(parents=True)
    grippers.mkdir()
    arm = (ARMS / "ur5e_primitive.xml").read_text().replace('name="flange"', 'name="right_hand"')
    (robots / "ur5e" / "robot.xml").write_text(arm)
    (grippers / "robotiq_gripper_85.xml").write_text((ARMS / "linkage_gripper.xml").read_text())
    monkeypatch.setenv("APO_BENCH_ROBOSUITE", str(tmp_path))
    monkeypatch.setattr(finding, "_GRIPPERS", {"ur5e": ("robotiq_gripper_85", "linkage_gripper")})
    monkeypatch.setenv("APO_BENCH_MENAGERIE", str(tmp_path / "none"))
    assert find_arm("robosuite:UR5e").opening_m == pytest.approx(0.0428, abs=2e-4)
    assert (
        list_user_code({"arm": "robosuite:UR5e", "method": "contact", "noise": "isotropic", "contact_source": "given"})
        == ()
    )
    with pytest.raises(InputError, match="unknown arm 'UR9'"):
        find_arm("robosuite:UR9")
    with pytest.raises(InputError, match="fetch it with 'git clone"):
        find_arm("menagerie:universal_robots_ur5e")


def test_an_arm_goes_around_its_base_where_the_straight_line_passes_over_it() -> None:
    arm = find_arm("ur5e_primitive")
    kinematics = Kinematics(arm)
    base = np.array(arm.base)
    ends = [tip_down(base + np.array((0.05, side * 0.45, 0.35)), turn) for side, turn in ((-1, -1.0), (1, 1.0))]
    q = kinematics.inverse(ends[0], np.array(arm.home) + np.array([-1.5, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert q is not None
    assert follow_waypoints(kinematics, ends[0], ends[1:], q) is None
    middle, end = waypoints = plan_waypoints(kinematics, arm, ends[0], ends[1], q)
    assert follow_waypoints(kinematics, ends[0], waypoints, q) is not None
    np.testing.assert_array_equal(end, ends[1])
    assert middle[0, 3] - base[0] == pytest.approx(np.hypot(0.05, 0.45), rel=0.02)
    near = tip_down(base + np.array((0.3, -0.4, 0.3)), -1.0)
    assert len(plan_waypoints(kinematics, arm, ends[0], near, q)) == 1
    usual = find_arm("six_axis")
    assert len(plan_waypoints(Kinematics(usual), usual, ends[0], ends[1], np.array(usual.home))) == 1


def test_an_arm_of_five_joints_looks_down_and_leans_where_it_cannot(tmp_path: Path) -> None:
    """Waist, three pitches and a roll: straight down at any turn; tilted across its plane by 1 degree, not by 5."""
    link = '<body pos="{0}"><joint name="j{1}" axis="{2}" range="-3 3"/><geom size="0.02"/>'
    links = (
        ("0 0 0.1", "0 0 1"),
        ("0 0 0", "0 1 0"),
        ("0 0 0.3", "0 1 0"),
        ("0 0 0.3", "0 1 0"),
        ("0 0 0.05", "0 0 1"),
    )
    bodies = "".join(link.format(at, i, axis) for i, (at, axis) in enumerate(links))
    text = f"""<mujoco><compiler angle="radian"/><worldbody>{bodies}<site name="tip" pos="0 0 0.1"/>{"</body>" * 5}
        </worldbody></mujoco>"""
    joints = tuple(f"j{i}" for i in range(5))
    home = np.array([0.0, 0.3, 1.4, 1.4, 0.0])
    arm = Arm(tmp_path, (0.0, 0.0, 0.0), joints, "tip", (), "", "body", home, 0.04, model=text)
    kinematics = Kinematics(arm)
    for turn in (0.0, 1.0):
        T = tip_down(np.array([0.35, 0.1, 0.05]), turn)
        q = kinematics.inverse(T, home)
        assert q is not None
        np.testing.assert_allclose(kinematics.forward(q), T, atol=2e-5)
    across = np.array([0.35, 0.1, 0.0]) / np.hypot(0.35, 0.1)
    for degrees, reached in ((1.0, True), (5.0, False)):
        tilted = T @ pose.exp(np.concatenate([np.zeros(3), T[:3, :3].T @ (np.radians(degrees) * across)]))
        q = kinematics.inverse(tilted, home)
        assert (q is not None) == reached
        if q is not None:
            np.testing.assert_allclose(kinematics.forward(q)[:3, 3], T[:3, 3], atol=2e-6)


STATED = """schema = "apo-bench/arm/1"
mjcf = "MODEL"
flange = "gripper"
home_deg = [0, 11, 52, 0, 27, 0]
base = { at_mm = [-420, 0, 0] }
[gripper]
tip = "tip"
slides = ["left_finger", "right_finger"]
opening_mm = 46
actuators = ["grip"]
"""
"""The arm file of a shipped arm with a stated gripper."""


def stated(folder: Path, *changes: tuple[str, str], model: Path = ARMS / "six_axis.xml") -> Path:
    text = STATED.replace("MODEL", str(model))
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    path = folder / "stated.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ([('"right_finger"', '"j1"')], "unknown slide 'j1'"),
        ([("[0, 11, 52, 0, 27, 0]", "[0, 11, 52]")], "'home_deg' needs 6 numbers"),
    ],
)
def test_an_error_in_a_stated_gripper_is_refused(tmp_path: Path, changes: list[tuple[str, str]], words: str) -> None:
    with pytest.raises(InputError, match=re.escape(words)):
        read_arm(stated(tmp_path, *changes))
