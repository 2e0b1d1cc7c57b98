"""The corrector without memory (Section 3.1): the parts where they stand at the end, one pose each, no ODL."""

from __future__ import annotations

import numpy as np

from apo_bench.assembly import Assembly, Operation
from apo_bench.correction.candidates import candidates
from apo_bench.correction.ending import refused, sentence, status
from apo_bench.correction.equations import equations, gap, largest
from apo_bench.correction.newton import solve
from apo_bench.placement import placed
from apo_bench.program import Correction, Observation


def no_history(seen: Observation) -> Correction:
    """Correct object poses by the contacts that stand at the end; operations get what their part was left with.

    A part that was carried has a pose of its own, begun where the motion parameters put it. The pose of a part
    becomes the motion parameter of the operation that moved it last, if that moved it as the main part. All other
    motion parameters stay as they were seen.

    Returns:
        The status says whether the standing contacts hold at the object poses; the gaps are those of every contact
        ever made. `freed` are the operations that got a new motion parameter.
    """
    if not seen.seen.all():
        return refused(seen)
    last = {part: k for k, operation in enumerate(seen.assembly.operations) for part in operation.moves}
    end, parts = _end(seen.assembly, tuple(last)), tuple(last)
    poses = np.array([placed(seen.assembly, seen.start, seen.goals)[-1][part] for part in parts]).reshape(-1, 4, 4)
    system = equations(end, seen.start, poses)
    freed = candidates(end, ~(system.gaps(poses) <= seen.gap_m))
    found = solve(system.among(system.containing(freed)), poses, freed)
    ended = status(found, largest(system.gaps(found.goals)), seen.gap_m)
    main = {last[parts[i]]: found.goals[i] for i in freed if seen.assembly.operations[last[parts[i]]].main == parts[i]}
    goals = np.array(seen.goals)
    for k, T in main.items():
        goals[k] = T
    return Correction(
        goals=goals,
        status=ended,
        sentence=sentence(ended, seen.gap_m, "every contact that stands at the end"),
        freed=tuple(sorted(main, reverse=True)),
        gap_before_m=gap(seen.assembly, seen.start, seen.goals),
        gap_after_m=gap(seen.assembly, seen.start, goals),
        rank=found.rank,
        trace=found.trace,
    )


def _end(assembly: Assembly, parts: tuple[str, ...]) -> Assembly:
    """Every moved part put where it stands by an operation of its own, then all contacts that stand."""
    standing = tuple(relation.contact for relation in assembly.relations() if relation.lost is None)
    *others, final = parts or ("",)
    operations = (*map(Operation, others), Operation(final, standing)) if parts else ()
    return Assembly(assembly.solids, operations, assembly.fixed)
