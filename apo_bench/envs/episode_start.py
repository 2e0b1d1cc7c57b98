"""The starts of `APOInsert-v0`: trials, executed up to the moment at which the policy takes over."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.assembly import Correction, Observation, Outcome, Plan, ReachedState, Snapshot, compute_placements
from apo_bench.envs.robot import RobotSettings
from apo_bench.envs.stated_error import correlate_plan, state_relative_error
from apo_bench.geometry import Array, pose
from apo_bench.judging.verdict import Verdict, judge
from apo_bench.perception.observation.noise import Noise
from apo_bench.records import NO_ROBOT_ERROR
from apo_bench.simulation.execution import plan_moves
from apo_bench.simulation.robot import RobotError
from apo_bench.simulation.scene import Scene
from apo_bench.simulation.task.start import Start, prepare_next_start, prepare_start
from apo_bench.simulation.task.tip_control import TipControl
from apo_bench.trial.planning import apply_method
from apo_bench.trial.trial_stages import (
    WRENCH,
    demonstration_failure,
    observe_demonstration,
    simulate_demonstration,
    stream_key,
)


@final
@dataclass(frozen=True, eq=False)
class EpisodeStart:
    """A trial at the moment at which the policy takes over, with its truth."""

    trial: int
    start: Start
    plan: Plan
    error: RobotError | None
    poses: Array
    """(n, 4, 4), the true poses of the operations, world frame, [m]."""
    joint: Array
    """(6 n, 6 n), stated covariance of the body twists of all planned poses, [m, rad]."""
    covariance: Array
    """(6, 6), stated covariance of the error of the held part relative to its hole at the start: shift of its front,
    then rotation, along world axes, [m, rad]."""

    @property
    def reference(self) -> Array:
        """The true poses of the operations up to this one, (k + 1, 4, 4), world, [m]."""
        return self.poses[: self.start.operation + 1]

    @cached_property
    def _goals(self) -> tuple[tuple[str, str, Array], ...]:
        """Each pair of a held part and a standing one, and where the held one belongs in the frame of the other."""
        assembly = self.plan.assembly
        k = self.start.operation
        true = compute_placements(assembly, self.plan.start, self.poses)[k]
        contacts = assembly.operations[k].contacts
        pairs = sorted({(contact.manipulated.part, contact.environment.part) for contact in contacts})
        return tuple((held, there, pose.inverse(true[there]) @ true[held]) for held, there in pairs)

    def off(self, control: TipControl) -> Array:
        """Return the error of the part relative to its neighbours where they stand now, as `TipControl.off` does."""
        main = self.plan.assembly.operations[self.start.operation].main
        now = control.poses()
        return control.off(
            [now[there] @ goal @ pose.inverse(now[held]) @ now[main] for held, there, goal in self._goals]
        )


class TrialStarts(NamedTuple):
    """The settings that determine a start, except the number of the trial."""

    scene: Scene
    operation: int
    human_error_scale: float
    noise: Noise
    corrector: Any
    robot: RobotSettings

    def begin(self, trial: int) -> EpisodeStart | Outcome:
        """Demonstrate, observe, correct, and execute the operations before this one.

        Returns:
            The start, or the outcome that ended the trial before it.
        """
        scene, k, human_error_scale, noise, corrector, robot = self
        simulated = simulate_demonstration(scene, human_error_scale, trial)
        if simulated.demonstration.code != "ok":
            return demonstration_failure(simulated.demonstration)
        seen = observe_demonstration(simulated, noise, trial)
        made = apply_method(corrector, seen, simulated.layout.poses, where=scene)
        if made.plan is None:
            assert made.failure is not None
            return made.failure
        config = robot.execution(made.plan, scene, trial)
        sensor = robot.ft_sensor, (*stream_key(trial, WRENCH), 1)
        start = prepare_start(made.plan, scene, k, replace(config, time_limit_s=math.inf), sensor)
        if isinstance(start, Outcome):
            return start
        # without an operation before there is nothing to judge
        before = judged(scene, start.after, start.after[-1], simulated.layout.poses[:k]) if k else None
        if before is not None and not before.success:
            code = before.rests_on.code
            return Outcome("judge", code, None, f"the operations before are not right: {before.rests_on.why or code}")
        joint = _correlate(seen, made.correction, made.plan, corrector)
        return EpisodeStart(
            trial,
            start,
            made.plan,
            config.robot_error,
            simulated.layout.poses,
            joint,
            self._state_error(made.plan, start, joint, config.probing is not None),
        )

    def _state_error(self, plan: Plan, start: Start, joint: Array, probes: bool = False) -> Array:
        """Return the stated covariance of the held part relative to its hole, (6, 6), as in `EpisodeStart`.

        Args:
            probes: Whether the robot probes.
        """
        assumed = self.robot.assumed or NO_ROBOT_ERROR
        moves = plan_moves(plan, self.scene, True, probes)
        return state_relative_error(assumed, plan, self.scene, moves, start.operation, start.grip, joint)

    def go_on(self, begun: EpisodeStart, control: TipControl, reached: Snapshot) -> EpisodeStart | Outcome:
        """Return the start of the next operation after one is done, or the outcome that ended the trial before it."""
        key = (*stream_key(begun.trial, WRENCH), 1 + len(begun.reference))
        start = prepare_next_start(
            begun.plan, control.robot, begun.start, reached, begun.error, (self.robot.ft_sensor, key)
        )
        if isinstance(start, Outcome):
            return start
        return replace(begun, start=start, covariance=self._state_error(begun.plan, start, begun.joint))


def judged(scene: Scene, after: tuple[Snapshot | None, ...], final: Snapshot | None, reference: Array) -> Verdict:
    """Judge the first k operations alone.

    Args:
        after: Snapshot after each of them.
        final: Snapshot at the end.
        reference: Their true poses, (k, 4, 4), world, [m].
    """
    return judge(scene.scenario.assembly.first(len(after)), ReachedState(after, final), reference, scene.criteria)


def _correlate(seen: Observation, correction: Correction | None, plan: Plan, corrector: Any) -> Array:
    """Return the stated covariance of the body twists of all planned poses, (6 n, 6 n), [m, rad]."""
    if corrector == "oracle":
        return np.zeros((6 * len(plan.target_poses), 6 * len(plan.target_poses)))
    if correction is None:
        return correlate_plan(seen, plan.target_poses, exact=False)
    return correlate_plan(correction.assumed or seen, plan.target_poses, exact=True)
