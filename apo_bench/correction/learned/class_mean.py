"""`class-mean+contact`: what is always wrong with the model of a part is taken off, then contacts correct the rest."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Assembly, Correction, Observation
from apo_bench.correction.robust.robust import contact_robust
from apo_bench.geometry import Array, copyable, freeze, pose


@copyable
@final
@dataclass(frozen=True, eq=False)
class ClassMean:
    """A corrector: it takes off the mean error of each class, then it is `contact-robust`.

    A class is a part by its name. What is stated of the noise stays.
    """

    twists: Mapping[str, Array]
    """Part -> (6,): the body twist by which it is seen wrong on average, [m, rad]. Others are seen as they are."""

    def __post_init__(self) -> None:
        freeze(self, twists=(6,))

    def __call__(self, observation: Observation) -> Correction:
        off = [self.twists.get(operation.main, np.zeros(6)) for operation in observation.assembly.operations]
        back = pose.exp(-np.array(off).reshape(-1, 6))
        # What was not seen has the pose of a guess, which no camera was wrong about.
        goals = np.where(observation.seen[:, None, None], observation.goals @ back, observation.goals)
        return contact_robust(replace(observation, goals=goals))


def class_mean(assembly: Assembly, goals: Array, truth: Array, seen: NDArray[np.bool_]) -> ClassMean:
    """The mean errors of the parts of an assembly, from pairs of observation and truth.

    One observation does not tell an error that is the same in all: where contacts fix a part, `contact-robust` has
    corrected it already, and where they leave it free nothing shows it. So pairs of other trials are asked, as
    `apo_bench.datasets.pairs` draws them, whose seeds no trial has.
    The mean is the median of each number of the twist, which outliers do not move.

    Args:
        goals, truth: (n, k, 4, 4), as seen and as they are, world frame, [m].
        seen: (n, k), whether an operation was seen at all.
    """
    xi = pose.log(pose.inverse(truth) @ goals)
    mains = [operation.main for operation in assembly.operations]
    rows = {part: [k for k, main in enumerate(mains) if main == part] for part in mains}
    known = {part: xi[:, k][seen[:, k]] for part, k in rows.items()}
    return ClassMean({part: np.median(errors, axis=0) for part, errors in known.items() if len(errors)})
