"""Many observations corrected at once are those corrected one after the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from apo_bench import ContactCorrector, Correction, InputError, Observation, correct, correct_many
from apo_bench.assembly import Gap
from apo_bench.assembly.equations import equations
from apo_bench.assembly.pattern import pattern
from apo_bench.correction.batches import BATCH
from apo_bench.correction.contact.contact import contact
from apo_bench.correction.solvers.compact import CompactEquations, compact_equations
from apo_bench.correction.solvers.projected_contacts import project_vertices
from apo_bench.geometry import Array, pose
from tests import scenes
from tests.correction.checks.test_consistency import shifted
from tests.correction.solvers.test_large import of_problem
from tests.correction.solvers.test_manifold import crooked, scales, twisted
from tests.correction.solvers.test_walls import walled


def draws(scene: scenes.Scene, count: int, mm: float = 2.0, deg: float = 1.0) -> list[Observation]:
    """Observations of one assembly, each with noise of its own."""
    rng = np.random.default_rng(0)
    out = []
    for i in range(count):
        n = len(scene.goals)
        L = crooked(n, rng, mm, deg) if i % 2 else scales(n, mm, deg)
        seen = scenes.seen(scene, twisted(scene.goals, L, rng))
        out.append(replace(seen, covariance=L @ np.swapaxes(L, 1, 2)))
    return out


def check_same(many: tuple[Correction, ...], single: list[Correction]) -> None:
    assert len(many) == len(single)
    for a, b in zip(many, single, strict=True):
        assert (a.status, a.sentence, a.freed, a.rank, a.dropped) == (b.status, b.sentence, b.freed, b.rank, b.dropped)
        assert_allclose(a.poses, b.poses, rtol=0, atol=1e-9)
        assert a.gap_before_m == pytest.approx(b.gap_before_m, rel=0, abs=0, nan_ok=True)
        assert (a.test is None) == (b.test is None)
        assert (a.covariance is None) == (b.covariance is None)
        if a.covariance is not None and b.covariance is not None:
            assert_allclose(a.covariance, b.covariance, rtol=0, atol=1e-12)
        if a.test is not None and b.test is not None:
            assert a.test.freedom == b.test.freedom
            assert a.test.chi_square == pytest.approx(b.test.chi_square, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("build", [scenes.fixture, scenes.pockets, lambda: of_problem("chain6")])
def test_many_are_one_after_the_other(build: Callable[[], scenes.Scene]) -> None:
    seen = draws(build(), 8)
    corrector = ContactCorrector()
    check_same(correct_many(seen, contact), [corrector(one) for one in seen])


def laid_together(scene: scenes.Scene, goals: Array) -> CompactEquations:
    start = np.array([scene.start[part] for part in scene.assembly.solids])
    return project_vertices(scene.assembly, start, pattern(scene.assembly).plane, goals).system


@pytest.mark.parametrize("name", ["stick_on_castles", "pockets"])
def test_vertices_of_either_face(name: str) -> None:
    """Corners of the manipulated face are laid onto the other one at each observation's own goals."""
    scene = scenes.ALL[name]()
    laid = pattern(scene.assembly).laid
    assert laid.any()
    assert not laid.all()
    goals = np.array([one.poses for one in draws(scene, 5, 10.0, 8.0)])
    together = laid_together(scene, goals)
    for i, each in enumerate(goals):
        one = compact_equations(equations(scene.assembly, scene.start, each), len(each))
        e, blocks = together.only(np.arange(5) == i).blocks(
            each[None], np.broadcast_to(np.eye(6), (1, len(each), 6, 6))
        )
        e_one, blocks_one = one.blocks(each, np.broadcast_to(np.eye(6), (len(each), 6, 6)))
        J = together.gathered(blocks)[0].T
        J_one = one.gathered(blocks_one).T
        assert_allclose(J.T @ J, J_one.T @ J_one, rtol=0, atol=1e-12)
        assert_allclose(J.T @ e[0], J_one.T @ e_one, rtol=0, atol=1e-12)


def test_more_than_fit_into_a_chunk() -> None:
    seen = draws(scenes.bridge(), 2 * BATCH + 3)
    many = correct_many(seen, contact)
    assert len(many) == len(seen)
    corrector = ContactCorrector()
    for i in (0, BATCH - 1, BATCH, 2 * BATCH - 1, 2 * BATCH, 2 * BATCH + 2):
        assert_allclose(many[i].poses, corrector(seen[i]).poses, rtol=0, atol=1e-9)


def test_the_same_with_walls() -> None:
    scene = scenes.stick_on_castles()
    assembly = walled(scene, "stick_on_castles", Gap("clearance", -0.5e-3, 0.5e-3))
    seen = [replace(one, assembly=assembly) for one in draws(scene, 6)]
    corrector = ContactCorrector()
    many = correct_many(seen, contact)
    assert all(made.ok for made in many)
    check_same(many, [corrector(one) for one in seen])


@pytest.mark.parametrize("doubt", ["warn", "drop"])
def test_the_same_with_wrong_relations(doubt: str) -> None:
    scene = scenes.stick_on_castles()
    assembly = shifted(scene.assembly, {"stick.py on castle1.spy": 10.0})
    seen = [replace(one, assembly=assembly) for one in draws(scene, 4)]
    corrector = ContactCorrector(doubt)  # type: ignore[arg-type]
    many = correct_many(seen, corrector)
    single = [corrector(one) for one in seen]
    assert [made.status for made in many] == [made.status for made in single]
    assert [made.dropped for made in many] == [made.dropped for made in single]
    assert {made.status for made in many} == {"converged" if doubt == "drop" else "inconsistent"}
    for a, b in zip(many, single, strict=True):
        if a.ok:
            assert_allclose(a.poses, b.poses, rtol=0, atol=1e-9)


def test_one_that_was_not_seen_is_refused_alone() -> None:
    seen = draws(scenes.stick_in_tower(), 3)
    seen[1] = replace(seen[1], observed=np.array([True, False, True]))
    many = correct_many(seen, contact)
    assert [made.status for made in many] == ["converged", "not_seen", "converged"]
    assert_allclose(many[1].poses, seen[1].poses, rtol=0, atol=0)


def test_none_at_all() -> None:
    assert correct_many([]) == ()
    assert correct_many(()) == ()


def test_other_assemblies_are_refused() -> None:
    first, second = draws(scenes.stick_in_tower(), 2)
    start = {**second.start, "castle1": pose.at((9.0, 0.0, 0.0))}
    for other in (
        draws(scenes.stick_in_tower(), 1)[0],
        replace(second, assembly=replace(second.assembly)),
        replace(second, start=start),
        replace(second, play_m=1e-3),
    ):
        with pytest.raises(InputError) as error:
            correct_many([first, second, other])
        assert str(error.value) == (
            "observation 3 is of another assembly, start or play than observation 1; "
            "correct those together that share them."
        )


def test_no_operations_and_no_contacts() -> None:
    scene = scenes.stick_in_tower()
    bare = replace(scene.assembly, operations=tuple(replace(o, contacts=()) for o in scene.assembly.operations))
    seen = [replace(one, assembly=bare) for one in draws(scene, 3)]
    for made, one in zip(correct_many(seen, contact), seen, strict=True):
        assert made.ok
        assert_allclose(made.poses, one.poses, rtol=0, atol=0)
    still = scenes.Scene(scene.assembly.first(0), scene.start, np.zeros((0, 4, 4)))
    nothing = scenes.seen(still, still.goals)
    assert [made.status for made in correct_many([nothing, nothing], contact)] == ["converged", "converged"]


def test_by_default_they_are_corrected_as_one_is() -> None:
    """Of four one has a part seen elsewhere, and one a part that was not seen."""
    plain = draws(scenes.stick_on_castles(), 4)
    goals = np.array(plain[1].poses)
    goals[1] = goals[1] @ pose.exp([0.3, 0.2, 0.1, 1.0, 0.5, 0.2])
    n = len(goals)
    seen = [plain[0], replace(plain[1], poses=goals), replace(plain[2], observed=np.arange(n) != 1), plain[3]]
    made = correct_many(seen)
    check_same(made, [correct(one) for one in seen])
    assert [one.left_out for one in made[:2]] == [(), (1,)]
