"""The starts of `APOInsert-v0`: trials as the bench draws them, carried out up to where the learner takes over.

The robot of an environment: what is wrong with it, whether it feels, and one replay by it.
"""

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.assembly import Correction, Observation, Outcome, Plan, Reached, Snapshot, placements
from apo_bench.geometry import Array, pose
from apo_bench.judging.verdict import Verdict, judge
from apo_bench.perception.observation.noise import Noise
from apo_bench.records import (
    NO_ROBOT_ERROR,
    assumed_error,
    checked_assumed_robot_error,
    checked_ft_sensor,
    checked_robot_error,
    robot_sigmas,
)
from apo_bench.simulation.robot import RobotError
from apo_bench.simulation.scene import Scene
from apo_bench.simulation.task.start import Start, go_on, prepare
from apo_bench.simulation.task.tip_control import TipControl
from apo_bench.trial.planning import apply_method
from apo_bench.trial.stages import (
    WRENCH,
    Attempt,
    demonstration_failure,
    draw_robot_error,
    observe_demonstration,
    replay_and_judge,
    simulate_demonstration,
    stream_key,
)
from apo_bench.trial.trial import probing_config

LONGEST_REPLAY_S = 1000.0
"""Simulated time after which a replay begins no further step: seven times the longest of the benchmark."""


class RobotSettings(NamedTuple):
    """As the environment's arguments of these names."""

    robot_error: str
    probing: bool
    wrench: str
    assumed_robot_error: str

    def checked(self) -> "RobotSettings":
        """The same, spelled as rows spell them.

        Raises:
            InputError: An unknown name, or a number that is not allowed.
        """
        error = checked_robot_error(self.robot_error)
        return RobotSettings(
            error,
            bool(self.probing),
            checked_ft_sensor(self.wrench),
            checked_assumed_robot_error(self.assumed_robot_error),
        )


def carried_out(
    robot: RobotSettings, plan: Plan, scene: Scene, reference: Array, trial: int, watch: Any, fidelity: str
) -> Attempt:
    """One replay by this robot, and the verdict on it.

    Args:
        reference: As in `replay_and_judge`.
        trial: Its number; the robot's errors, and the noise of what it feels, are those of this trial.
        watch, fidelity: As in `replay_and_judge`.
    """
    told = assumed_error(robot.assumed_robot_error, robot.robot_error)
    return replay_and_judge(
        plan,
        scene,
        reference,
        watch,
        fidelity,
        spiral=robot.probing,
        most_s=LONGEST_REPLAY_S,
        error=draw_robot_error(robot.robot_error, scene, trial),
        probing=probing_config(plan, scene, told, stream_key(trial, WRENCH), robot.wrench) if robot.probing else None,
    )


@final
@dataclass(frozen=True, eq=False)
class Begun:
    """A trial up to where the learner takes over, with its truth."""

    trial: int
    start: Start
    plan: Plan
    error: RobotError | None
    goals: Array
    """(n, 4, 4), the true goals, world frame, [m]."""
    covariances: Array
    """(n, 6, 6), stated, of the twist by which each part may be wrong at its goal, in its own frame, [m, rad]."""

    @property
    def reference(self) -> Array:
        """(k + 1, 4, 4), the true goals up to this operation, world frame, [m]."""
        return self.goals[: self.start.operation + 1]

    @property
    def covariance(self) -> Array:
        """(6, 6), that of this operation."""
        return np.asarray(self.covariances[self.start.operation])

    def off(self, control: TipControl) -> Array:
        """By how much the part is off where its neighbours, as they stand now, want it; as `TipControl.off`."""
        assembly = self.plan.assembly
        k = self.start.operation
        operation = assembly.operations[k]
        true = placements(assembly, self.plan.start, self.goals)[k]
        now = control.poses()
        # Where a part in the hand, the main one or one that it carries, belongs beside a part that stands.
        pairs = sorted({(contact.manipulated.part, contact.environment.part) for contact in operation.contacts})
        wanted = [
            now[there] @ pose.inverse(true[there]) @ true[held] @ pose.inverse(now[held]) for held, there in pairs
        ]
        return control.off([T @ now[operation.main] for T in wanted])


class Trials(NamedTuple):
    """All that a start is made of but its trial."""

    scene: Scene
    operation: int
    human_error_scale: float
    noise: Noise
    corrector: Any
    robot: RobotSettings

    def begin(self, trial: int) -> Begun | Outcome:
        """Demonstrate, observe, correct, and carry out what comes before; or what failed on the way there."""
        scene, k, human_error_scale, noise, corrector, robot = self
        simulated = simulate_demonstration(scene, human_error_scale, trial)
        if simulated.demonstration.code != "ok":
            return demonstration_failure(simulated.demonstration)
        seen = observe_demonstration(simulated, noise, trial)
        made = apply_method(corrector, seen, simulated.layout.poses, where=scene)
        if made.plan is None:
            assert made.failure is not None
            return made.failure
        key = stream_key(trial, WRENCH)
        told = assumed_error(robot.assumed_robot_error, robot.robot_error)
        probing = probing_config(made.plan, scene, told, key, robot.wrench) if robot.probing else None
        error = draw_robot_error(robot.robot_error, scene, trial)
        start = prepare(made.plan, scene, k, error, probing, (robot.wrench, (*key, 1)))
        if isinstance(start, Outcome):
            return start
        before = judged(scene, start.after, start.after[-1], simulated.layout.poses[:k]) if k else None
        if before is not None and not before.success:
            code = before.rests_on.code
            return Outcome("judge", code, None, f"what was put before is not right: {before.rests_on.why or code}")
        return Begun(trial, start, made.plan, error, simulated.layout.poses, _stated(seen, made.correction, told))

    def go_on(self, begun: Begun, control: TipControl, reached: Snapshot) -> Begun | Outcome:
        """The start of the next operation, after somebody has done one; or what failed on the way there."""
        key = (*stream_key(begun.trial, WRENCH), 1 + len(begun.reference))
        start = go_on(begun.plan, control.robot, begun.start, reached, begun.error, (self.robot.wrench, key))
        return start if isinstance(start, Outcome) else replace(begun, start=start)


def judged(scene: Scene, after: tuple[Snapshot | None, ...], final: Snapshot | None, reference: Array) -> Verdict:
    """The judge's verdict on the first operations alone.

    Args:
        after: After each of them.
        reference: (k, 4, 4), their true goals, world frame, [m].
    """
    return judge(scene.scenario.assembly.first(len(after)), Reached(after, final), reference, scene.criteria)


def _stated(seen: Observation, correction: Correction | None, told: str | None) -> Array:
    """What the corrector leaves of the noise, and what is said of the robot, but for its joints."""
    posterior = None if correction is None else correction.covariance
    covariance = seen.covariance if posterior is None else posterior
    sigmas = robot_sigmas(told or NO_ROBOT_ERROR)
    mm = math.hypot(sigmas.hand_eye[0], sigmas.tool_mm, sigmas.in_hand[0])
    deg = math.hypot(sigmas.hand_eye[1], sigmas.in_hand[1])
    return np.asarray(covariance + np.diag(np.repeat([1e-3 * mm, math.radians(deg)], 3) ** 2))
