"""One trial as one row: demonstrated, observed, planned by a method, replayed, judged.

How the robot of a trial feels: what it believes of itself before it touches anything, and what its wrist is like.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Correction, Observation, Plan
from apo_bench.correction.calibration import UNKNOWN, prior_estimate, slip_sigmas
from apo_bench.correction.correctors import CorrectorMisbehaved
from apo_bench.errors import require
from apo_bench.geometry import Array
from apo_bench.perception.observation.noise import Noise, NoiseLevel, make_noise
from apo_bench.perception.observation.reobservations import Reobservations
from apo_bench.perception.observation.wrong_contacts import make_contacts, with_contacts
from apo_bench.records import (
    DEPTH_CAMERA,
    DETECTED,
    USUAL_FT_SENSOR,
    Predicted,
    TrialConfig,
    TrialRecord,
    assumed_error,
    knows_truth,
    parse_method,
    robot_sigmas,
    uses_contacts,
)
from apo_bench.records.run.validation import unwritable
from apo_bench.scenario import scenario_names
from apo_bench.simulation.execution import ExecutionConfig, ReplayCache
from apo_bench.simulation.execution.probing.config import PROBING_ACTIONS, ProbingConfig
from apo_bench.simulation.hooks import Hooks
from apo_bench.simulation.scene import Scene
from apo_bench.trial.detected_contacts import count_contacts, with_recognised_contacts
from apo_bench.trial.fingerprint import config_hash, content_hash
from apo_bench.trial.outcome_columns import (
    confidence_columns,
    head,
    method_columns,
    misbehaved,
    replay_columns,
    result,
)
from apo_bench.trial.planning import apply_method, nominal_where_seen
from apo_bench.trial.predicted_success import abstained, predict_success
from apo_bench.trial.stages import (
    CONTACT_SOURCE,
    WRENCH,
    SimulatedDemonstration,
    demonstration_failure,
    demonstration_of,
    draw_robot_error,
    observe_demonstration,
    predicted_outcome,
    range_sensor,
    reobservations_of,
    replay_and_judge,
    scene_of,
    stream,
    stream_key,
    trial_outcome,
)


def probing_config(
    plan: Plan,
    scene: Scene,
    stated: str | None,
    seed: tuple[int, ...],
    ft_sensor: str = USUAL_FT_SENSOR,
    actions: tuple[str, ...] = PROBING_ACTIONS,
) -> ProbingConfig:
    """A robot that is told how wrong it may be, and finds out how wrong it is.

    Args:
        stated: Standard deviations of its errors, as in a row; None: nobody says, and what is usual is assumed.
        seed: Of the noise of the sensor at its wrist.
        ft_sensor: That sensor, as in a record.
        actions: Of `PROBING_ACTIONS`.

    Raises:
        InputError: An unknown kind of error, or a number that is not allowed.
    """
    sigmas = UNKNOWN if stated is None else robot_sigmas(stated)
    estimate = prior_estimate(sigmas, len(scene.arm.joints), plan.target_poses[:, :3, 3].mean(axis=0))
    return ProbingConfig(estimate, slip_sigmas(sigmas), seed, ft_sensor, actions)


MEASURED: TrialRecord = {"noise_mm": None, "noise_deg": None, "human_error_scale": None, "noise": "measured"}
"""What a row says of a trial that was not drawn."""


@check_arguments
def run_trial(
    settings: TrialConfig,
    scene: Scene | None = None,
    *,
    simulated: SimulatedDemonstration | None = None,
    content: str | None = None,
    method: str | Callable[..., Any] | None = None,
    watch: Hooks | Callable[[Any], None] | None = None,
    cache: ReplayCache | None = None,
) -> TrialRecord:
    """Run one trial.

    Args:
        scene: Compiled for the scenario, clearance, grasp, arm and time step of `settings`; compiled here if it is
            not at hand.
        simulated: The demonstration of this seed and carelessness, if it is at hand.
        content: From `content_hash`, if it is at hand.
        method: A corrector itself, in place of the one that `settings` name.
        watch: Called with the `MjData` of the replay about every 20 ms of simulated time; or several `Hooks`.
        cache: What replays of this scene and seed have in common; changes nothing but the time it takes.

    Raises:
        InputError: The noise model, the relations or the corrector are unknown or returned what they must not.
    """
    scene = scene or scene_of(settings)
    require(
        settings.scenario == scene.scenario.name or settings.scenario not in scenario_names(),
        f"the settings name the scenario '{settings.scenario}', the scene is of '{scene.scenario.name}'; build the "
        "scene of the same scenario, or leave it out.",
    )
    simulated = simulated or demonstration_of(settings, scene)
    content = content or content_hash(scene.scenario, settings.scenario, scene.arm.files)
    first = head(settings, scene.scenario, config_hash(settings, content))
    first |= {"demonstration": simulated.demonstration.code}
    if simulated.demonstration.code != "ok":
        return first | result(demonstration_failure(simulated.demonstration), success=None)
    truth = simulated.layout.poses
    noise = noise_of(settings, scene, simulated)
    observation = observe_demonstration(simulated, noise, settings.seed, settings.secret_seed)
    corrector_input = _corrector_input(settings, observation, truth)
    look = reobservations_of(
        simulated, noise, settings.seed, settings.max_reobservations, settings.secret_seed, corrector_input.assembly
    )
    return first | _row(settings, scene, observation, corrector_input, truth, truth, method, watch, cache, look)


def trial_row(
    spec: TrialConfig, scene: Scene, simulated: SimulatedDemonstration, content: str, **more: Any
) -> TrialRecord:
    """The row of a trial, also of one whose corrector misbehaved.

    What code of somebody's own returned may be what no row can hold; that is its failure too.

    Args:
        more: Further arguments of `run_trial`.

    Raises:
        InputError: The request cannot be honoured.
    """
    try:
        row = run_trial(spec, scene, simulated=simulated, content=content, **more)
        wrong = unwritable(row) if ":" in spec.method else ""
        if not wrong:
            return row
        why = f"the corrector '{spec.method}' returned what no row can hold ({wrong})"
    except CorrectorMisbehaved as error:
        why = str(error)
    return misbehaved(spec, content, simulated.demonstration.code, why)


def noise_of(settings: TrialConfig, scene: Scene, simulated: SimulatedDemonstration) -> Noise:
    """The noise model of a trial, or the range finder that watched its demonstration."""
    if settings.pose_source == DEPTH_CAMERA:
        return range_sensor(scene, simulated, settings.noise_mm)
    return make_noise(settings.noise, NoiseLevel(settings.noise_mm, settings.noise_deg))


def run_measured(
    settings: TrialConfig,
    scene: Scene,
    observation: Observation,
    text: str,
    *,
    watch: Any = None,
) -> TrialRecord:
    """Replay an observation that came from a file: its truth is not known.

    The judge compares overlaps with those of the scenario's nominal goals, put where the first part was seen; level,
    carelessness and pose errors of the row are null, its noise is `measured`.

    Args:
        text: The content of the file, for the hash.

    Raises:
        InputError: The method is `oracle`, which would need the truth.
    """
    require(
        not knows_truth(settings.method),
        f"the method '{settings.method}' was given for a measured observation, whose truth is not known; use none "
        "or paper.",
    )
    content = content_hash(scene.scenario, settings.scenario, scene.arm.files)
    first = head(settings, scene.scenario, config_hash(settings, content, text)) | MEASURED | {"demonstration": "ok"}
    reference = nominal_where_seen(scene.scenario.goals, observation)
    corrector_input = _corrector_input(settings, observation, None)
    return first | _row(settings, scene, observation, corrector_input, reference, None, None, watch, None, None)


def _row(
    settings: TrialConfig,
    scene: Scene,
    observation: Observation,
    corrector_input: Observation,
    reference: Array,
    truth: Array | None,
    method: Any,
    watch: Any,
    cache: ReplayCache | None,
    look: Reobservations | None,
) -> TrialRecord:
    """What the method made of the observation, and what came of its plan.

    Args:
        corrector_input: What a corrector gets in place of the observation.
        reference: (n, 4, 4) goals that are right for the judge.
        truth: (n, 4, 4) goals of the layout; None if they are not known.
    """
    planned = apply_method(method or parse_method(settings.method).corrector, corrector_input, truth, look, scene)
    if planned.plan is None:
        assert planned.failure is not None
        row = result(planned.failure, success=False)
    else:
        predicted, predicted_success = _say_before(settings, scene, corrector_input, planned.plan, planned.correction)
        # What is carried out are goals; which contacts they make, the truth says.
        plan = replace(planned.plan, assembly=observation.assembly)
        row = _carry_out(settings, scene, predicted_success, plan, reference, truth, watch, cache)
        row |= {"failure_prediction": predicted, "predicted_success": predicted_success}
    row |= method_columns(planned) | confidence_columns(planned, observation, corrector_input, truth)
    if planned.correction is not None:
        row |= {"reobservations": look.reobservations if look else 0}
    if uses_contacts(settings.method):
        row |= cast(TrialRecord, count_contacts(observation.assembly, corrector_input.assembly))
    return row


def _corrector_input(settings: TrialConfig, observation: Observation, truth: Array | None) -> Observation:
    """The observation as a corrector gets it: with the relations as given, as recognised, or wrong ones."""
    if not uses_contacts(settings.method):
        return observation
    if settings.contact_source in DETECTED:
        return with_recognised_contacts(observation, settings.contact_source)
    if truth is None:
        return observation
    rng = stream(settings.seed, CONTACT_SOURCE, settings.secret_seed)
    return with_contacts(observation, make_contacts(settings.contact_source), truth, rng)


def _say_before(
    settings: TrialConfig, scene: Scene, given: Observation, plan: Plan, correction: Correction | None
) -> tuple[Predicted, float]:
    """What a plan says of itself before anything moves: what will fail, and how likely it succeeds.

    Args:
        given: What the planner was given; the plan has the same contacts.
    """
    _, spiral, probe = parse_method(settings.method)
    predicted_success = predict_success(plan, given, correction, scene, settings.robot_error, spiral, probe)
    return predicted_outcome(plan, scene, spiral), predicted_success


def _carry_out(
    settings: TrialConfig,
    scene: Scene,
    predicted_success: float,
    plan: Plan,
    reference: Array,
    truth: Array | None,
    watch: Any,
    cache: ReplayCache | None,
) -> TrialRecord:
    """What came of a plan, if it promises enough.

    Args:
        plan: With the right contacts.
    """
    if predicted_success < settings.min_predicted_success:
        return result(abstained(predicted_success, settings.min_predicted_success), success=False)
    _, spiral, probe = parse_method(settings.method)
    error = draw_robot_error(settings.robot_error, scene, settings.seed, settings.secret_seed)
    probing = _probing(settings, plan, scene) if probe else None
    config = ExecutionConfig(settings.fidelity, spiral, robot_error=error, probing=probing)
    attempt = replay_and_judge(plan, scene, reference, watch, config, cache)
    end = result(trial_outcome(attempt), success=attempt.verdict.success)
    driven: TrialRecord = {"joint_control": scene.arm.control}
    return end | driven | replay_columns(attempt, plan, truth)


def _probing(settings: TrialConfig, plan: Plan, scene: Scene) -> ProbingConfig:
    """How the robot feels: it is told standard deviations, never what was drawn."""
    told = assumed_error(settings.assumed_robot_error, settings.robot_error)
    return probing_config(
        plan, scene, told, stream_key(settings.seed, WRENCH, settings.secret_seed), settings.ft_sensor
    )
