"""All operations for learners: `APOAssemble-v0`, the same control as `APOInsert-v0`."""

from typing import Any

import numpy as np
from gymnasium import spaces

from apo_bench.assembly import Outcome, Snapshot
from apo_bench.envs.apo_insert import APOInsert, Seen, ended
from apo_bench.errors import require
from apo_bench.simulation.task.tip_control import TipControl


class APOAssemble(APOInsert):
    """Insert all parts, one after the other.

    ## Description
    As `APOInsert-v0` for every operation of an assembly: the robot takes each part by the plan and holds it before its
    mouth, the learner leads the tip until the hand lets go, and the robot takes the next.

    ## Observation Space
    That of `APOInsert-v0`, and `operation`, `Box(n)`: 1 for the operation that is done, 0 for the others.

    ## Action Space
    That of `APOInsert-v0`. An open hand ends the operation.

    ## Rewards
    1.0 at the end if the judge finds the whole assembly right; else 0.0. With `reward="progress"` also, in each of n
    operations, the share of its way in, 1 / n in all.

    ## Starting State
    That of `APOInsert-v0` at the first operation.

    ## Episode End
    As in `APOInsert-v0`, after the last operation; before that, where the robot cannot take the next part, or where
    something is struck, lost or pushed too hard. An operation lasts `horizon` actions at most.

    ## Arguments
    Those of `APOInsert-v0` but `operation` and `feels`.

    ## Version History
    - v0: first version.
    """

    def __init__(self, **settings: Any) -> None:
        given = [name for name in ("operation", "probing") if name in settings]
        require(
            not given, f"{' and '.join(given)} was given; all operations are done here, and nothing is felt before."
        )
        super().__init__(operation=1, probing=False, **settings)
        n = len(self.scene.scenario.assembly)
        self.share /= n
        seen = {**self.observation_space.spaces, "operation": spaces.Box(0.0, 1.0, (n,), np.float32)}  # type: ignore[attr-defined]
        self.observation_space = spaces.Dict(seen)

    def _done(self, control: TipControl, reached: Snapshot) -> dict[str, Any]:
        """Go on with the next operation, or ask the judge."""
        begun = self._now()
        if self.operation == len(begun.plan.assembly):
            return super()._done(control, reached)
        follows = self._trials.go_on(begun, control, reached)
        if isinstance(follows, Outcome):
            return ended(follows.code, follows.sentence)
        self._begin(follows)
        return {}

    def _seen(self) -> Seen:
        place = np.arange(len(self._now().plan.assembly)) == self.operation - 1
        return {**super()._seen(), "operation": place.astype(np.float32)}
