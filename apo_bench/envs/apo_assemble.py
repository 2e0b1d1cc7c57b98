"""The environment `APOAssemble-v0`; the docstring of the class is its page in the documentation."""

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
    As `APOInsert-v0` for every operation of an assembly: the robot picks each part by the plan and holds it before its
    hole, the policy moves the tip until the hand opens, and the robot picks the next.

    ## Observation Space
    That of `APOInsert-v0`, and `operation`, `Box(n)`: 1 for the current operation, 0 for the others.

    ## Action Space
    That of `APOInsert-v0`. An open hand ends the operation.

    ## Rewards
    1.0 at the end if the judge finds the whole assembly correct, else 0.0. With `reward="progress"` also, in each of n
    operations, the reward for the depth in the hole, 1 / n in total. `force_penalty` as in `APOInsert-v0`.

    ## Starting State
    That of `APOInsert-v0` at the first operation.

    ## Episode End
    As in `APOInsert-v0`, after the last operation; before that, where the robot cannot pick the next part, where
    something collides, is dropped or is pushed too hard. After `horizon` actions of an operation the hand opens.

    ## Arguments
    Those of `APOInsert-v0` but `operation` and `probe`.

    ## Version History
    - v0: first version.
    """

    def __init__(self, **settings: Any) -> None:
        given = [name for name in ("operation", "probe") if name in settings]
        require(
            not given, f"{' and '.join(given)} was given; all operations are done here, by a robot that does not probe."
        )
        super().__init__(operation=1, probe=False, **settings)
        n = len(self.scene.scenario.assembly)
        self.share /= n
        seen = {**self.observation_space.spaces, "operation": spaces.Box(0.0, 1.0, (n,), np.float32)}  # type: ignore[attr-defined]
        self.observation_space = spaces.Dict(seen)

    @property
    def most_actions(self) -> int:
        """Greatest number of actions of an episode."""
        return self._horizon * len(self.scene.scenario.assembly)

    def _done(self, control: TipControl, reached: Snapshot) -> dict[str, Any]:
        """Begin the next operation, or ask the judge after the last one."""
        begun = self._now()
        if self.operation == len(begun.plan.assembly):
            return super()._done(control, reached)
        follows = self._trials.go_on(begun, control, reached)
        if isinstance(follows, Outcome):
            return ended(follows.code, follows.sentence)
        self._begin(follows)
        return {}

    def _seen(self) -> Seen:
        # one-hot vector of the current operation
        place = np.arange(len(self._now().plan.assembly)) == self.operation - 1
        return {**super()._seen(), "operation": place.astype(np.float32)}
