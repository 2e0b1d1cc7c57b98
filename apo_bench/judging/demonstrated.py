"""Judge whether the assembly was made as demonstrated: every contact when it is made, and at the end."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from apo_bench.assembly import Assembly, ReachedState, Snapshot, compute_placements
from apo_bench.geometry import Array, pose
from apo_bench.judging.contacts import ContactCase, ContactJudge, ContactMoment, ContactVerdict
from apo_bench.judging.judgement import Judgement, judgement


def judge_demonstrated(
    judge: ContactJudge, reached: ReachedState, reference: Array, displaced: Mapping[str, float]
) -> Judgement:
    """Judge every contact when it is made and, if it still stands, at the end; and every state for what is around it.

    At the corners of the overlap of the nominal faces |e| is at most the clearance plus a margin for fit contacts and
    `support_mm` for the others; the overlap is at least a part of the true one, at its place on the environment face,
    so an assembly that is right in itself but stands elsewhere on the table is not what was shown; no two geoms are
    too deep in each other; nothing holds a part; nothing moves; no centre of a part that was in place is pushed before
    it is moved again, and at the end no corner, but of fixtures.

    Args:
        reached: Sound snapshots.
        reference: (n, 4, 4), the true goals, world frame, [m].
        displaced: From `displacements`, [m].
    """
    assembly = judge.known.assembly
    after = reached.after
    final = reached.final
    states = [snapshot for snapshot in (*after, final) if snapshot is not None]
    return judgement(
        _contacts_when_made(judge, after, final, reference),
        states,
        [(part, push * 1e3) for part, push in (*_pushes(assembly, after, final), *displaced.items())],
        judge.thresholds,
        all_made=len(states) == len(after) + 1,
    )


def _contacts_when_made(
    judge: ContactJudge, after: Sequence[Snapshot | None], final: Snapshot | None, reference: Array
) -> tuple[ContactVerdict, ...]:
    """Every contact in the snapshot after its operation, and at the end if it still stands.

    Moments of which there is no snapshot are left out.
    """
    first = next((snapshot for snapshot in (*after, final) if snapshot is not None), None)
    if first is None:
        return ()
    # A part that was not moved yet, fixed ones above all, counts as true where it stands in the first snapshot.
    true = compute_placements(judge.known.assembly, first.poses, reference)
    cases = []
    for contact, made, lost in judge.known.assembly.relations():
        moments: Mapping[ContactMoment, Snapshot | None] = {"made": after[made], "end": final if lost is None else None}
        for moment, snapshot in moments.items():
            if snapshot is not None:
                cases.append(ContactCase(contact, made, moment, snapshot.poses, true[made]))
    return judge.verdicts(cases)


def _pushes(
    assembly: Assembly, after: Sequence[Snapshot | None], final: Snapshot | None
) -> Iterator[tuple[str, float]]:
    """How far the centroid of each part lies, at each later moment, from where its last operation had put it, [m]."""
    put: dict[str, Array] = {}
    for k, snapshot in enumerate((*after, final)):
        moved = assembly.operations[k].moves if k < len(assembly) else ()
        for part in moved:
            put.pop(part, None)
        if snapshot is not None:
            centroids = {part: assembly.solids[part].centroid[None] for part in (*put, *moved)}
            at = {part: pose.apply(snapshot.poses[part], c)[0] for part, c in centroids.items()}
            yield from ((part, float(np.linalg.norm(at[part] - where))) for part, where in put.items())
            put.update({part: at[part] for part in moved})
