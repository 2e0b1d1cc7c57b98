"""Stages that all methods share: demonstrate, observe, replay, judge; every random number of a trial is drawn here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, final

import numpy as np

from apo_bench.assembly import Assembly, Demonstration, Layout, Observation, Outcome, Plan, ReplayResult
from apo_bench.geometry import Array, pose
from apo_bench.judging.verdict import Verdict, judge
from apo_bench.perception.observation.noise import Noise
from apo_bench.perception.observation.observe import observe
from apo_bench.perception.observation.reobservations import Reobservations
from apo_bench.planning.prediction.first_failure import ARM_CODES, predict_failure
from apo_bench.records import (
    DEPTH_CAMERA,
    NO_ROBOT_ERROR,
    SETTINGS,
    FailurePrediction,
    SecretSeed,
    TrialConfig,
    describe_outcome,
    parse_robot_error,
)
from apo_bench.scenario import Scenario, draw_layout, load_scenario
from apo_bench.simulation.arm_checks.plan_check import arm_moves
from apo_bench.simulation.execution import DEFAULT_EXECUTION, ExecutionConfig, ReplayCache, replay
from apo_bench.simulation.human.demonstration import demonstrate
from apo_bench.simulation.robot import RobotError, compute_sag_per_metre
from apo_bench.simulation.scene import Scene, build_scene

if TYPE_CHECKING:
    from apo_bench.perception.depth_camera.range_sensor import RangeSensor
    from apo_bench.simulation.sensor.watch import DemonstrationImages

LAYOUT, DEMONSTRATION, OBSERVATION, ARM, CONTACT_SOURCE, TV, REOBSERVE, HAND_EYE, JOINTS, TOOL, IN_HAND, WRENCH = range(
    12
)
SAG, BASE_TILT, FINGER, FT_DRIFT, IMAGES = range(12, 17)
"""Random streams of a trial, one per source of randomness; renumbering them changes all trials.

`ARM` is reserved. `WRENCH` is the noise of the force-torque sensor. `IMAGES` draws the cameras and the depth noise of
images. The others from `HAND_EYE` on are the errors of the robot.
"""
_DRIFT_NM = 0.05
"""Drift of the torque of a force-torque sensor for 1 N of its force, [Nm]."""


@final
@dataclass(frozen=True, eq=False)
class SimulatedDemonstration:
    """A demonstration and its true layout, shared by all methods and noise levels of a seed."""

    layout: Layout
    demonstration: Demonstration
    images: DemonstrationImages | None = None
    """Images of the depth camera; None if the pose source is a noise model."""


@final
@dataclass(frozen=True, eq=False)
class Attempt:
    """One replay and the verdict on it."""

    result: ReplayResult
    verdict: Verdict


def stream(seed: int, which: int, secret_seed: SecretSeed | None = None) -> np.random.Generator:
    """The random generator of one stage of one trial, keyed by seed, stage and secret seed only."""
    return np.random.default_rng(stream_key(seed, which, secret_seed))


def stream_key(seed: int, which: int, secret_seed: SecretSeed | None = None) -> tuple[int, ...]:
    """The seed of `numpy.random.default_rng` for a stage."""
    return (seed, which, *(secret_seed.words(seed, which) if secret_seed else ()))


def simulate_demonstration(
    scene: Scene,
    human_error_scale: float,
    seed: int,
    pose_source: str = TrialConfig.pose_source,
    secret_seed: SecretSeed | None = None,
) -> SimulatedDemonstration:
    """Draw the layout of a trial and simulate the demonstration on it; `depth-camera` as pose source records images."""
    layout = draw_layout(scene.scenario, stream(seed, LAYOUT, secret_seed), scene.clearance_mm)
    rng = stream(seed, DEMONSTRATION, secret_seed)
    if pose_source != DEPTH_CAMERA:
        return SimulatedDemonstration(layout, demonstrate(scene, layout, human_error_scale, rng))
    from apo_bench.perception.depth_camera.surface import load_small_gicp
    from apo_bench.simulation.sensor.watch import DemonstrationCamera

    load_small_gicp()
    watcher = DemonstrationCamera(scene.shown, stream(seed, TV, secret_seed))
    return SimulatedDemonstration(
        layout, demonstrate(scene, layout, human_error_scale, rng, watcher), watcher.watched()
    )


def demonstration_of(settings: TrialConfig, scene: Scene) -> SimulatedDemonstration:
    """Simulate the demonstration of a trial.

    Args:
        scene: As compiled for these settings.
    """
    return simulate_demonstration(
        scene, settings.human_error_scale, settings.seed, settings.pose_source, settings.secret_seed
    )


def watch_again(
    scene: Scene,
    simulated: SimulatedDemonstration,
    human_error_scale: float,
    seed: int,
    secret_seed: SecretSeed | None,
    watch: Any,
) -> None:
    """Simulate the same demonstration once more, with a callback `watch` that records it."""
    demonstrate(scene, simulated.layout, human_error_scale, stream(seed, DEMONSTRATION, secret_seed), watch)


def range_sensor(scene: Scene, simulated: SimulatedDemonstration, noise_mm: float) -> RangeSensor:
    """The depth camera that recorded a demonstration, as a noise model.

    Args:
        noise_mm: Noise of a ray, 1 sigma.
    """
    from apo_bench.perception.depth_camera.range_sensor import RangeSensor
    from apo_bench.simulation.sensor.rays import ModelRays

    assert simulated.images is not None, "simulate the demonstration with pose_source='depth-camera'"
    clearance_m = 1e-3 * scene.clearance_mm
    return RangeSensor(simulated.images.images, 1e-3 * noise_mm, plan_rotations(scene), clearance_m, ModelRays)


def plan_rotations(scene: Scene) -> Array:
    """The planned rotation of each target pose, (n, 3, 3), world: the nominal one at the mean yaw of the site."""
    yaw = float(np.degrees(np.mean(scene.scenario.site.yaw_rad)))
    return np.asarray(pose.at((0.0, 0.0, 0.0), (0.0, 0.0, yaw))[:3, :3] @ scene.scenario.nominal_poses[:, :3, :3])


def observe_demonstration(
    simulated: SimulatedDemonstration, noise: Noise, seed: int, secret_seed: SecretSeed | None = None
) -> Observation:
    """Observe the demonstration of a trial with a noise model."""
    return observe(simulated.demonstration, noise, stream(seed, OBSERVATION, secret_seed))


def reobservations_of(
    simulated: SimulatedDemonstration,
    noise: Noise,
    seed: int,
    allowed: int,
    secret_seed: SecretSeed | None = None,
    assembly: Assembly | None = None,
) -> Reobservations:
    """Further observations of a demonstration that was observed once.

    Args:
        allowed: Their largest number.
        assembly: As in `Reobservations`.
    """
    first = stream(seed, OBSERVATION, secret_seed)
    return Reobservations(
        simulated.demonstration, noise, stream(seed, REOBSERVE, secret_seed), allowed, assembly, first
    )


def demonstration_failure(demonstration: Demonstration) -> Outcome:
    """The ending of a trial whose demonstration failed, so that it is not replayed."""
    why = f": {demonstration.why}" if demonstration.why else ""
    return Outcome("demonstrate", demonstration.code, None, describe_outcome(demonstration.code) + why)


def observation_failure(observation: Observation) -> Outcome | None:
    """The ending of a trial in which an operation was not observed, so there are no poses to plan with; else None."""
    if observation.observed.all():
        return None
    k = int(np.argmin(observation.observed))  # the first operation that was not observed
    return Outcome("observe", "not_seen", k, describe_outcome("not_seen", operation=k))


def predicted_outcome(plan: Plan, scene: Scene, spiral: bool = False) -> FailurePrediction:
    """The failure prediction of a plan with the arm of the scene, as in a record: operations from 1, mm.

    Args:
        plan: With the contacts that the planner was given; the true ones are not known here.
        spiral: The robot searches for holes in a spiral.
    """
    arm = arm_moves(plan, scene, spiral)
    prediction = predict_failure(plan, scene.clearance_mm, scene.scenario.thresholds, scene.scenario.attach, arm)
    operation = None if prediction.operation is None else prediction.operation + 1
    predicted: FailurePrediction = {
        "fails": prediction.fails,
        "operation": operation,
        "code": prediction.code,
        "size_mm": prediction.size_mm,
    }
    return predicted if prediction.code not in ARM_CODES else {**predicted, "sentence": prediction.sentence}


def draw_robot_error(name: str, scene: Scene, seed: int, secret_seed: SecretSeed | None = None) -> RobotError | None:
    """Draw the robot errors of a trial, in proportion to their standard deviations; None for a robot without errors.

    Args:
        name: As in a record.
    """
    if name == NO_ROBOT_ERROR:
        return None
    return robot_error_of(name, scene, lambda which, shape: stream(seed, which, secret_seed).standard_normal(shape))


def robot_error_of(name: str, scene: Scene, drawn: Callable[[int, tuple[int, ...]], Array]) -> RobotError:
    """Scale standard normal numbers to robot errors.

    The hand-eye error rotates about the mean of the nominal target poses, the tilt about the foot of the robot. A part
    slips along the pads (second and third axis of the tip) and rotates about their normal (first axis). An arm never
    sags upwards.

    Args:
        name: Standard deviations, as in a record.
        drawn: (stream, shape) -> standard normal numbers; streams from `HAND_EYE` on, except `WRENCH`.
    """
    sigmas = parse_robot_error(name)
    shift, turn = drawn(HAND_EYE, (2, 3))
    hand_eye = pose.at(1e-3 * sigmas.hand_eye[0] * shift, sigmas.hand_eye[1] * turn)
    middle = np.eye(4)
    middle[:3, 3] = scene.scenario.nominal_poses[:, :3, 3].mean(axis=0)
    # turned about the middle of the goals: E becomes T_m E T_m^-1
    if sigmas.hand_eye != (0.0, 0.0):
        hand_eye = middle @ hand_eye @ pose.inverse(middle)
    if sigmas.base_tilt_deg:
        foot = pose.at(scene.arm.base)
        tilt = pose.at((0.0, 0.0, 0.0), (*(sigmas.base_tilt_deg * drawn(BASE_TILT, (2,))), 0.0))
        hand_eye = hand_eye @ foot @ tilt @ pose.inverse(foot)
    joints = np.radians(sigmas.joints_deg) * drawn(JOINTS, (len(scene.arm.joints),))
    tool = pose.at(1e-3 * sigmas.tool_mm * drawn(TOOL, (3,)), (0.0, 0.0, 0.0))
    m = 1e-3 * sigmas.in_hand[0]
    deg = sigmas.in_hand[1]
    slips = drawn(IN_HAND, (len(scene.scenario.assembly), 3))
    in_hand = np.array([pose.at((0.0, m * y, m * z), (deg * turn, 0.0, 0.0)) for y, z, turn in slips])
    error = RobotError(hand_eye, joints, tool, in_hand)
    if sigmas.sag_mm:
        size = 1e-3 * sigmas.sag_mm * abs(drawn(SAG, (1,)))
        error = replace(error, sag=size * compute_sag_per_metre(scene))
    if sigmas.finger_mm:
        error = replace(error, finger=1e-3 * sigmas.finger_mm * float(drawn(FINGER, (1,))[0]))
    if sigmas.ft_drift_n:
        size = sigmas.ft_drift_n / 60.0 * np.repeat([1.0, _DRIFT_NM], 3)
        error = replace(error, ft_drift=size * drawn(FT_DRIFT, (6,)))
    return error


def replay_and_judge(
    plan: Plan,
    scene: Scene,
    reference: Array,
    watch: Any = None,
    config: ExecutionConfig = DEFAULT_EXECUTION,
    cache: ReplayCache | None = None,
) -> Attempt:
    """Replay a plan and judge the result.

    Args:
        reference: (n, 4, 4) right target poses, world frame, [m]; the judge takes from them how faces should overlap,
            how far apart they may be, and which of the symmetries of a part is meant.
        watch: Called with the `MjData` about every 20 ms of simulated time; or several `Hooks`.
        config: How the robot executes the plan.
        cache: As in `replay`.
    """
    result = replay(plan, scene, watch, config, cache=cache)
    return Attempt(result, judge(scene.scenario.assembly, result.reached, reference, scene.criteria))


def trial_outcome(attempt: Attempt) -> Outcome:
    """The outcome of a trial: success by the judge; otherwise the failure that the robot reported, else the judge's."""
    if attempt.verdict.success:
        return Outcome("done", "ok", None, describe_outcome("ok"))
    if attempt.result.outcome.failed:
        return attempt.result.outcome
    conditions = attempt.verdict.rests_on
    why = f": {conditions.why}" if conditions.why else ""
    return Outcome("judge", conditions.code, None, describe_outcome(conditions.code) + why)


_SHAPING = tuple(name for name, info in SETTINGS.items() if info.scene)
"""Settings that change the compiled scene."""


def scene_of(settings: TrialConfig, scenario: Scenario | None = None) -> Scene:
    """Compile the scene of a trial.

    Args:
        scenario: The scenario of the settings, if already loaded.

    Raises:
        InputError: There is no such scenario or arm, or a part cannot have the clearance.
    """
    loaded = load_scenario(settings.scenario) if scenario is None else scenario
    return build_scene(loaded, **{name: getattr(settings, name) for name in _SHAPING})


def scene_key(settings: TrialConfig) -> tuple[Any, ...]:
    """A key that is equal for settings with the same scene."""
    return (settings.scenario, *(getattr(settings, name) for name in _SHAPING))
