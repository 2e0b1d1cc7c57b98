"""What is not a problem but a trap: an error in words or the right answer, and no hang (the process has a limit)."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from apo_bench.assembly import Assembly, Correction, Observation, Operation
from apo_bench.errors import InputError
from apo_bench.geometry import Array, pose
from benchmarks.corrector_bench.draws import draw
from benchmarks.corrector_bench.own import corrected, observation
from benchmarks.corrector_bench.problems import lined_up, problem
from benchmarks.corrector_bench.rows import TrialRecord
from benchmarks.corrector_bench.suite_wrong import shifted

NOISE = np.array([2e-3] * 3 + [np.radians(1.0)] * 3)
MANY = 5000
"""Castles in a row, with 4,999 sticks: 9,999 operations."""


def suite(draws: int) -> list[TrialRecord]:
    """Whether each trap is avoided; `draws` changes nothing."""
    traps: dict[str, Callable[[], str]] = {
        "a pose that is not finite": _not_finite,
        "a covariance that is not positive definite": _not_definite,
        "contradictory relations": _contradiction,
        "a part without contacts": _no_contacts,
        "no operation at all": _nothing,
        "9,999 operations": _many,
        "rank of 9,999 operations": _rank_of_many,
    }
    return [_row(name, trap) for name, trap in traps.items()]


def _row(name: str, trap: Callable[[], str]) -> TrialRecord:
    start = time.monotonic()
    try:
        said = trap()
    except Exception as error:  # whatever escapes is what is looked for
        said = f"escaped: {type(error).__name__}: {error}"
    good = not said.startswith(("escaped", "wrong"))
    what = "a clear error or the right answer, %"
    return TrialRecord("edge", name, what, 100.0 * good, ">= 100", f"{said} ({time.monotonic() - start:.1f} s)")


def _not_finite() -> str:
    given = draw(problem("fig3"), "2/1", 0)
    seen = np.array(given.seen)
    seen[1, 0, 3] = np.nan
    try:
        made = corrected(observation(problem("fig3"), given._replace(seen=seen)))
    except (InputError, ValueError) as error:
        return str(error)
    return made.sentence if made.status == "not_finite" else f"wrong: {made.status}"


def _not_definite() -> str:
    given = draw(problem("fig3"), "2/1", 0)
    covariance = np.array(given.covariance)
    covariance[1, 2, 2] = 0.0
    try:
        corrected(observation(problem("fig3"), given._replace(covariance=covariance)))
    except InputError as error:
        return str(error)
    return "wrong: it was accepted"


def _contradiction() -> str:
    of = problem("fig3")
    made = corrected(observation(of, draw(of, "2/1", 0), shifted(of.assembly, 4, 0.01)))
    return made.sentence if made.status == "inconsistent" else f"wrong: {made.status}"


def _no_contacts() -> str:
    of = problem("fig3")
    given = draw(of, "2/1", 0)
    bare = list(of.assembly.operations)
    bare[1] = Operation(bare[1].main)
    bare[2] = Operation(bare[2].main, tuple(c for c in bare[2].contacts if c.environment.part != bare[1].main))
    made = corrected(observation(of, given, replace(of.assembly, operations=tuple(bare))))
    kept = np.abs(made.poses[1] - given.seen[1]).max() < 1e-12
    return made.sentence if made.ok and kept else f"wrong: {made.status}, moved {not kept}"


def _nothing() -> str:
    table = problem("fig3").assembly.solids["table"]
    none = Assembly({"table": table}, (), frozenset({"table"}))
    seen = Observation(none, {"table": np.eye(4)}, np.zeros((0, 4, 4)), np.zeros((0, 6, 6)), np.zeros(0, dtype=bool))
    made = corrected(seen)
    return made.sentence if made.ok and made.rank == 0 else f"wrong: {made.status}"


def _many() -> str:
    made, seen, z = _row_of_castles(MANY)
    left = 1e3 * made.gap_after_m
    longer = _length(seen, made.poses) > float(np.linalg.norm(z))
    right = made.ok and not longer and left < 1e-6
    return f"{'right' if right else 'wrong'}: {made.status}, gap {left:.1e} mm, rank {made.rank} of {10 * MANY - 7}"


def _rank_of_many() -> str:
    made, _, _ = _row_of_castles(MANY)
    right = made.rank == 10 * MANY - 7
    return f"{'right' if right else 'wrong'}: rank {made.rank} of {10 * MANY - 7}"


@cache
def _row_of_castles(castles: int) -> tuple[Correction, Array, Array]:
    """The correction, what was seen, and the noise in standard deviations."""
    assembly, truth = lined_up(castles)
    z = np.random.default_rng(0).standard_normal((len(truth), 6))
    seen = truth @ pose.exp(NOISE * z)
    start = {part: np.eye(4) for part in assembly.solids}
    covariance = np.broadcast_to(np.diag(NOISE**2), (len(truth), 6, 6))
    made = corrected(Observation(assembly, start, seen, covariance, np.ones(len(truth), dtype=np.bool_)))
    return made, seen, z


def _length(seen: Array, goals: Array) -> float:
    return float(np.linalg.norm(pose.log(pose.inverse(seen) @ goals) / NOISE))
