"""Judge the reached state of an assembly; a pure function that knows no plan, no corrector and no residual."""

from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Assembly, ContactMeasurements, ReachedState, Snapshot
from apo_bench.geometry import Array, copy_frozen
from apo_bench.judging.as_demonstrated import judge_demonstrated
from apo_bench.judging.contact_limits import ContactJudge
from apo_bench.judging.finished_assembly import judge_finished, list_fixtures
from apo_bench.judging.judgement import Judgement
from apo_bench.judging.part_displacement import measure_displacements
from apo_bench.records import Criteria, Meaning


@final
@check_arguments
@dataclass(frozen=True)
class Verdict:
    """Whether an assembly succeeded, by the rule for the finished assembly and by the rule for every contact."""

    meaning: Meaning
    """The rule that decides `success`: `assembled` or `as_demonstrated`."""
    finished: Judgement
    """The judgement of the finished assembly."""
    demonstrated: Judgement
    """The judgement of every contact at the time at which it was made."""

    @property
    def success(self) -> bool:
        """Whether the trial succeeded by the rule that the scenario names (`meaning`)."""
        return self.as_demonstrated if self.meaning == "as_demonstrated" else self.finished.holds

    @property
    def as_demonstrated(self) -> bool:
        """Whether the finished assembly is right and each contact was made when and where it was demonstrated."""
        return self.finished.holds and self.demonstrated.holds

    @property
    def loose_success(self) -> bool:
        """Whether every contact that `success` needs holds within 5 mm and 5 degrees; `success` implies it."""
        return self.rests_on.loose

    @property
    def rests_on(self) -> Judgement:
        """The faults and numbers behind `success`: those of the stricter rule where it applies and fails."""
        strict = self.meaning == "as_demonstrated" and (self.finished.holds or not self.demonstrated.holds)
        return self.demonstrated if strict else self.finished


@check_arguments
def judge(assembly: Assembly, reached: ReachedState, reference: Array, criteria: Criteria) -> Verdict:
    """Judge the state that a replay reached.

    Args:
        assembly: Solids, operations and contacts.
        reached: Snapshots after each operation and at the end. A missing snapshot, or one with poses that are not
            finite, fails the assembly.
        reference: (n, 4, 4), the true target poses, world frame, [m]. They state the size of every overlap, the
            allowed distance of faces, and the symmetry of a part that is meant.
        criteria: Thresholds, clearance and rule; `Scene.criteria` has those of a scene.

    Returns:
        Both judgements, with faults and numbers.
    """
    reference = copy_frozen(reference, len(assembly), 4, 4)
    sound = ReachedState(after=tuple(map(_drop_non_finite, reached.after)), final=_drop_non_finite(reached.final))
    contacts = ContactJudge(ContactMeasurements(assembly), criteria.thresholds, criteria.clearance_mm)
    displaced = measure_displacements(assembly, sound, list_fixtures(assembly))
    return Verdict(
        criteria.success_means,
        finished=judge_finished(contacts, sound, reference, displaced),
        demonstrated=judge_demonstrated(contacts, sound, reference, displaced),
    )


def _drop_non_finite(snapshot: Snapshot | None) -> Snapshot | None:
    """The snapshot, unless a pose in it is not finite."""
    if snapshot is None or not all(np.isfinite(T).all() for T in snapshot.poses.values()):
        return None
    return snapshot
