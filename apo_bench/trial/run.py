"""Run one trial: demonstrate, observe, choose contacts, correct, fit, predict, execute, judge, record.

All random numbers come from the streams of `stages`: layout, human, observation, contacts, robot and sensor use one
each. A stage that fails ends the trial with its failure code (all are in `records.outcomes`). Units here are m and rad;
`outcome_columns` converts them to the mm and degrees of a record.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast, final

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Observation, Plan
from apo_bench.correction.calibration import UNKNOWN, compute_slip_sigmas, make_prior_estimate
from apo_bench.correction.correctors import CorrectorMisbehaved
from apo_bench.errors import require
from apo_bench.geometry import Array
from apo_bench.names import function_name
from apo_bench.perception.observation.models import PoseResults, TrialKey
from apo_bench.perception.observation.noise import Noise, NoiseLevel, make_noise
from apo_bench.perception.observation.reobservations import Reobservations
from apo_bench.perception.observation.wrong_contacts import make_contacts, replace_contacts
from apo_bench.records import (
    DEPTH_CAMERA,
    DETECTED,
    USUAL_FT_SENSOR,
    Method,
    TrialConfig,
    TrialRecord,
    knows_truth,
    parse_assumed_error,
    parse_method,
    parse_robot_error,
    uses_contacts,
)
from apo_bench.records.run.validation import describe_unwritable
from apo_bench.scenario import Scenario, list_scenario_names
from apo_bench.simulation.execution import ExecutionConfig, ReplayCache
from apo_bench.simulation.execution.probing.config import ProbingConfig
from apo_bench.simulation.hooks import Hooks
from apo_bench.simulation.scene import Scene
from apo_bench.trial.detected_contacts import count_contacts, use_detected_contacts
from apo_bench.trial.fingerprint import compute_config_hash, compute_content_hash
from apo_bench.trial.keywords import configure_trial
from apo_bench.trial.nominal_poses import move_nominal_poses
from apo_bench.trial.outcome_columns import fill_confidence_columns, fill_method_columns, fill_replay_columns
from apo_bench.trial.planning import apply_method
from apo_bench.trial.predicted_success import abstain, predict_success
from apo_bench.trial.record_start_and_end import end_record, record_corrector_failure, start_record
from apo_bench.trial.trial_stages import (
    CONTACT_SOURCE,
    WRENCH,
    SimulatedDemonstration,
    demonstration_failure,
    demonstration_of,
    draw_robot_error,
    observe_demonstration,
    plan_rotations,
    predicted_outcome,
    range_sensor,
    reobservations_of,
    replay_and_judge,
    scene_of,
    stream,
    stream_key,
    trial_outcome,
)

Callbacks = Hooks | Callable[[Any], None]
"""Called with the `MjData` of a replay about every 20 ms of simulated time; or several hooks."""
MEASURED: TrialRecord = {"noise_mm": None, "noise_deg": None, "human_error_scale": None, "noise": "measured"}
"""Columns of a trial whose observation comes from a file."""


@final
@dataclass(frozen=True, eq=False)
class RunContext:
    """The arguments that all steps of one trial share."""

    scene: Scene
    config: TrialConfig
    method: Method
    """The parsed method; its `corrector` is a name or a callable."""
    callbacks: Callbacks | None = None
    cache: ReplayCache | None = None
    """States that replays of one scene and seed share; it changes only the computing time."""


@check_arguments
def run_trial(
    config: TrialConfig | Scenario | str | Path,
    scene: Scene | None = None,
    *,
    method: str | Callable[..., Any] | None = None,
    noise: str | Callable[..., Any] | None = None,
    simulated: SimulatedDemonstration | None = None,
    content: str | None = None,
    watch: Callbacks | None = None,
    cache: ReplayCache | None = None,
    **settings: Any,
) -> TrialRecord:
    """Run one trial from the demonstration to the verdict.

    Args:
        config: A configuration, or a scenario (name, path or object) whose settings are the keywords.
        scene: The scene of scenario, clearance, grasp, arm and time step of the configuration. Default: compiled here.
        method: A method by name, or a corrector: a callable `Observation -> Correction`, or `Observation -> (n, 4, 4)`
            poses in the world frame, [m]. Default: that of the configuration.
        noise: A noise model by name or file, or the object itself as in `observe`. Default: that of the configuration.
        simulated: The demonstration of this seed and human error scale. Default: simulated here.
        content: From `compute_content_hash`. Default: computed here.
        watch: Called with the `mujoco.MjData` about every 20 ms of simulated time, such as a `Film`.
        cache: States that replays of the scene share; it changes only the computing time.
        settings: Settings of `TrialConfig` and `noise_level`, with a scenario.

    Returns:
        The record of the trial, a dict whose keys are columns.

    Raises:
        InputError: An unknown setting, a value that is not allowed, or a function that returns what it must not.
    """
    source: str | Scenario
    if isinstance(config, TrialConfig):
        require(not settings, f"{', '.join(settings)} was given together with a TrialConfig; put it into that.")
        source = config.scenario
    else:
        source = config if isinstance(config, Scenario) else str(config)
        config, loaded = configure_trial(config, **settings)
        scene = scene or scene_of(config, loaded)
    if method is not None:
        config = replace(config, method=method if isinstance(method, str) else function_name(method))
    if noise is not None:
        config = replace(config, noise=noise if isinstance(noise, str) else function_name(noise))
    scene = scene or scene_of(config)
    require(
        config.scenario == scene.scenario.name or config.scenario not in list_scenario_names(),
        f"the settings name the scenario '{config.scenario}', the scene is of '{scene.scenario.name}'; build the "
        "scene of the same scenario, or leave it out.",
    )
    simulated = simulated or demonstration_of(config, scene)
    content = content or compute_content_hash(scene.scenario, source, scene.arm.files)
    record = start_record(config, scene.scenario, compute_config_hash(config, content))
    record |= {"demonstration": simulated.demonstration.code}
    if simulated.demonstration.code != "ok":
        return record | end_record(demonstration_failure(simulated.demonstration), success=None)
    truth = simulated.layout.poses
    model = noise_of(config, scene, simulated, noise)
    observation = observe_demonstration(simulated, model, config.seed, config.secret_seed)
    given = _choose_contacts(config, observation, truth)
    reobserve = reobservations_of(
        simulated, model, config.seed, config.max_reobservations, config.secret_seed, given.assembly
    )
    parsed = parse_method(config.method)
    parsed = parsed._replace(corrector=method) if callable(method) else parsed
    context = RunContext(scene, config, parsed, watch, cache)
    return record | _plan_and_replay(context, observation, given, truth, reobserve)


def run_measured(
    settings: TrialConfig, scene: Scene, observation: Observation, text: str, *, watch: Any = None
) -> TrialRecord:
    """Replay an observation from a file, whose truth is not known.

    The judge compares overlaps with those of the scenario's nominal poses, moved to where the first part was observed.
    Noise level, human error scale and pose errors of the record are null, its noise is `measured`.

    Args:
        text: The content of the file, for the hash.

    Raises:
        InputError: The method is `oracle`, which needs the truth.
    """
    require(
        not knows_truth(settings.method),
        f"the method '{settings.method}' was given for a measured observation, whose truth is not known; use "
        "uncorrected or paper.",
    )
    content = compute_content_hash(scene.scenario, settings.scenario, scene.arm.files)
    record = start_record(settings, scene.scenario, compute_config_hash(settings, content, text))
    record |= MEASURED | {"demonstration": "ok"}
    context = RunContext(scene, settings, parse_method(settings.method), watch)
    return record | _plan_and_replay(context, observation, _choose_contacts(settings, observation, None), None, None)


def _plan_and_replay(
    context: RunContext,
    observation: Observation,
    given: Observation,
    truth: Array | None,
    reobserve: Reobservations | None,
) -> TrialRecord:
    """Run the trial after its observation: correct, fit, predict, execute and judge.

    Args:
        observation: With the true contacts.
        given: The same with the contacts that the corrector gets.
        truth: (n, 4, 4) poses of the layout, world frame, [m]; None if they are not known.
        reobserve: Lets the corrector observe again; None for an observation from a file.

    Returns:
        The columns of method, prediction and outcome.
    """
    config = context.config
    corrector, spiral, probe = context.method
    planned = apply_method(corrector, given, truth, reobserve, context.scene)
    if planned.plan is None:
        assert planned.failure is not None
        record = end_record(planned.failure, success=False)
    else:
        predicted_success = predict_success(
            planned.plan,
            given,
            planned.correction,
            context.scene,
            robot_error=config.robot_error,
            spiral=spiral,
            probing=probe,
            contact_source=config.contact_source,
        )
        prediction = predicted_outcome(planned.plan, context.scene, spiral)
        if predicted_success < config.min_predicted_success:
            record = end_record(abstain(predicted_success, config.min_predicted_success), success=False)
        else:
            plan = planned.plan
            if plan.assembly is not observation.assembly:
                # The robot executes poses only, so replay and judge use the true contacts, not those of the planner.
                plan = replace(plan, assembly=observation.assembly)
            record = _replay(context, plan, observation, truth)
        record |= {"failure_prediction": prediction, "predicted_success": predicted_success}
    record |= fill_method_columns(planned) | fill_confidence_columns(planned, observation, given, truth)
    if planned.correction is not None:
        record |= {"reobservations": reobserve.reobservations if reobserve else 0}
    if uses_contacts(config.method):
        record |= cast(TrialRecord, count_contacts(observation.assembly, given.assembly))
    return record


def _replay(context: RunContext, plan: Plan, observation: Observation, truth: Array | None) -> TrialRecord:
    """Execute and judge a plan; if the truth is None, the judge compares with the nominal poses."""
    config = context.config
    scene = context.scene
    reference = move_nominal_poses(scene.scenario.nominal_poses, observation) if truth is None else truth
    _, spiral, probe = context.method
    error = draw_robot_error(config.robot_error, scene, config.seed, config.secret_seed)
    probing = None
    # The robot knows assumed standard deviations of its errors, never the drawn errors.
    if probe:
        assumed = parse_assumed_error(config.assumed_robot_error, config.robot_error)
        key = stream_key(config.seed, WRENCH, config.secret_seed)
        probing = probing_config(plan, scene, assumed, key, config.ft_sensor)
    execution = ExecutionConfig(config.fidelity, spiral, robot_error=error, probing=probing)
    attempt = replay_and_judge(plan, scene, reference, context.callbacks, execution, context.cache)
    end = end_record(trial_outcome(attempt), success=attempt.verdict.success)
    return end | {"joint_control": scene.arm.control} | fill_replay_columns(attempt, plan, truth)


def _choose_contacts(config: TrialConfig, observation: Observation, truth: Array | None) -> Observation:
    """The observation as the corrector gets it, with given, detected or wrong contacts by `contact_source`.

    Without a truth (an observation from a file) no wrong contacts are drawn.
    """
    if not uses_contacts(config.method):
        return observation
    if config.contact_source in DETECTED:
        return use_detected_contacts(observation, config.contact_source)
    if truth is None:
        return observation
    rng = stream(config.seed, CONTACT_SOURCE, config.secret_seed)
    return replace_contacts(observation, make_contacts(config.contact_source), truth, rng)


def noise_of(settings: TrialConfig, scene: Scene, simulated: SimulatedDemonstration, noise: Any = None) -> Noise:
    """The noise model of a trial, the depth camera that recorded its demonstration, or poses from images of the trial.

    Args:
        noise: The model in place of its name in the settings.
    """
    if settings.pose_source == DEPTH_CAMERA:
        return range_sensor(scene, simulated, settings.noise_mm)
    model = make_noise(noise or settings.noise, NoiseLevel(settings.noise_mm, settings.noise_deg))
    if not isinstance(model, PoseResults):
        return model
    shown = model.description.human_error_scale
    require(
        settings.human_error_scale == shown or knows_truth(settings.method),
        f"the human error scale {settings.human_error_scale:g} was given, and the images in '{model.folder}' show "
        f"demonstrations with {shown:g}; give that one.",
    )
    secret_seed = None if settings.secret_seed is None else settings.secret_seed.hash
    key = TrialKey(settings.scenario, settings.seed, settings.clearance_mm, secret_seed)
    return model.of_trial(key, plan_rotations(scene))


def probing_config(
    plan: Plan,
    scene: Scene,
    assumed: str | None,
    seed: tuple[int, ...],
    ft_sensor: str = USUAL_FT_SENSOR,
) -> ProbingConfig:
    """The configuration of a robot that probes: assumed standard deviations of its errors, never the errors themselves.

    Args:
        assumed: Standard deviations, as in a record; None: default ones for an unknown robot.
        seed: Seed of the noise of the force-torque sensor.
        ft_sensor: As in a record.

    Raises:
        InputError: An unknown kind of error, or a number that is not allowed.
    """
    sigmas = UNKNOWN if assumed is None else parse_robot_error(assumed)
    middle = plan.target_poses[:, :3, 3].mean(axis=0)
    estimate = make_prior_estimate(sigmas, len(scene.arm.joints), middle, np.array(scene.arm.base), sigmas.sag_mm > 0.0)
    return ProbingConfig(estimate, compute_slip_sigmas(sigmas), seed, ft_sensor, 0.5e-3 * sigmas.finger_mm)


def record_trial(
    config: TrialConfig, scene: Scene, simulated: SimulatedDemonstration, content: str, **more: Any
) -> TrialRecord:
    """The record of a trial, also if its corrector misbehaves or returns values that no record can hold.

    Args:
        more: Further arguments of `run_trial`.

    Raises:
        InputError: A setting is not allowed.
    """
    try:
        record = run_trial(config, scene, simulated=simulated, content=content, **more)
        # A colon marks a plugin, whose results are checked.
        wrong = describe_unwritable(record) if ":" in config.method else ""
        if not wrong:
            return record
        why = f"the corrector '{config.method}' returned what no record can hold ({wrong})"
    except CorrectorMisbehaved as error:
        why = str(error)
    return record_corrector_failure(config, content, simulated.demonstration.code, why)
