"""The corrector of the paper with one thing taken away, to see what each is worth.

They are methods of a sweep from the folder of a clone:

    apo-bench sweep stick_in_tower carried_bridge vanished_fixture pocket_table --noise-level 2 --human-error-scale 1 \\
        --method paper,benchmarks.ablations:last_only,benchmarks.ablations:minimal --trials 20 --out runs/ablations
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import combinations, islice

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Correction,
    Observation,
    Operation,
    build_contact_equations,
    compute_placements,
    find_largest_residual,
    measure_largest_gap,
)
from apo_bench.correction.baselines.candidates import candidates
from apo_bench.correction.baselines.own_contacts import solve_own_contacts
from apo_bench.correction.baselines.track import track_operations
from apo_bench.correction.checks.status import refuse_correction, solver_status, status_sentence
from apo_bench.correction.solvers import solve_newton
from apo_bench.geometry import Array

MOST_SETS = 255  # sets that `minimal` tries at a step: every set of 8 candidates, or the smallest of more


def last_only(observation: Observation) -> Correction:
    """Track without reaching back: only the motion parameter of the newest operation may change."""
    return track_operations(observation, lambda chosen: (chosen[:1],))


def minimal(observation: Observation) -> Correction:
    """Track with the smallest set of candidates that suffices, the most recent one of that size."""
    return track_operations(observation, smallest)


def smallest(chosen: tuple[int, ...]) -> Iterable[tuple[int, ...]]:
    """Sets of candidates by size, then by recency, at most `MOST_SETS`; after those, all candidates."""
    sets = (free for size in range(1, len(chosen) + 1) for free in combinations(chosen, size))
    yield from islice(sets, MOST_SETS)
    if 2 ** len(chosen) - 1 > MOST_SETS:
        yield chosen


def no_disappeared(observation: Observation) -> Correction:
    """Correct as `paper` without the contacts that were lost by the end: not in the graph, not in the joint equations.

    Goals that are no candidates are settled for what they make, lost contacts too. The status says whether the
    contacts that stand hold; the gaps are those of every contact ever made.
    """
    if not observation.observed.all():
        return refuse_correction(observation)
    standing = np.array([relation.lost is None for relation in observation.assembly.relations()], dtype=np.bool_)
    system = build_contact_equations(observation.assembly, observation.start, observation.poses)
    before = system.gaps(observation.poses)
    freed = candidates(without_lost(observation.assembly), ~(before <= observation.gap_m)[standing])
    solution = solve_newton(system.among(standing & system.contacts_with(freed)), observation.poses, freed)
    status = solver_status(solution, find_largest_residual(system.gaps(solution.poses)[standing]), observation.gap_m)
    goals = solution.poses
    if status == "converged":
        for k in sorted(set(range(len(goals))).difference(freed)):
            goals = solve_own_contacts(system, goals, k, observation.gap_m)
    kept = "every contact" if standing.all() else "every contact that was kept"
    return Correction(
        poses=goals,
        status=status,
        sentence=status_sentence(status, observation.gap_m, kept),
        freed=freed,
        gap_before_m=find_largest_residual(before),
        gap_after_m=find_largest_residual(system.gaps(goals)),
        rank=solution.rank,
        trace=solution.trace,
    )


def without_lost(assembly: Assembly) -> Assembly:
    """The assembly without the contacts that were lost by the end."""
    made: list[list] = [[] for _ in assembly.operations]
    for relation in assembly.relations():
        if relation.lost is None:
            made[relation.made].append(relation.contact)
    operations = tuple(
        replace(operation, contacts=tuple(contacts))
        for operation, contacts in zip(assembly.operations, made, strict=True)
    )
    return replace(assembly, operations=operations)


def no_history(observation: Observation) -> Correction:
    """Correct object poses by the contacts that stand at the end; operations get what their part was left with.

    A part that was carried has a pose of its own, begun where the motion parameters put it. The pose of a part
    becomes the motion parameter of the operation that moved it last, if that moved it as the main part. All other
    motion parameters stay as they were seen.

    Returns:
        The status says whether the standing contacts hold at the object poses; the gaps are those of every contact
        ever made. `freed` are the operations that got a new motion parameter.
    """
    if not observation.observed.all():
        return refuse_correction(observation)
    last = {part: k for k, operation in enumerate(observation.assembly.operations) for part in operation.moves}
    poses = _poses(observation, tuple(last))
    end = _end(observation.assembly, tuple(last))
    system = build_contact_equations(end, observation.start, poses)
    free = candidates(end, ~(system.gaps(poses) <= observation.gap_m))
    solution = solve_newton(system.among(system.contacts_with(free)), poses, free)
    status = solver_status(solution, find_largest_residual(system.gaps(solution.poses)), observation.gap_m)
    freed = _main(observation.assembly, last, free)
    goals = np.array(observation.poses)
    goals[list(freed)] = solution.poses[list(freed.values())]
    return Correction(
        poses=goals,
        status=status,
        sentence=status_sentence(status, observation.gap_m, "every contact that stands at the end"),
        freed=tuple(freed),
        gap_before_m=measure_largest_gap(observation.assembly, observation.start, observation.poses),
        gap_after_m=measure_largest_gap(observation.assembly, observation.start, goals),
        rank=solution.rank,
        trace=solution.trace,
    )


def _poses(observation: Observation, parts: tuple[str, ...]) -> Array:
    """Where the motion parameters leave these parts, (parts, 4, 4), world frame, [m]."""
    final = compute_placements(observation.assembly, observation.start, observation.poses)[-1] if parts else {}
    return np.array([final[part] for part in parts]).reshape(-1, 4, 4)


def _end(assembly: Assembly, parts: tuple[str, ...]) -> Assembly:
    """Every moved part put where it stands by an operation of its own; the last one finds all contacts that stand."""
    standing = tuple(relation.contact for relation in assembly.relations() if relation.lost is None)
    operations = tuple(Operation(part, standing if part == parts[-1] else ()) for part in parts)
    return replace(assembly, operations=operations)


def _main(assembly: Assembly, last: Mapping[str, int], free: tuple[int, ...]) -> dict[int, int]:
    """Operation -> number of the free part that it moved last as its main part, the most recent first."""
    numbered = {k: i for i, (part, k) in enumerate(last.items()) if assembly.operations[k].main == part}
    return {k: numbered[k] for k in sorted(numbered, reverse=True) if numbered[k] in free}
