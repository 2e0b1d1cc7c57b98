"""Many observations corrected at once are those corrected one after the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from apo_bench import ContactCorrector, Correction, Observation, correct, correct_many
from apo_bench.correction.contact.contact import contact
from apo_bench.geometry import pose
from tests import scenes
from tests.correction.solvers.test_large import of_problem
from tests.correction.solvers.test_manifold import crooked, scales, twisted


def draws(scene: scenes.Scene, count: int, mm: float = 2.0, deg: float = 1.0) -> list[Observation]:
    """Observations of one assembly, each with noise of its own."""
    rng = np.random.default_rng(0)
    out = []
    for i in range(count):
        n = len(scene.nominal_poses)
        L = crooked(n, rng, mm, deg) if i % 2 else scales(n, mm, deg)
        seen = scenes.seen(scene, twisted(scene.nominal_poses, L, rng))
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


@pytest.mark.parametrize("method", ["contact", "paper", "snap"])
def test_many_take_the_correctors_that_one_takes(method: str) -> None:
    seen = draws(scenes.fixture(), 2)
    check_same(correct_many(seen, method), [correct(one, method) for one in seen])


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
