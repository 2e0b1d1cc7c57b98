"""Judge whether the assembly was made as demonstrated: every contact when it is made, and again at the end."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from apo_bench.assembly import Assembly, ReachedState, Snapshot, compute_placements
from apo_bench.geometry import Array, pose
from apo_bench.judging.contact_limits import ContactCase, ContactJudge, ContactMoment, ContactVerdict
from apo_bench.judging.judgement import Judgement, make_judgement


def judge_demonstrated(
    judge: ContactJudge, reached: ReachedState, reference: Array, displaced: Mapping[str, float]
) -> Judgement:
    """Judge every contact when it is made and, if it is not broken later, at the end; and every snapshot.

    Conditions:

    - |e| at the corners of the overlap is at most the clearance plus a margin (fit contacts) or `support_mm` (others);
    - the overlap covers the required share of the true one, at its place on the environment face. An assembly that is
    right
      in itself but stands elsewhere on the table is therefore not as demonstrated;
    - no two geoms penetrate too deep, nothing holds a part, and nothing moves;
    - no centroid of a placed part is pushed before its next operation, and at the end no corner; fixtures are exempt at
    the
      end.

    Args:
        reached: Snapshots with finite poses.
        reference: (n, 4, 4), the true target poses, world frame, [m].
        displaced: From `measure_displacements`, [m].
    """
    assembly = judge.known.assembly
    after = reached.after
    final = reached.final
    states = [snapshot for snapshot in (*after, final) if snapshot is not None]
    return make_judgement(
        _judge_contacts_when_made(judge, after, final, reference),
        states,
        [(part, push * 1e3) for part, push in (*_measure_pushes(assembly, after, final), *displaced.items())],
        judge.thresholds,
        all_made=len(states) == len(after) + 1,
    )


def _judge_contacts_when_made(
    judge: ContactJudge, after: Sequence[Snapshot | None], final: Snapshot | None, reference: Array
) -> tuple[ContactVerdict, ...]:
    """The verdict on every contact in the snapshot after its operation, and at the end if it is not broken.

    Moments without a snapshot are left out.
    """
    first = next((snapshot for snapshot in (*after, final) if snapshot is not None), None)
    if first is None:
        return ()
    # The true pose of a part that was not moved yet, such as a fixed one, is that in the first snapshot.
    true = compute_placements(judge.known.assembly, first.poses, reference)
    cases = []
    for contact, made, lost in judge.known.assembly.relations():
        moments: Mapping[ContactMoment, Snapshot | None] = {"made": after[made], "end": final if lost is None else None}
        for moment, snapshot in moments.items():
            if snapshot is not None:
                cases.append(ContactCase(contact, made, moment, snapshot.poses, true[made]))
    return judge.verdicts(cases)


def _measure_pushes(
    assembly: Assembly, after: Sequence[Snapshot | None], final: Snapshot | None
) -> Iterator[tuple[str, float]]:
    """Part and distance of its centroid, at each later moment, from where its last operation put it, [m]."""
    placed: dict[str, Array] = {}  # part -> its centroid after its last operation
    for k, snapshot in enumerate((*after, final)):
        moved = assembly.operations[k].moves if k < len(assembly) else ()
        for part in moved:
            placed.pop(part, None)  # a part that moves now starts anew
        if snapshot is not None:
            centroids = {part: assembly.solids[part].centroid[None] for part in (*placed, *moved)}
            centroid_then = {
                part: pose.apply(snapshot.poses[part], centroid)[0] for part, centroid in centroids.items()
            }
            yield from (
                (part, float(np.linalg.norm(centroid_then[part] - position))) for part, position in placed.items()
            )
            placed.update({part: centroid_then[part] for part in moved})
