"""What the contacts determine: laws of rank and freedom, the free directions, the relations, the posterior."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from apo_bench import Observation, Scenario, explain, load_scenario
from apo_bench.assembly import build_contact_equations
from apo_bench.correction.directions import directions
from apo_bench.correction.explanation import Explanation
from apo_bench.correction.solvers.newton import solve_newton
from apo_bench.geometry import Array, pose

STEP = 1e-3
"""Of a shift, [m], and of a turn, [rad]: large enough to see curvature."""


def nominal(scenario: Scenario, sigma: float = 1.0) -> Observation:
    """The goals of a scenario, seen with `sigma` mm and degrees."""
    n = len(scenario.assembly)
    deviations = sigma * np.array([1e-3] * 3 + [np.radians(1.0)] * 3)
    covariance = np.tile(np.diag(deviations**2), (n, 1, 1))
    return Observation(scenario.assembly, scenario.start, scenario.nominal_poses, covariance, np.ones(n, bool))


def explained(name: str) -> tuple[Observation, Explanation]:
    seen = nominal(load_scenario(name))
    return seen, explain(seen, seen.poses)


def gap_m(seen: Observation, k: int, twist: Array, adapting: Iterable[int]) -> float:
    """What is left of the contacts when goal k has moved and some later ones adapt."""
    goals = np.array(seen.poses)
    goals[k] = goals[k] @ pose.exp(STEP * twist)
    system = build_contact_equations(seen.assembly, seen.start, seen.poses)
    free = tuple(adapting)
    if not free:
        return float(np.abs(system.residual(goals)).max())
    moved = solve_newton(system, goals, free, cut_off=1e-6)
    return float(np.abs(system.residual(moved.poses)).max())


@pytest.mark.parametrize("name", ["pocket_table", "dovetail", "gearbox"])
def test_ranks_and_freedoms_add_up(name: str) -> None:
    seen, found = explained(name)
    assert (sum(o.rank for o in found.operations), found.rank + found.freedom) == (found.rank, 6 * len(seen.poses))
    assert sum(len(o.free) for o in found.operations) == found.freedom
    for o in (*found.operations, *found.parts):
        assert (len(o.free), len(o.fixed)) == (6 - o.rank, o.rank)


@pytest.mark.parametrize("name", ["carried_bridge", "vanished_fixture"])
def test_free_directions_are_free_and_the_others_are_not(name: str) -> None:
    """Newton's method, which knows nothing of null spaces, closes the gap in exactly these directions."""
    seen, found = explained(name)
    for o in found.operations:
        for free in o.free:
            assert gap_m(seen, o.operation, free.direction.twist, free.along) < 1e-9
        later = range(o.operation + 1, len(seen.poses))
        span = np.column_stack([np.zeros(6), *(free.direction.twist for free in o.free)])
        for i in range(6):
            beyond = np.eye(6)[i] - span @ np.linalg.lstsq(span, np.eye(6)[i], rcond=None)[0]
            if np.linalg.norm(beyond) > 0.5:
                assert gap_m(seen, o.operation, beyond, later) > 1e-6


def test_the_tower_in_words() -> None:
    _, found = explained("stick_in_tower")
    assert [(o.part, o.fixed, [str(f.direction) for f in o.free]) for o in found.operations] == [
        ("castle1", ("z", "roll", "pitch"), ["x", "y", "yaw"]),
        ("castle2", ("y", "z", "roll", "pitch", "yaw"), ["x"]),
        ("stick", ("y", "z", "roll", "pitch", "yaw"), ["x"]),
    ]
    assert [[hold.relation for hold in o.through] for o in found.operations] == [["R1"], ["R3", "R4"], ["R3"]]
    assert [[hold.relation for hold in o.agreeing] for o in found.operations] == [[], ["R2"], ["R4"]]
    assert [f.along for f in found.operations[0].free] == [(), (1, 2), (1, 2)]
    assert (found.rank, found.freedom, found.redundant, found.spectral_gap > 1e9) == (13, 5, 14, True)


def test_the_error_of_a_carried_part_goes_through_its_history() -> None:
    """The stick of example 5.2 stands at T5 T3^-1 T4: three errors along x, which no contact fixes."""
    _, found = explained("carried_bridge")
    stick = found.parts[-1]
    assert (stick.part, [str(f.direction) for f in stick.free]) == ("stick", ["x", "y", "yaw"])
    assert stick.free[0].deviation == pytest.approx(np.sqrt(3.0) * 1e-3)


@pytest.mark.parametrize(
    ("columns", "names", "point"),
    [
        ([[1, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 1]], ["x", "yaw"], [0, 0, 0]),
        ([[1, 1, 0, 0, 0, 0], [1, 2, 0, 0, 0, 0]], ["x", "y"], None),
        ([[1, 2, 0, 0, 0, 0]], ["y with x"], None),
        ([[0, -0.03, 0, 0, 0, 1]], ["yaw"], [0.03, 0, 0]),
        ([[0, 0, 0.01, 0, 0, 1]], ["yaw with z"], [0, 0, 0]),
        ([[0, 0, 0, 0, 1, 1], [0, 0, 0, 0, 1, -1]], ["pitch", "yaw"], [0, 0, 0]),
    ],
)
def test_directions_have_names(columns: list[list[float]], names: list[str], point: list[float] | None) -> None:
    found = directions(np.array(columns, dtype=float).T)
    assert [str(d) for d in found] == names
    if point is not None:
        assert found[-1].point == pytest.approx(np.array(point), abs=1e-12)
