"""The compiled scene is what the part files and the scenario say."""

import mujoco
import numpy as np
import pytest

from apo_bench import InputError, Scene, build_scene, draw_layout, load_scenario
from apo_bench.geometry import pose
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.scene.scene import scene_xml
from apo_bench.simulation.scene.world import initial_state, set_part_pose, snapshot


def half(scene: Scene, geom: str) -> list[float]:
    return (scene.work.model.geom(geom).size * 1e3).round(6).tolist()


def test_only_fit_faces_recede_by_the_clearance() -> None:
    scene = build_scene(load_scenario("stick_in_tower"), clearance_mm=0.4)
    assert half(scene, "stick/bar") == [110.0, 9.6, 9.6]
    assert half(scene, "castle1/base") == [30.0, 30.0, 15.0]


def test_the_written_scene_is_the_scene_and_opens_in_mujoco(tower: Scene) -> None:
    xml = scene_xml(tower.scenario)
    model = mujoco.MjModel.from_xml_string(xml)
    assert model.nq == tower.work.model.nq
    assert [model.body(f"{part}/").id for part in tower.work.free] == [tower.work.body[p] for p in tower.work.free]


def test_every_part_stands_at_its_start_and_rests(tower: Scene) -> None:
    start = draw_layout(tower.scenario, np.random.default_rng(0)).start
    data = initial_state(tower.shown, start)
    mujoco.mj_step(tower.shown.model, data, 300)
    now = snapshot(tower.shown, data, start)
    for part in tower.work.free:
        np.testing.assert_allclose(now.poses[part], start[part], atol=2e-5)
    assert now.released
    assert now.speed_m_s < 1e-4
    assert now.penetration_m < 1e-5


def test_the_automatic_reset_is_off(tower: Scene) -> None:
    flag = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    assert tower.work.model.opt.disableflags & flag
    assert tower.shown.model.opt.disableflags & flag


def test_contacts_of_parts_and_pads_have_the_checked_stiffness(tower: Scene) -> None:
    model = tower.work.model
    for name in ("castle1/base", "stick/bar", "table/slab", "arm/left_pad"):
        assert model.geom(name).solref.tolist() == [0.004, 2.0]
    assert build_scene(tower.scenario, timestep_s=0.0005).work.model.geom("stick/bar").solref.tolist() == [0.002, 2.0]


def test_a_snapshot_sees_what_is_inside_what(tower: Scene) -> None:
    start = draw_layout(tower.scenario, np.random.default_rng(0)).start
    data = initial_state(tower.shown, start)
    set_part_pose(tower.shown, data, "stick", start["stick"] @ pose.at((0, 0, -0.0004)))
    assert snapshot(tower.shown, data, start).penetration_m == pytest.approx(0.0004, abs=1e-6)


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"grasp": "glue"}, "unknown grasp 'glue'"),
        ({"arm": "seven_axis"}, "unknown arm 'seven_axis'"),
        ({"arm": "math:pi"}, "the arm 'math:pi' is a float"),
        ({"timestep_s": 0.002}, "a time step of 2 ms was given"),
        ({"clearance_mm": float("nan")}, "clearance"),
    ],
)
def test_what_cannot_be_built_is_refused_in_one_sentence(tower: Scene, how: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        build_scene(tower.scenario, **how)


def test_inverse_kinematics_inverts_the_forward() -> None:
    kinematics = Kinematics(find_arm("six_axis"))
    rng = np.random.default_rng(3)
    home = find_arm("six_axis").home
    for _ in range(50):
        q = home + rng.uniform(-0.4, 0.4, 6)
        T = kinematics.forward(q)
        q = kinematics.inverse(T, home)
        assert q is not None
        np.testing.assert_allclose(kinematics.forward(q), T, atol=2e-5)


def test_what_is_out_of_reach_has_no_joint_angles() -> None:
    kinematics = Kinematics(find_arm("six_axis"))
    T = np.array(kinematics.forward(find_arm("six_axis").home))
    T[0, 3] = 1.5
    assert kinematics.inverse(T, find_arm("six_axis").home) is None
