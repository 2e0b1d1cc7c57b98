"""Play adds up along what is carried, faces of one fit are off together, and the test of a correction knows both."""

import numpy as np
import pytest

from apo_bench import Demonstration, correct_many, observe
from apo_bench.assembly import build_contact_equations
from apo_bench.correction.contact.contact import contact_refuse
from apo_bench.correction.solvers.play import count_plays
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from tests.correction.robust.test_robust import shown

PLAY_M = 0.25e-3


def by_contact(name, values):
    return {str(r.contact): v for r, v in zip(shown(name)[0].assembly.relations(), values, strict=True)}


def test_each_fit_on_the_way_adds_its_play():
    """In the carrier before, in the carrier then, and in the slot: only along directions in which the carrier fits."""
    bridge = by_contact("carried_bridge", count_plays(shown("carried_bridge")[0].assembly, PLAY_M)[0])
    assert bridge["cube.nz on castle1.topP"] == 0.0
    assert bridge["stick.pz on cube.hpz"] == pytest.approx(1.0)
    assert bridge["stick.nz on castle1.sfl"] == pytest.approx(3.0)
    pocket = by_contact("pocket_table", count_plays(shown("pocket_table")[0].assembly, PLAY_M)[0])
    assert pocket["cube2.nz on table.top"] == 0.0
    assert pocket["cube2.nz on table.A_fl"] == pytest.approx(2.0)
    assert pocket["cube2.px on table.A_px"] == pytest.approx(1.0)
    assert pocket["cube2.py on table.A_py"] == pytest.approx(3.0)


def test_a_stick_that_hangs_as_deep_as_play_lets_it_is_no_alarm():
    """It lay at the bottom of the hole, then the cube hangs on it, and it lies on the slot: three plays in all."""
    scenario, layout, _ = shown("carried_bridge")
    goals = np.array(layout.poses)
    goals[3, 2, 3] -= PLAY_M
    goals[4, 2, 3] -= 2.0 * PLAY_M
    deep = build_contact_equations(scenario.assembly, layout.start, goals).gaps(goals)
    assert by_contact("carried_bridge", deep)["stick.nz on castle1.sfl"] == pytest.approx(3.0 * PLAY_M)
    human = Demonstration(scenario.assembly, layout.start, goals, layout.start, np.zeros((5, 6, 6)), play_m=PLAY_M)
    rng = np.random.default_rng(0)
    noise = make_noise("isotropic", NoiseLevel(0.05, 0.05))
    seen = [observe(human, noise, rng) for _ in range(100)]
    refused = sum(made.status == "doubtful" for made in correct_many(seen, contact_refuse))
    assert refused <= 4
