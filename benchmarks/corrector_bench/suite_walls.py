"""Q7: sides of slots, holes and pockets with clearance, as walls: is every draw solved, and no wall overstepped?

A slot that is wider than the part by c leaves each of its two sides anywhere between c/2 of overlap and c/2 of distance
of the nominal faces. The truth is uniform in the slot; floors are exact and their equations redundant. How near the
corrected part comes to the truth is reported beside the fit in the middle, which knows that the truth is in there too.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from apo_bench.assembly import Assembly, Contact, Gap
from apo_bench.geometry import Array, pose
from benchmarks.corrector_bench.draws import Draw, draw, factors
from benchmarks.corrector_bench.equations_in_z import InZ
from benchmarks.corrector_bench.measures import lengths
from benchmarks.corrector_bench.own import corrected, observation
from benchmarks.corrector_bench.problems import Problem, problem
from benchmarks.corrector_bench.rows import TrialRecord

CLEARANCES_MM = (0.2, 1.0, 3.0, 6.0)
SIDES = {"fig3": ("spy", "sny"), "fig6": ("A_px", "A_nx", "A_py", "A_ny", "B_px", "B_nx", "B_py", "B_ny")}
FIRST = 30_000
WITHIN_MM = 1e-6
"""A wall that is overstepped by less is not: a millionth of a micrometre is what rounding leaves."""


TOUCHED_M = 1e-9
"""A vertex that is this near to a wall touches it."""


class Walled(NamedTuple):
    """One draw."""

    solved: bool
    overstepped_mm: float
    """By how much the worst vertex is beyond its wall; the residual of the exact contacts, if that is larger."""
    overlong: bool
    off_mm: float
    """Distance of the last goal from its truth."""
    centred_mm: float
    """The same of the fit in the middle."""
    drift: float
    """What no equation and no wall that is touched accounts for in z, in sigma units: 0 at the optimum."""


def suite(draws: int) -> list[TrialRecord]:
    rows = []
    for name in SIDES:
        for clearance in CLEARANCES_MM:
            rows += _rows(problem(name), clearance, draws)
    return rows


def _rows(of: Problem, clearance_mm: float, draws: int) -> list[TrialRecord]:
    found = [_one(of, clearance_mm, seed) for seed in range(FIRST, FIRST + draws)]
    where = f"{of.name}, {clearance_mm:g} mm"
    rms = {
        field: float(np.sqrt(np.mean([getattr(w, field) ** 2 for w in found]))) for field in ("off_mm", "centred_mm")
    }
    worst = max(w.overstepped_mm for w in found)
    longer = 100 * float(np.mean([w.overlong for w in found]))
    return [
        TrialRecord(
            "Q7", where, "solved, %", 100 * float(np.mean([w.solved for w in found])), ">= 100", "", {"draws": draws}
        ),
        TrialRecord("Q7", where, "largest violation, mm", worst, f"<= {WITHIN_MM:g}"),
        TrialRecord("Q7", where, "longer than the true correction, %", longer, "<= 0", "", rms),
        TrialRecord("Q7", where, "largest drift, sigma", max(w.drift for w in found), "<= 1e-6"),
    ]


def _one(of: Problem, clearance_mm: float, seed: int) -> Walled:
    given = _in_the_slot(of, draw(of, "2/1", seed), clearance_mm, seed)
    half = 0.5e-3 * clearance_mm
    made = corrected(observation(of, given, walled(of, half)))
    middle = corrected(observation(of, given), "contact")
    outside = beyond(of, given, made.poses, half)
    drift = pushed(of, given, made.poses, half)
    length = np.linalg.norm(lengths(given, made.poses))
    true = np.linalg.norm(lengths(given, given.truth))
    off, off_centred = (
        1e3 * float(np.linalg.norm((goals - given.truth)[-1, :3, 3])) for goals in (made.poses, middle.poses)
    )
    overlong = bool(length > true * (1 + 1e-9))
    return Walled(made.ok, 1e3 * outside, overlong, off, off_centred, drift)


def walled(of: Problem, half_m: float) -> Assembly:
    """The assembly with its sides as walls."""
    gap = Gap("clearance", -half_m, half_m)
    return replace(of.assembly, gaps={r.contact: gap for r in of.assembly.relations() if _is_side(of, r.contact)})


def _is_side(of: Problem, contact: Contact) -> bool:
    return contact.environment.face in SIDES[of.name]


def _in_the_slot(of: Problem, given: Draw, clearance_mm: float, seed: int) -> Draw:
    """The same noise around a truth that is uniform in the slot: the last operation is off by so much."""
    half = 0.5e-3 * clearance_mm
    x, y = np.random.default_rng([seed, 3]).uniform(-half, half, size=2)
    noise = pose.inverse(given.truth) @ given.seen
    truth = np.array(given.truth)
    truth[-1] = truth[-1] @ pose.at([0, y, 0]) if of.name == "fig3" else pose.at([x, y, 0]) @ truth[-1]
    return given._replace(truth=truth, seen=truth @ noise)


def beyond(of: Problem, given: Draw, goals: Array, half_m: float) -> float:
    """How far the worst vertex is beyond what is allowed, [m]."""
    system = of.system(given.seen)
    side = np.array([_is_side(of, relation.contact) for relation in of.assembly.relations()])
    e = np.abs(system.residual(goals))
    return float(np.maximum(e - np.where(side[system.contact], half_m, 0.0), 0.0).max())


def pushed(of: Problem, given: Draw, goals: Array, half_m: float) -> float:
    """The law of Karush, Kuhn and Tucker: z pushes against equations, and against touched walls from within."""
    f = InZ(of.system(given.seen), given.seen, factors(given.covariance))
    z = lengths(given, goals)
    e = 1e-3 * f.value(z)
    J = f.slope(z)
    wall = np.array([_is_side(of, relation.contact) for relation in of.assembly.relations()])[f.system.contact]
    _, w, Vt = np.linalg.svd(J[~wall])
    free = Vt[int(np.count_nonzero(w > 1e-9 * w[0])) :]
    touched = wall & (np.abs(e) > half_m - TOUCHED_M)
    inward = (J * -np.sign(e)[:, None])[touched] @ free.T
    return float(nnls(inward.T, free @ z)[1]) if touched.any() else float(np.linalg.norm(free @ z))
