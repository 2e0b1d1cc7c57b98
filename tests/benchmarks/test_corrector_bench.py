"""The benchmark of the corrector measures what it says: problems, draws, measures, processes, the file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from apo_bench.assembly.equations import equations
from apo_bench.geometry import Array, pose, right_jacobian
from benchmarks.corrector_bench import door, suite_door, suite_walls
from benchmarks.corrector_bench.draws import draw
from benchmarks.corrector_bench.measures import free_basis, freedom_error, lengths, quality, spread
from benchmarks.corrector_bench.own import corrected, observation
from benchmarks.corrector_bench.page import page
from benchmarks.corrector_bench.part import part
from benchmarks.corrector_bench.peers import Task, newton, peers
from benchmarks.corrector_bench.problems import problem
from benchmarks.corrector_bench.reference import optimum
from benchmarks.corrector_bench.rows import TrialRecord, printed, read, records, written
from benchmarks.corrector_bench.runner import process, run
from benchmarks.corrector_bench.suite_wrong import redundant, shifted

pytestmark = pytest.mark.numeric

STATED = {
    "fig2": (20, 18, 11),
    "fig3": (32, 18, 13),
    "fig6": (88, 30, 25),
    "chain3": (60, 30, 23),
    "grid2": (112, 48, 39),
}


@pytest.mark.parametrize("name", STATED)
def test_rows_unknowns_and_rank_are_the_stated_ones(name: str) -> None:
    of = problem(name)
    given = draw(of, "2/1", 0)
    e, J = of.system(given.seen).linearised(given.truth)
    w = np.linalg.svd(J * np.tile([1.0, 1.0, 1.0, 0.05, 0.05, 0.05], of.n), compute_uv=False)
    assert (of.rows, 6 * of.n, of.rank) == STATED[name]
    assert int(np.count_nonzero(w > 1e-9 * w[0])) == of.rank
    assert np.abs(e).max() < 1e-15


@pytest.mark.parametrize("name", STATED)
def test_the_free_motions_of_the_geometry_span_the_null_space(name: str) -> None:
    of = problem(name)
    given = draw(of, "2/1", 1)
    N = of.free(given.truth)
    assert N.shape == (6 * of.n, 6 * of.n - of.rank)
    assert np.linalg.matrix_rank(N) == N.shape[1]
    assert np.abs(of.system(given.seen).linearised(given.truth)[1] @ N).max() < 1e-12


def test_a_draw_is_the_same_at_every_level_but_for_its_size() -> None:
    of = problem("fig3")
    small = draw(of, "2/1", 7)
    large = draw(of, "5/3", 7)
    assert np.array_equal(small.truth, large.truth)
    np.testing.assert_allclose(lengths(small, small.truth), lengths(large, large.truth), atol=1e-9)


def test_an_observation_is_as_wrong_as_its_covariance_says() -> None:
    of = problem("fig2")
    given = [draw(of, "2/1", seed, per_part=True) for seed in range(400)]
    z = np.array([lengths(one, one.truth) for one in given])
    np.testing.assert_allclose(z.var(axis=0), 1.0, atol=6 * np.sqrt(2 / 400))
    assert len({one.covariance[0, 0, 0] for one in given}) == 400


@pytest.mark.parametrize("noise_level", ["2/1", "10/8"])
@pytest.mark.parametrize("name", ["fig2", "fig3", "fig6"])
def test_the_reference_meets_the_conditions_of_an_optimum(name: str, noise_level: str) -> None:
    of = problem(name)
    given = draw(of, noise_level, 3)
    best = optimum(of, given)
    found = quality(of, given, best.goals)
    assert found.residual_mm < 1e-9
    assert found.drift < 1e-8
    assert found.length <= found.true_length
    assert abs(found.length - best.length) < 1e-9


def test_drift_is_how_far_a_solution_went_along_a_free_direction() -> None:
    of = problem("fig3")
    given = draw(of, "2/1", 5)
    slid = np.array(optimum(of, given).goals)
    slid[2] = slid[2] @ np.array([[1, 0, 0, 0.004], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    found = quality(of, given, slid)
    assert found.residual_mm < 1e-9
    assert found.drift == pytest.approx(2.0, abs=0.01)


def test_the_truth_has_no_error_and_the_observation_no_drift() -> None:
    """The way back to where one is is rounding, over standard deviations of a few mm: up to 2e-14 was found."""
    of = problem("fig6")
    given = draw(of, "2/1", 0)
    assert quality(of, given, given.truth).position_mm == 0.0
    assert quality(of, given, given.truth).fixed_error < 1e-9
    assert quality(of, given, given.seen).length < 1e-12
    assert spread(of, given, given.truth) < 1e-20


def test_a_posterior_with_one_direction_too_many_is_seen() -> None:
    of = problem("fig2")
    given = draw(of, "2/1", 2)
    goals = optimum(of, given).goals
    B = right_jacobian(pose.log(pose.inverse(given.seen) @ goals)) @ np.linalg.cholesky(given.covariance)
    Q = free_basis(of, given, goals)
    one_more = np.linalg.qr(np.column_stack([Q, np.eye(6 * of.n)[2]]))[0]
    stated = [B @ (each @ np.swapaxes(each, 1, 2)) @ np.swapaxes(B, 1, 2) for each in _by_part(of.n, Q, one_more)]
    assert freedom_error(of, given, goals, stated[0]) < 1e-12
    assert freedom_error(of, given, goals, stated[1]) > 0.1


def _by_part(n: int, *bases: Array) -> list[Array]:
    return [basis.reshape(n, 6, -1) for basis in bases]


def test_redundant_contacts_are_those_that_contradict() -> None:
    of = problem("fig2")
    names = [str(relation.contact) for relation in of.assembly.relations()]
    assert [name for name, surplus in zip(names, redundant(of), strict=True) if not surplus] == ["C.nx on B.px"]
    assert redundant(problem("fig3")).all()


def test_a_shifted_plane_opens_one_contact_and_no_other() -> None:
    of = problem("fig3")
    wrong = shifted(of.assembly, 4, 0.01)
    gaps = equations(wrong, of.start, of.goals).gaps(of.goals)
    np.testing.assert_allclose(gaps, 0.01 * (np.arange(len(gaps)) == 4), atol=1e-12)


def test_walls_that_are_touched_may_hold_a_correction_back_and_others_may_not() -> None:
    of = problem("fig3")
    given = draw(of, "2/1", 4)
    middle = optimum(of, given).goals
    assert suite_walls.pushed(of, given, middle, half_m=0.01) > 0.1
    between = corrected(observation(of, given, suite_walls.walled(of, 1e-4))).poses
    assert suite_walls.pushed(of, given, between, half_m=1e-4) < 1e-6
    assert suite_walls.beyond(of, given, between, half_m=1e-4) < 1e-9
    assert suite_walls.beyond(of, given, between, half_m=0.0) == pytest.approx(1e-4)


def test_the_yardstick_closes_the_contacts() -> None:
    of = problem("fig2")
    given = draw(of, "2/1", 0)
    system = of.system(given.seen)
    goals = newton(Task(of, system, given.seen, given.covariance))()
    assert np.abs(system.residual(goals)).max() < 1e-8


@pytest.mark.slow
def test_a_peer_runs_in_a_process_of_its_own() -> None:
    ran = run("newton", "fig2", "2/1", 2, beside=("contact",))
    assert ran.ended == "ok"
    assert ran.goals.shape == (2, 3, 4, 4)
    assert ran.ms.shape == (2, 2)
    assert (ran.ms > 0).all()
    assert {"contact", "newton"} <= set(peers())


def test_every_way_through_the_door_is_timed_on_every_draw() -> None:
    ways = [door.YARDSTICK, door.UNCOMPILED, door.CONTACT, "scipy"]
    ms, gaps = (np.array(x) for x in door.each("fig2", ways, 2))
    assert ms.shape == gaps.shape == (2, 4)
    assert (ms > 0.0).all()
    assert (gaps < door.OPEN_M).all()
    ms, gaps = (np.array(x) for x in door.rounds("fig2", [], 1))
    assert ms.shape == gaps.shape == (door.ROUNDS, 2)
    assert (gaps < door.OPEN_M).all()


def test_a_way_that_raises_or_leaves_a_contact_open_is_not_timed() -> None:
    assert suite_door.fault(np.array([1e-9, 2e-9])) == ""
    assert suite_door.fault(np.array([np.nan, np.nan])) == "no solution"
    assert suite_door.fault(np.array([1e-9, 9.8e-3, np.nan])) == "fails on 2 of 3 draws: up to 9.8 mm open"


def test_the_page_lists_what_was_missed_and_what_failed() -> None:
    rows = [
        TrialRecord("P1", "fig2", "`contact`", 1.2, "<= 1.3", "", {"ms": 0.5}),
        TrialRecord("P1", "fig3", "`contact`", 1.4, "<= 1.3", "", {"ms": 0.6}),
        TrialRecord("P3", "fig2", "peer", None, "", "no solution"),
        TrialRecord("Q1", "fig2 2/1", "gap, mm", 2e-12, "<= 1e-9"),
        TrialRecord("Q1", "fig3 2/1", "gap, mm", 3e-12, "<= 1e-9"),
    ]
    suite = {"commit": "abc", "draws": 3, "rows": records(rows)}
    text = page({"versions": {"numpy": "2"}, "machine": "here", "suites": {"door": suite}})
    assert "door at `abc` with 3" in text
    assert "3 of 4 targets are met." in text
    assert "- Missed, fig3: `contact`: 1.4, asked <= 1.3" in text
    assert "| `contact` | 1.3 | 1.200 (0.50) | 1.400 (0.60) |  |" in text
    assert "| peer |  | no solution |  |  |" in text
    assert "| gap, mm | <= 1e-9 | 3e-12 | fig2 2/1, fig3 2/1 |" in text


@pytest.mark.slow
def test_a_process_that_hangs_is_killed_and_one_that_crashes_says_why() -> None:
    deaf = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); time.sleep(600)"
    assert process(["-c", deaf], 1.0)[0] == "killed"
    assert process(["-c", "raise ValueError('three')"], 60.0)[0] == "ValueError: three"


@pytest.mark.slow
def test_a_suite_that_cannot_run_is_a_missed_target() -> None:
    (row,) = part("of_nothing", 1, 60.0)
    assert row.met is False
    assert "of_nothing" in row.note


def test_rows_are_written_and_read_back(tmp_path: Path) -> None:
    rows = [
        TrialRecord("Q1", "fig2", "a", 1e-12, "<= 1e-9", "", {"draws": 3}),
        TrialRecord("Q6", "fig2", "b", 2.0, "0.4 .. 1.6"),
        TrialRecord("P2", "fig2", "c", None, "<= 0.15", "numba is missing"),
        TrialRecord("peer", "fig2", "d", float("nan")),
    ]
    assert [row.met for row in rows] == [True, False, False, None]
    written(rows, tmp_path / "deep" / "out.json", {"draws": 3})
    again = read(tmp_path / "deep" / "out.json")
    assert again[:3] == rows[:3]
    assert again[3].value is None
    assert json.loads((tmp_path / "deep" / "out.json").read_text())["rows"][1]["met"] is False
    assert printed(rows).count("MISSED") == 2
