"""Contacts with play as walls: none is overstepped, and the goals are the nearest that stay between them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import nnls

from apo_bench import Assembly, ContactCorrector, InputError, Observation, correct
from apo_bench.assembly import Contact, Gap, Operation
from apo_bench.assembly.equations import equations
from apo_bench.geometry import Array, pose, right_jacobian
from tests import scenes
from tests.correction.solvers.test_large import fence
from tests.correction.solvers.test_manifold import correction, crooked, scales, twisted

SIDES = {"stick_on_castles": ("spy", "sny"), "pockets": ("px", "nx", "py", "ny")}
"""Sides of slots and of pockets: floors are exact."""


def is_side(name: str, contact: Contact) -> bool:
    face = contact.environment.face
    return face in SIDES[name] if name != "pockets" else face[:2] in ("A_", "B_") and face[2:] in SIDES[name]


def walled(scene: scenes.Scene, name: str, gap: Gap) -> Assembly:
    gaps = {r.contact: gap for r in scene.assembly.relations() if is_side(name, r.contact)}
    assert gaps
    return replace(scene.assembly, gaps=gaps)


def in_the_play(scene: scenes.Scene, name: str, half_m: float, rng: np.random.Generator) -> Array:
    """True goals, the last part anywhere in its slot or pocket."""
    x, y = rng.uniform(-half_m, half_m, 2)
    goals = np.array(scene.goals)
    goals[-1] = goals[-1] @ pose.at((x if name == "pockets" else 0.0, y, 0.0))
    return goals


def look(assembly: Assembly, scene: scenes.Scene, goals: Array, L: Array, play_m: float = 0.0) -> Observation:
    seen = scenes.seen(scene, goals)
    return replace(seen, assembly=assembly, covariance=L @ np.swapaxes(L, 1, 2), play_m=play_m)


def beyond(seen: Observation, goals: Array) -> float:
    """How far the worst vertex is out of the interval that is asked, [m]."""
    system = equations(seen.assembly, seen.start, seen.poses)
    asked = np.array([seen.assembly.interval(r.contact, seen.play_m) for r in seen.assembly.relations()])
    low, high = asked[system.contact].T
    e = system.residual(goals)
    return float(np.maximum(low - e, e - high).max())


def unbalanced(seen: Observation, goals: Array) -> float:
    """What neither equations nor touched walls, pushing inwards, account for in z (Karush, Kuhn and Tucker)."""
    L = np.linalg.cholesky(seen.covariance)
    xi = pose.log(pose.inverse(seen.poses) @ goals)
    z = correction(seen.poses, goals, np.asarray(L, dtype=np.float64))
    B = right_jacobian(xi) @ L
    system = equations(seen.assembly, seen.start, seen.poses)
    asked = np.array([seen.assembly.interval(r.contact, seen.play_m) for r in seen.assembly.relations()])
    low, high = asked[system.contact].T
    e, J = system.linearised(goals)
    J = (J.reshape(len(e), -1, 1, 6) @ B).reshape(len(e), -1)
    exact = low == high
    at_low = e < low + 1e-9
    at_high = e > high - 1e-9
    _, w, Vt = np.linalg.svd(J[exact])
    free = Vt[np.count_nonzero(w > 1e-7 * w[0]) :] if exact.any() else np.eye(len(z))
    pushes = np.concatenate([J[at_low & ~exact], -J[at_high & ~exact]]) @ free.T
    return float(nnls(pushes.T, free @ z)[1]) if len(pushes) else float(np.linalg.norm(free @ z))


@pytest.mark.parametrize("clearance_mm", [0.2, 1.0])
@pytest.mark.parametrize("name", SIDES)
@pytest.mark.parametrize("level", [(2.0, 1.0), (5.0, 3.0)])
def test_every_draw_is_solved_and_no_wall_overstepped(
    name: str, clearance_mm: float, level: tuple[float, float]
) -> None:
    """Noise of the second level is so large beside a slot of 0.2 mm that linearised walls leave no room at first."""
    scene = scenes.ALL[name]()
    half_m = 0.5e-3 * clearance_mm
    n = len(scene.goals)
    assembly = walled(scene, name, Gap("clearance", -half_m, half_m))
    touched = 0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        L = scales(n, *level) if seed % 2 or level[0] > 2.0 else crooked(n, rng)
        truth = in_the_play(scene, name, half_m, rng)
        seen = look(assembly, scene, twisted(truth, L, rng), L)
        made = correct(seen, "contact")
        assert made.ok, (seed, made.sentence)
        assert beyond(seen, made.poses) <= 1e-12
        z = correction(seen.poses, made.poses, L)
        true = correction(seen.poses, truth, L)
        assert z @ z <= (true @ true) * (1 + 1e-9)
        assert unbalanced(seen, made.poses) <= 1e-6
        touched += beyond(seen, made.poses) > -1e-9
    assert touched > 0


def test_a_part_that_was_seen_between_its_walls_stays() -> None:
    """Nothing but walls: a block seen 0.4 mm above the table, and one seen 3 mm above it."""
    scene = scenes.scene(
        [scenes.table(), scenes.block()],
        [Operation("block", scenes.touch("block", "table", "nz-top"))],
        [scenes.mm(0, 0, 25)],
    )
    gaps = {scene.assembly.operations[0].contacts[0]: Gap("clearance", -1e-3, 1e-3)}
    assembly = replace(scene.assembly, gaps=gaps)
    L = scales(1, 2.0, 1.0)
    inside = look(assembly, scene, np.array([scenes.mm(3, 4, 25.4)]), L)
    made = correct(inside, "contact")
    assert (made.ok, made.rank) == (True, 0)
    assert_array_equal(made.poses, inside.poses)
    above = look(assembly, scene, np.array([scenes.mm(3, 4, 28)]), L)
    assert_allclose(correct(above, "contact").poses, [scenes.mm(3, 4, 26)], rtol=0, atol=1e-9)
    below = look(assembly, scene, np.array([scenes.mm(3, 4, 15)]), L)
    assert_allclose(correct(below, "contact").poses, [scenes.mm(3, 4, 24)], rtol=0, atol=1e-9)


@pytest.mark.parametrize("method", ["contact", ContactCorrector(compiled=False)], ids=["as it comes", "plain"])
def test_contact_puts_parts_that_fit_one_play_lower(method: Any) -> None:
    """Compiled where that can be, and as it is without Numba."""
    play_mm = 0.25
    scene = scenes.stick_on_castles()
    L = scales(3, 2.0, 1.0)
    floors = [c for c in scene.assembly.operations[2].contacts if c.environment.face == "sfl"]
    assembly = replace(scene.assembly, gaps={c: Gap("contact") for c in floors})
    goals = twisted(scene.goals, L, np.random.default_rng(3))
    made = correct(look(assembly, scene, goals, L, 1e-3 * play_mm), method)
    assert (made.ok, made.rank) == (True, 13)
    assert_allclose(made.poses[2, 2, 3], 0.04 - 1e-3 * play_mm, rtol=0, atol=1e-12)
    assert made.gap_after_m <= 1e-12
    assert made.gap_before_m > 1e-4
    centred = correct(look(scene.assembly, scene, goals, L, 1e-3 * play_mm), method)
    assert_allclose(centred.poses[2, 2, 3], 0.04, rtol=0, atol=1e-12)


def test_clearance_without_numbers_is_the_play() -> None:
    scene = scenes.stick_on_castles()
    L = scales(3, 2.0, 1.0)
    goals = twisted(scene.goals, L, np.random.default_rng(5))
    play = look(walled(scene, "stick_on_castles", Gap("clearance")), scene, goals, L, 0.5e-3)
    said = look(walled(scene, "stick_on_castles", Gap("clearance", -0.5e-3, 0.5e-3)), scene, goals, L, 0.5e-3)
    assert_array_equal(correct(play, "contact").poses, correct(said, "contact").poses)


@pytest.mark.parametrize("intervals_mm", [((1.0, 2.0), (0.0, 1.0)), ((-9.0, -8.0), (-9.0, 0.0))])
def test_no_room_between_the_walls(intervals_mm: tuple[tuple[float, float], tuple[float, float]]) -> None:
    """Both sides of a stick as wide as its slot: their distances add up to nothing."""
    scene = scenes.stick_on_castles()
    L = scales(3, 2.0, 1.0)
    sides = [
        c for c in scene.assembly.operations[2].contacts if c.environment in ((("castle1"), "spy"), ("castle1", "sny"))
    ]
    gaps = {c: Gap("clearance", 1e-3 * low, 1e-3 * high) for c, (low, high) in zip(sides, intervals_mm, strict=True)}
    seen = look(replace(scene.assembly, gaps=gaps), scene, twisted(scene.goals, L, np.random.default_rng(0)), L)
    for name in ("contact", "contact-refuse", "contact-drop"):
        made = correct(seen, name)
        assert made.status == "inconsistent"
        assert made.covariance is None
        assert made.gap_after_m > seen.gap_m


def test_walls_of_very_many_operations_are_refused() -> None:
    scene = fence(101)
    gaps = {scene.assembly.operations[5].contacts[1]: Gap("clearance", -1e-3, 1e-3)}
    with pytest.raises(InputError) as error:
        correct(scenes.seen(scenes.Scene(replace(scene.assembly, gaps=gaps), scene.start, scene.goals), scene.goals))
    assert str(error.value) == (
        'walls with 101 operations were given, up to 100 are allowed; ask for "centred" contacts instead.'
    )
