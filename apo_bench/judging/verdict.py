"""Is the assembly right? A pure function of what was reached; it knows no plan, no corrector and no residual."""

from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Assembly, Meetings, Reached, Snapshot
from apo_bench.geometry import Array, frozen
from apo_bench.judging.contacts import ContactJudge
from apo_bench.judging.demonstrated import judge_demonstrated
from apo_bench.judging.finished import judge_finished
from apo_bench.judging.judgement import Judgement
from apo_bench.records import Criteria, Meaning


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
        """Every contact that `success` needs is there within millimetres and degrees; implied by `success`."""
        return self.rests_on.loose

    @property
    def rests_on(self) -> Judgement:
        """The faults and numbers behind `success`: those of the stricter rule where it applies and fails."""
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
    sound = Reached(after=tuple(map(_drop_non_finite, reached.after)), final=_drop_non_finite(reached.final))
    contacts = ContactJudge(Meetings(assembly), criteria.thresholds, criteria.clearance_mm)
    return Verdict(
        criteria.success_means,
        finished=judge_finished(contacts, sound, reference),
        demonstrated=judge_demonstrated(contacts, sound, reference),
    )


def _drop_non_finite(snapshot: Snapshot | None) -> Snapshot | None:
    """The snapshot, unless a pose in it is not finite."""
    if snapshot is None or not all(np.isfinite(T).all() for T in snapshot.poses.values()):
        return None
    return snapshot
