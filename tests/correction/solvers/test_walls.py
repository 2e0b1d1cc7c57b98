"""Contacts with play as walls: none is overstepped, and the goals are the nearest that stay between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import nnls

from apo_bench import Assembly, Observation, correct
from apo_bench.assembly import Contact, Gap, build_contact_equations
from apo_bench.geometry import Array, compute_right_jacobian, pose
from tests import scenes
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
    goals = np.array(scene.nominal_poses)
    goals[-1] = goals[-1] @ pose.at((x if name == "pockets" else 0.0, y, 0.0))
    return goals


def look(assembly: Assembly, scene: scenes.Scene, goals: Array, L: Array, play_m: float = 0.0) -> Observation:
    seen = scenes.seen(scene, goals)
    return replace(seen, assembly=assembly, covariance=L @ np.swapaxes(L, 1, 2), play_m=play_m)


def beyond(seen: Observation, goals: Array) -> float:
    """How far the worst vertex is out of the interval that is asked, [m]."""
    system = build_contact_equations(seen.assembly, seen.start, seen.poses)
    asked = np.array([seen.assembly.interval(r.contact, seen.play_m) for r in seen.assembly.relations()])
    low, high = asked[system.contact].T
    e = system.residual(goals)
    return float(np.maximum(low - e, e - high).max())


def unbalanced(seen: Observation, goals: Array) -> float:
    """What neither equations nor touched walls, pushing inwards, account for in z (Karush, Kuhn and Tucker)."""
    L = np.linalg.cholesky(seen.covariance)
    xi = pose.log(pose.inverse(seen.poses) @ goals)
    z = correction(seen.poses, goals, np.asarray(L, dtype=np.float64))
    B = compute_right_jacobian(xi) @ L
    system = build_contact_equations(seen.assembly, seen.start, seen.poses)
    asked = np.array([seen.assembly.interval(r.contact, seen.play_m) for r in seen.assembly.relations()])
    low, high = asked[system.contact].T
    e, J = system.linearise(goals)
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
    n = len(scene.nominal_poses)
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
