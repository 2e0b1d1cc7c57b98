"""The environment `APOTrack-v0`: operation by operation (Section 4.2 of the paper)."""

from typing import Any, final

import gymnasium
import numpy as np
from numpy.typing import NDArray

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Observation, Outcome, ReplayResult, Step
from apo_bench.envs.actions import describe_numbers
from apo_bench.envs.apo_replay import APOReplay
from apo_bench.envs.episode import VERDICTS, step_info, verdicts
from apo_bench.envs.spaces import Seen, packed, track_spaces
from apo_bench.envs.tracking import Policy, Tracked, TrackingAction, observe_first, reach_exactly
from apo_bench.errors import InputError, shown
from apo_bench.geometry import Array, pose
from apo_bench.judging.verdict import judge
from apo_bench.records import Criteria, describe_outcome
from apo_bench.trial.trial_stages import Attempt, SimulatedDemonstration, demonstration_failure, trial_outcome

DO, UNDO, FINISH = range(3)  # values of `act`


@final
@check_arguments
class APOTrack(gymnasium.Env[Seen, dict[str, Any]]):
    """Follow a human, operation by operation.

    ## Description
    The robot observes an operation of a human with an error and does it; then it observes the next one. When contacts
    show that an earlier operation was done at a wrong pose, it can undo operations back to that one and do them again.
    At the end the whole schedule is replayed, with the undone steps, and judged.

    ## Observation Space
    A `Dict` for n operations: `poses`, `covariance` and `observed` as in `APOReplay-v0`, with identities and zeros for
    operations that were not shown yet; `shown`, `MultiBinary(n)`: the operations that were shown; `done`,
    `MultiBinary(n)`: those that are done; `placed`, `Box(n, 7)`: the poses at which they were done, of others as
    `poses`.

    ## Action Space
    A `Dict`: `act`, `Discrete(3)`: 0 do the next operation, 1 undo the last one that is done, 2 finish; and `twist`,
    `Box(6)`, [m, rad], within 0.1 m and 0.5 rad: the next operation is done at `pose @ exp(twist)` of its observed
    pose. `info["action_mask"]`, (3,) of int8, marks the acts that are possible; another one changes nothing. An episode
    that finishes before all operations are done fails.

    ## Rewards
    0.0 until the end, then 1.0 if the assembly is correct, else 0.0. With `replay` the judge decides on a replay of the
    whole schedule; without, on parts that stand exactly at the poses where they were put, which is faster and ignores
    whether a robot can bring them there.

    ## Starting State
    As in `APOReplay-v0`, with its options. The first operation was shown, none is done.

    ## Episode End
    It terminates when it is finished, and is truncated after 2 n^2 acts. The last `info` is that of `APOReplay-v0`.

    ## Arguments
    - `scenario`: as in `APOReplay-v0`.
    - `replay`: whether the schedule is replayed at the end.
    - all others: as in `APOReplay-v0`.

    ## Version History
    - v0: first version.
    """

    metadata = APOReplay.metadata

    def __init__(self, scenario: Any = "stick_in_tower", replay: bool = True, **of_replay: Any) -> None:
        self._base = APOReplay(scenario, **of_replay)  # simulates the episode and judges its replay
        self._replay = replay
        self.render_mode = self._base.render_mode
        n = len(self._base.assembly)
        self._most = 2 * n * n  # acts after which an episode is truncated
        self.observation_space, self.action_space = track_spaces(n)
        self._placed: Array = np.zeros((0, 4, 4))  # (n, 4, 4): poses at which operations were done, else observed poses
        self._schedule: list[Step] = []
        self._step_poses: list[Array] = []  # target pose of each step of the schedule
        self._done = self._shown = self._acts = 0
        self._over = True

    @check_arguments
    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        """Observe another demonstration; `seed=k` is trial k."""
        super().reset(seed=seed)
        _, info = self._base.reset(seed=seed, options=options)
        self._placed = np.array(self._base.observation.poses)
        self._schedule, self._step_poses = [], []
        self._done = self._acts = 0
        self._shown = min(1, len(self._placed))
        self._over = False
        return self._entries(), {**info, "action_mask": self._mask()}

    def step(self, action: dict[str, Any]) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Do an operation, undo one, or finish.

        Raises:
            ResetNeeded: The episode is over, or there is none.
            InputError: The action is not in the action space.
        """
        if self._over:
            raise gymnasium.error.ResetNeeded("the episode is over, or there is none; call reset().")
        if not self.action_space.contains(action):
            given = shown(action)
            if isinstance(action, dict):
                given = ", ".join(f"{name!r}: {describe_numbers(each)}" for name, each in action.items())
            raise InputError(
                f"{given or 'an empty dict'} was given as an action; a dict is needed, with 'act', 0 (do), 1 (undo) or "
                "2 (finish), and 'twist', an array of float64 of shape (6,) within 0.1 m and 0.5 rad per axis."
            )
        act = int(action["act"])
        self._acts += 1
        if act == FINISH:
            self._over = True
            reward, info = self._judged()
            return self._entries(), reward, True, False, {**info, "action_mask": self._mask()}
        if self._mask()[act]:
            self._do(act == UNDO, action["twist"])
        self._over = self._acts >= self._most
        return self._entries(), 0.0, False, self._over, {"action_mask": self._mask()}

    @property
    def tracked(self) -> Tracked:
        """The operations shown so far as one typed object, for a policy."""
        m = self._shown
        return Tracked(observe_first(self._base.observation, m), self._placed[:m].copy())

    @property
    def schedule(self) -> tuple[Step, ...]:
        """The steps so far, undone operations included."""
        return tuple(self._schedule)

    @property
    def placed(self) -> Array:
        """(n, 4, 4): the poses at which operations were done last; the observed poses of those that never were."""
        return self._placed.copy()

    def action(self, act: TrackingAction) -> dict[str, Any]:
        """Return the action, as the action space holds it, for an act of a policy."""
        goal = self._base.observation.poses[self._done - act.undo]  # the last operation done, or the next one
        twist = np.zeros(6) if act.undo else pose.log(pose.inverse(goal) @ act.target)
        return {"act": UNDO if act.undo else DO, "twist": twist}

    def render(self) -> Any:
        """As in `APOReplay-v0`."""
        return self._base.render()

    def close(self) -> None:
        """Close the window, if one is open."""
        self._base.close()

    def _do(self, undo: bool, twist: Array) -> None:
        """Undo the last operation, or do the next one with a body twist, (6,), [m, rad]."""
        self._done -= undo
        k = self._done
        if not undo:
            self._placed[k] = self._base.observation.poses[k] @ pose.exp(twist)
            self._done += 1
            # doing an operation shows the next one
            self._shown = min(max(self._shown, self._done + 1), len(self._placed))
        self._schedule.append(Step(k, undo))
        self._step_poses.append(self._placed[k].copy())

    def _judged(self) -> tuple[float, dict[str, Any]]:
        """Return reward and `info` of the finished episode."""
        if self._done < len(self._placed):
            return _end_info(
                dict.fromkeys(VERDICTS, False), Outcome("judge", "not_made", self._done, describe_outcome("not_made"))
            )
        if not self._replay:
            return _judged_at(
                self._placed, self._base.observation, self._base._current("").simulated, self._base._scene.criteria
            )
        self._base.aim(self._placed, self._schedule, np.array(self._step_poses))
        # zeros replay the aimed plan as it is
        _, reward, _, _, info = self._base.step(np.zeros((len(self._placed), 6)))
        return reward, info

    def _mask(self) -> NDArray[np.int8]:
        """Return which acts are possible: do, undo, finish; none after the end."""
        possible = self._done < self._shown, self._done > 0, True
        return np.array([each and not self._over for each in possible], dtype=np.int8)

    def _entries(self) -> Seen:
        """Return the observation; operations that were not shown have identities and zeros."""
        n = len(self._placed)
        seen: Observation = self._base.observation
        shown = np.arange(n) < self._shown
        done = np.arange(n) < self._done
        goals = np.where(shown[:, None, None], seen.poses, np.eye(4))
        return {
            "poses": packed(goals),
            "covariance": np.where(shown[:, None, None], seen.covariance, 0.0),
            "observed": (shown & seen.observed).astype(np.int8),
            "shown": shown.astype(np.int8),
            "done": done.astype(np.int8),
            "placed": packed(np.where(done[:, None, None], self._placed, goals)),
        }


def _judged_at(
    goals: Array, seen: Observation, simulated: SimulatedDemonstration, criteria: Criteria
) -> tuple[float, dict[str, Any]]:
    """Judge parts that stand exactly at these poses, (n, 4, 4), world, [m]; returns reward and `info`."""
    if simulated.demonstration.code != "ok":
        return _end_info(dict.fromkeys(VERDICTS, False), demonstration_failure(simulated.demonstration))
    reached = reach_exactly(seen, goals)
    verdict = judge(seen.assembly, reached, simulated.layout.poses, criteria)
    there = ReplayResult(reached, Outcome("done", "ok", None, describe_outcome("ok")), 0.0, 0.0)
    return _end_info(verdicts(verdict), trial_outcome(Attempt(there, verdict)))


def _end_info(verdicts: dict[str, bool], end: Outcome) -> tuple[float, dict[str, Any]]:
    """Return reward and final `info` without predictions."""
    return float(verdicts["is_success"]), step_info(verdicts, end, None, None)


def follow(env: APOTrack, policy: Policy) -> tuple[float, dict[str, Any]]:
    """Run one episode by a policy, from the state after a reset to its end.

    Returns:
        The reward and the last `info`.
    """
    for _ in env.placed:  # each pass ends with one more operation done
        acts = policy(env.tracked)
        for act in acts:
            env.step(env.action(act))
        if not acts:
            break  # a policy that returns no act gives up
    _, reward, _, _, info = env.step({"act": FINISH, "twist": np.zeros(6)})
    return reward, info
