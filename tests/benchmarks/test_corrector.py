"""Corrections are as short as the optimum that SciPy finds without the corrector."""

from __future__ import annotations

import numpy as np
import pytest

from apo_bench import correct
from benchmarks.corrector import MANY, METHODS, PROBLEMS, find_optimum, table_of_correctors, whitened
from benchmarks.corrector_problems import observe, problem

pytestmark = pytest.mark.numeric


@pytest.mark.parametrize("name", ["fig2", "fig3", "fig6"])
def test_contact_makes_the_shortest_correction_that_closes_every_contact(name: str) -> None:
    """SLSQP ends within 1e-6 of the optimum; kernels of BLAS move it by less."""
    of = problem(name)
    observation = observe(of, 3)
    best = find_optimum(observation, whitened(observation, of.poses))
    found = correct(observation, "contact")
    assert found.gap_after_m < 1e-10
    assert np.linalg.norm(whitened(observation, found.poses)) == pytest.approx(np.linalg.norm(best), rel=1e-6)
    assert np.linalg.norm(whitened(observation, correct(observation, "paper").poses)) > np.linalg.norm(best)


def test_the_table_has_every_method_and_every_problem() -> None:
    lines = table_of_correctors(draws=1)
    assert [line.split("|")[1].strip() for line in lines if line.startswith("| `")] == [
        f"`{m}`" for m in (*METHODS, MANY)
    ]
    assert all(line.count("|") == len(PROBLEMS) + 4 for line in lines if line.startswith("| "))
