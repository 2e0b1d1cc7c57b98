"""The corrector without memory (Section 3.1): the parts where they stand at the end, one pose each, no ODL."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from apo_bench.assembly import Assembly, Correction, Observation, Operation, largest, largest_gap, placements
from apo_bench.assembly.equations import equations
from apo_bench.correction.baselines.candidates import candidates
from apo_bench.correction.checks.status import refused_correction, solver_status, status_sentence
from apo_bench.correction.solvers.newton import solve_newton
from apo_bench.geometry import Array


def no_history(observation: Observation) -> Correction:
    """Correct object poses by the contacts that stand at the end; operations get what their part was left with.

    A part that was carried has a pose of its own, begun where the motion parameters put it. The pose of a part
    becomes the motion parameter of the operation that moved it last, if that moved it as the main part. All other
    motion parameters stay as they were seen.

    Returns:
        The status says whether the standing contacts hold at the object poses; the gaps are those of every contact
        ever made. `freed` are the operations that got a new motion parameter.
    """
    if not observation.seen.all():
        return refused_correction(observation)
    last = {part: k for k, operation in enumerate(observation.assembly.operations) for part in operation.moves}
    poses = _poses(observation, tuple(last))
    end = _end(observation.assembly, tuple(last))
    system = equations(end, observation.start, poses)
    free = candidates(end, ~(system.gaps(poses) <= observation.gap_m))
    solution = solve_newton(system.among(system.containing(free)), poses, free)
    status = solver_status(solution, largest(system.gaps(solution.goals)), observation.gap_m)
    freed = _main(observation.assembly, last, free)
    goals = np.array(observation.goals)
    goals[list(freed)] = solution.goals[list(freed.values())]
    return Correction(
        goals=goals,
        status=status,
        sentence=status_sentence(status, observation.gap_m, "every contact that stands at the end"),
        freed=tuple(freed),
        gap_before_m=largest_gap(observation.assembly, observation.start, observation.goals),
        gap_after_m=largest_gap(observation.assembly, observation.start, goals),
        rank=solution.rank,
        trace=solution.trace,
    )


def _poses(observation: Observation, parts: tuple[str, ...]) -> Array:
    """Where the motion parameters leave these parts, (parts, 4, 4), world frame, [m]."""
    final = placements(observation.assembly, observation.start, observation.goals)[-1] if parts else {}
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
