"""Q6: one plane of one relation is off by five standard deviations; is that relation named?

A contact is redundant if the others already say what it says, so that its being wrong is a contradiction: its rows
shifted alone are then no value that the linearised equations can take. A contact that is not redundant only makes the
correction longer; how often that is noticed is limited by the noise, and it is reported, not judged.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly
from apo_bench.geometry import Face
from benchmarks.corrector_bench.draws import LEVELS, draw
from benchmarks.corrector_bench.own import corrected, observation
from benchmarks.corrector_bench.problems import FIGURES, Problem, problem
from benchmarks.corrector_bench.rows import TrialRecord

SIGMAS = 5.0
FIRST = 20_000


class Named(NamedTuple):
    """What the corrector made of one wrong plane."""

    caught: bool
    first: bool
    ambiguous: bool
    size: int
    """Of the ambiguity set."""


def suite(draws: int) -> list[TrialRecord]:
    rows = []
    for name in FIGURES:
        of = problem(name)
        surplus = redundant(of)
        for kind, chosen in (("redundant", np.flatnonzero(surplus)), ("not redundant", np.flatnonzero(~surplus))):
            if len(chosen):
                rows += _rows(of, kind, [int(c) for c in chosen], draws)
    return rows


def _rows(of: Problem, kind: str, contacts: list[int], draws: int) -> list[TrialRecord]:
    named = [_named(of, contacts[seed % len(contacts)], seed) for seed in range(FIRST, FIRST + draws)]
    judged = kind == "redundant"
    each = {str(of.assembly.relations()[c].contact): 0.0 for c in contacts}
    for c in contacts:
        own = [
            n for seed, n in zip(range(FIRST, FIRST + draws), named, strict=True) if contacts[seed % len(contacts)] == c
        ]
        each[str(of.assembly.relations()[c].contact)] = float(np.mean([n.first for n in own])) if own else float("nan")
    detail = {"draws": draws, "contacts": len(contacts), "first by contact": each}
    share = {
        field: 100.0 * float(np.mean([getattr(n, field) for n in named])) for field in ("caught", "first", "ambiguous")
    }
    size = float(np.mean([n.size for n in named if n.caught])) if share["caught"] else float("nan")
    rows = [
        TrialRecord(
            "Q6", of.name, f"wrong by 5 sigma, {kind}: caught, %", share["caught"], "", "", {"mean ambiguity set": size}
        ),
        TrialRecord(
            "Q6", of.name, f"wrong by 5 sigma, {kind}: first, %", share["first"], ">= 95" if judged else "", "", detail
        ),
        TrialRecord(
            "Q6", of.name, f"wrong by 5 sigma, {kind}: in the set, %", share["ambiguous"], ">= 99" if judged else ""
        ),
    ]
    return rows


def _named(of: Problem, contact: int, seed: int) -> Named:
    given = draw(of, "2/1", seed)
    sign = 1.0 if np.random.default_rng([seed, 2]).random() < 0.5 else -1.0
    test = corrected(
        observation(of, given, shifted(of.assembly, contact, sign * SIGMAS * 1e-3 * LEVELS["2/1"][0]))
    ).test
    assert test is not None
    culprit = next(f"R{i + 1}" for i, arc in enumerate(of.assembly.arcs()) if contact in arc)
    first = bool(test.suspects) and test.suspects[0].relation == culprit
    among = [suspect.relation for suspect in test.ambiguous]
    return Named(not test.passes, first, culprit in among, len(among))


def redundant(of: Problem) -> np.ndarray:
    """Whether each contact is, (c,), in the order of `assembly.relations()`."""
    system = of.system(of.goals)
    _, J = system.linearised(of.goals)
    scale = np.tile([1.0, 1.0, 1.0, 0.05, 0.05, 0.05], of.n)
    U = np.linalg.svd(J * scale, full_matrices=False)[0][:, : of.rank]
    shift = (system.contact[:, None] == np.arange(len(system.letters))).astype(np.float64)
    left = shift - U @ (U.T @ shift)
    return np.asarray(np.linalg.norm(left, axis=0) > 1e-6)


def shifted(assembly: Assembly, contact: int, by_m: float) -> Assembly:
    """The same assembly with the environment face of one contact off along its normal, for that contact alone."""
    wrong = assembly.relations()[contact].contact
    part, face = wrong.environment
    old = assembly.solids[part].faces[face]
    moved = Face(f"{face}_off", old.outline + by_m * old.normal, fit=old.fit)
    solid = replace(assembly.solids[part], faces={**assembly.solids[part].faces, moved.name: moved})
    off = wrong._replace(environment=wrong.environment._replace(face=moved.name))
    made = assembly.relations()[contact].made
    operations = list(assembly.operations)
    contacts = tuple(off if each == wrong else each for each in operations[made].contacts)
    operations[made] = replace(operations[made], contacts=contacts)
    return Assembly({**assembly.solids, part: solid}, tuple(operations), assembly.fixed)
