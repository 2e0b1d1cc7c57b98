"""Play adds up along what is carried, faces of one fit are off together, and the test of a correction knows both."""

import numpy as np
import pytest

from apo_bench import Demonstration, correct_many, observe
from apo_bench.assembly import build_contact_equations, find_contact_pattern
from apo_bench.correction.checks.chi_square import fit_deviation
from apo_bench.correction.contact.contact import contact_refuse
from apo_bench.correction.solvers.play import count_plays, fit_covariance
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


@pytest.mark.parametrize("name", ["block_on_block", "pocket_table"])
def test_deviations_are_those_of_the_covariance(name):
    assembly = shown(name)[0].assembly
    S = fit_covariance(assembly, PLAY_M)
    deviation = fit_deviation(assembly, PLAY_M)
    if S is None:
        assert not deviation.any()
        return
    np.testing.assert_allclose(np.sqrt(np.diag(S)), deviation, rtol=1e-12)
    assert np.linalg.eigvalsh(S)[0] > -1e-12 * S.max()
    assert fit_covariance(assembly, 0.0) is None


def test_faces_that_look_opposite_ways_are_off_by_the_same():
    assembly = shown("carried_bridge")[0].assembly
    number = {str(r.contact): i for i, r in enumerate(assembly.relations())}
    S = fit_covariance(assembly, 1.0)[::3, ::3]
    corners = np.diff(find_contact_pattern(assembly).begin)
    S = 3.0 * S / np.sqrt(np.outer(corners, corners))
    up = number["stick.pz on cube.hpz"]
    down = number["stick.nz on cube.hnz"]
    slot = number["stick.nz on castle1.sfl"]
    other = number["stick.nz on castle2.sfl"]
    assert (S[up, up], S[up, down], S[down, slot]) == pytest.approx((1.0, -1.0, 1.0))
    assert S[slot, other] == pytest.approx(2.0)


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
