"""The compiled scene is what the part files and the scenario say."""

import numpy as np
import pytest

from apo_bench import InputError, Scene, build_scene, load_scenario
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.simulation.arms.kinematics import Kinematics


def half(scene: Scene, geom: str) -> list[float]:
    return (scene.work.model.geom(geom).size * 1e3).round(6).tolist()


def test_only_fit_faces_recede_by_the_clearance() -> None:
    scene = build_scene(load_scenario("stick_in_tower"), clearance_mm=0.4)
    assert half(scene, "stick/bar") == [110.0, 9.6, 9.6]
    assert half(scene, "castle1/base") == [30.0, 30.0, 15.0]


def test_contacts_of_parts_and_pads_have_the_checked_stiffness(tower: Scene) -> None:
    model = tower.work.model
    for name in ("castle1/base", "stick/bar", "table/slab", "arm/left_pad"):
        assert model.geom(name).solref.tolist() == [0.004, 2.0]
    assert build_scene(tower.scenario, timestep_s=0.0005).work.model.geom("stick/bar").solref.tolist() == [0.002, 2.0]


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"grasp": "glue"}, "unknown grasp 'glue'"),
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
