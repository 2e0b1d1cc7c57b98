"""Is the assembly right? A pure function of what was reached; it knows no plan, no corrector and no residual.

The two rules: is the finished assembly right, and was it made as it was demonstrated?

The first is what a person says who sees the end, whatever became of it on the way. The second asks for every contact
when it is made, and at the end.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Assembly, Contact, Poses, Reached, Relation, Snapshot, placements
from apo_bench.geometry import Array, Overlap, frozen, nearest_alike, pose
from apo_bench.judging.contacts import (
    ContactJudge,
    ContactMoment,
    ContactVerdict,
    Judgement,
    Share,
    face_overlap,
    judgement,
)
from apo_bench.judging.displaced import displacements, faults_of_place, last_moves
from apo_bench.records import Criteria, Meaning, Thresholds


def judge_finished(
    assembly: Assembly, reached: Reached, reference: Array, thresholds: Thresholds, clearance_mm: float
) -> Judgement:
    """Judge the end: gaps, overlaps, penetration, nothing held, nothing moving, and parts as they were put together.

    Asked for are the contacts that stand at the end. A part may have been put in by any of its symmetries: the one
    nearest in rotation to its true final pose counts, for all its contacts. On a fixed part the area of the overlap
    counts, wherever it is, so that an assembly that is right in itself may stand elsewhere on the table; between
    movable parts the overlap has its place on the environment face. Where fixtures end is free. Parts that touch at the
    end have moved against each other by `pushed_mm` at most since they were put, at any corner and along what their
    contacts leave free; so has a part in a mate of a fixed part. Every operation must have ended.

    Args:
        reached: Sound snapshots.
        reference: (n, 4, 4), the true goals, world frame, [m].
    """
    final = reached.final
    all_made = all(snapshot is not None for snapshot in (*reached.after, reached.final))
    if final is None:
        return judgement((), (), (), thresholds, all_made=False)
    away = fixtures(assembly)
    true = placements(assembly, final.poses, reference)[-1]
    seen = _as_meant(assembly, final.poses, true)
    return judgement(
        tuple(_standing_contacts(ContactJudge(assembly, thresholds, clearance_mm), seen, true, away)),
        [final],
        [(what, 1e3 * m) for what, m in faults_of_place(assembly, reached.after, final, away, seen)],
        thresholds,
        all_made=all_made,
        disturbed=[1e3 * m for _, m in displacements(assembly, reached.after, final, away)],
    )


def fixtures(assembly: Assembly) -> frozenset[str]:
    """The parts that were used and put away.

    The last operation of such a part breaks its last contacts with movable parts and makes contacts with fixed parts
    only. One that ends against a movable part is none, even if that part leaves it later.
    """
    relations = assembly.relations()
    return frozenset(part for part, k in last_moves(assembly).items() if _put_away(assembly, relations, part, k))


def _put_away(assembly: Assembly, relations: tuple[Relation, ...], part: str, k: int) -> bool:
    mine = [relation for relation in relations if part in {end.part for end in relation.contact}]
    movable = [relation for relation in mine if not _on_fixed(assembly, relation.contact)]
    breaks = any(relation.lost == k for relation in movable)
    makes = any(relation.made == k for relation in mine if relation not in movable)
    return breaks and makes and all(relation.lost is not None and relation.lost <= k for relation in movable)


def _on_fixed(assembly: Assembly, contact: Contact) -> bool:
    return any(end.part in assembly.fixed for end in contact)


def _standing_contacts(judge: ContactJudge, seen: Poses, true: Poses, away: frozenset[str]) -> Iterator[ContactVerdict]:
    """The contacts that stand at the end, of parts that are no fixtures."""
    for contact, made, share in _standing(judge.assembly, away):
        yield judge.verdict(contact, made, "end", seen, true, share)


def _standing(assembly: Assembly, away: frozenset[str]) -> Iterator[tuple[Contact, int, Share]]:
    """Contacts that stand at the end, of parts that are no fixtures; what made them, what of an overlap counts."""
    for contact, made, lost in assembly.relations():
        if lost is None and not away & {end.part for end in contact}:
            yield contact, made, _share_of_area if _on_fixed(assembly, contact) else Overlap.share


def least_overlaps(assembly: Assembly, final: Poses, references: Array) -> Array:
    """The least share of the true overlap that a finished assembly covers, for each of several truths, (d,).

    Args:
        references: (d, n, 4, 4), goals that may be the true ones, world frame, [m].

    Returns:
        Not a number where faces that should touch do not meet in the truth itself, so that it cannot be one.
    """
    contacts = tuple(_standing(assembly, fixtures(assembly)))
    return np.array([_least_overlap(assembly, final, placements(assembly, final, T)[-1], contacts) for T in references])


def _least_overlap(
    assembly: Assembly, final: Poses, true: Poses, contacts: Sequence[tuple[Contact, int, Share]]
) -> float:
    seen = _as_meant(assembly, final, true)
    least = 1.0
    for contact, _, share in contacts:
        expected = face_overlap(assembly, contact, true)
        if not expected:
            return math.nan
        least = min(least, share(face_overlap(assembly, contact, seen), expected))
    return least


def _as_meant(assembly: Assembly, final: Poses, true: Poses) -> Poses:
    """Poses of parts turned by that of their symmetries which is nearest to the truth."""
    return {
        part: T if part in assembly.fixed else nearest_alike(assembly.solids[part], T, true[part])
        for part, T in final.items()
    }


def _share_of_area(reached: Overlap, true: Overlap) -> float:
    return min(1.0, reached.area / true.area) if true else 1.0


def judge_demonstrated(
    assembly: Assembly, reached: Reached, reference: Array, thresholds: Thresholds, clearance_mm: float
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
    """
    after = reached.after
    final = reached.final
    judge = ContactJudge(assembly, thresholds, clearance_mm)
    states = [snapshot for snapshot in (*after, final) if snapshot is not None]
    return judgement(
        _contacts_when_made(judge, after, final, reference),
        states,
        [(part, push * 1e3) for part, push in (*_pushes(assembly, after, final), *_corners_at_end(assembly, reached))],
        thresholds,
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
    true = placements(judge.assembly, first.poses, reference)
    out = []
    for contact, made, lost in judge.assembly.relations():
        moments: Mapping[ContactMoment, Snapshot | None] = {"made": after[made], "end": final if lost is None else None}
        for moment, snapshot in moments.items():
            if snapshot is not None:
                out.append(judge.verdict(contact, made, moment, snapshot.poses, true[made], Overlap.share))
    return tuple(out)


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


def _corners_at_end(assembly: Assembly, reached: Reached) -> Iterator[tuple[str, float]]:
    """How far a corner of each part that is no fixture lies at most from where its last operation had put it, [m]."""
    if reached.final is not None:
        yield from displacements(assembly, reached.after, reached.final, fixtures(assembly))


@final
@check_arguments
@dataclass(frozen=True)
class Verdict:
    """Whether an assembly succeeded, by both rules."""

    meaning: Meaning
    finished: Judgement
    """The judgement of the end: what a person says who sees the finished assembly."""
    demonstrated: Judgement
    """The judgement of every contact when it was made, too: what a person says who watched the demonstration."""

    @property
    def success(self) -> bool:
        """The finished assembly is right; where the scenario says so, it was made as demonstrated, too."""
        return self.as_demonstrated if self.meaning == "as_demonstrated" else self.finished.holds

    @property
    def as_demonstrated(self) -> bool:
        """The finished assembly is right, and each contact was made when and where it was shown."""
        return self.finished.holds and self.demonstrated.holds

    @property
    def loose_success(self) -> bool:
        """Every contact that `success` asks for is there within millimetres and degrees; implied by `success`."""
        return self.rests_on.loose

    @property
    def rests_on(self) -> Judgement:
        """The faults and numbers behind `success`: those of the stricter rule where it is asked for and fails."""
        strict = self.meaning == "as_demonstrated" and (self.finished.holds or not self.demonstrated.holds)
        return self.demonstrated if strict else self.finished


@check_arguments
def judge(assembly: Assembly, reached: Reached, reference: Array, criteria: Criteria) -> Verdict:
    """Judge what was reached.

    Args:
        reached: Snapshots after each operation and at the end. One that is missing, or whose poses are not finite,
            fails the assembly.
        reference: (n, 4, 4), the true goals, world frame, [m]; they say how large an overlap should be, how far
            apart faces may be, and which of a part's symmetries is meant.
    """
    reference = frozen(reference, len(assembly), 4, 4)
    sound = Reached(after=tuple(map(_sound, reached.after)), final=_sound(reached.final))
    return Verdict(
        criteria.success_means,
        finished=judge_finished(assembly, sound, reference, criteria.thresholds, criteria.clearance_mm),
        demonstrated=judge_demonstrated(assembly, sound, reference, criteria.thresholds, criteria.clearance_mm),
    )


def _sound(snapshot: Snapshot | None) -> Snapshot | None:
    """The snapshot, unless a pose in it is not finite."""
    if snapshot is None or not all(np.isfinite(T).all() for T in snapshot.poses.values()):
        return None
    return snapshot
