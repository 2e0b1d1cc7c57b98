"""One trial as one row: demonstrated, observed, planned by a method, replayed, judged.

How the robot of a trial feels: what it believes of itself before it touches anything, and what its wrist is like.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Correction, Observation, Plan
from apo_bench.correction.calibration import UNSTATED, believe, slip_sigmas
from apo_bench.correction.correctors import CorrectorMisbehaved
from apo_bench.errors import require
from apo_bench.geometry import Array
from apo_bench.perception.observation.looking import Looks
from apo_bench.perception.observation.noise import Level, Noise, make_noise
from apo_bench.perception.observation.relations import make_relations, with_relations
from apo_bench.records import (
    RANGE,
    RECOGNISED,
    USUAL_WRENCH,
    Predicted,
    Row,
    TrialSettings,
    knows_relations,
    knows_truth,
    parsed,
    robot_sigmas,
    told_error,
)
from apo_bench.records.run.validation import unwritable
from apo_bench.scenario import scenario_names
from apo_bench.simulation.execution import ReplayCache
from apo_bench.simulation.execution.probing.feeling import ACTS, Feels
from apo_bench.simulation.hooks import Hooks
from apo_bench.simulation.scene import Scene
from apo_bench.trial.fingerprint import content_hash, spec_hash
from apo_bench.trial.outcome_columns import (
    confidence_columns,
    head,
    method_columns,
    misbehaved,
    replay_columns,
    result,
)
from apo_bench.trial.planning import apply_method, nominal_where_seen
from apo_bench.trial.promise import abstained, promised_success
from apo_bench.trial.recognised_contacts import count_contacts, with_recognised_contacts
from apo_bench.trial.stages import (
    RELATIONS,
    WRENCH,
    SimulatedDemonstration,
    demonstration_failure,
    demonstration_of,
    draw_robot_error,
    looks_at,
    observe_demonstration,
    predicted_outcome,
    range_sensor,
    replay_and_judge,
    scene_of,
    stream,
    stream_key,
    trial_outcome,
)


def feels_of(
    plan: Plan,
    scene: Scene,
    stated: str | None,
    seed: tuple[int, ...],
    wrench: str = USUAL_WRENCH,
    acts: tuple[str, ...] = ACTS,
) -> Feels:
    """A robot that is told how wrong it may be, and finds out how wrong it is.

    Args:
        stated: Standard deviations of its errors, as in a row; None: nobody says, and what is usual is assumed.
        seed: Of the noise of the sensor at its wrist.
        wrench: That sensor, as in a row.
        acts: What it does besides.

    Raises:
        InputError: An unknown kind of error, or a number that is not allowed.
    """
    sigmas = UNSTATED if stated is None else robot_sigmas(stated)
    belief = believe(sigmas, len(scene.arm.joints), plan.goals[:, :3, 3].mean(axis=0))
    return Feels(belief, slip_sigmas(sigmas), seed, wrench, acts)


MEASURED: Row = {"level": None, "level_deg": None, "careless": None, "noise": "measured"}
"""What a row says of a trial that was not drawn."""


@check_arguments
def run_trial(
    settings: TrialSettings,
    scene: Scene | None = None,
    *,
    simulated: SimulatedDemonstration | None = None,
    content: str | None = None,
    method: str | Callable[..., Any] | None = None,
    watch: Hooks | Callable[[Any], None] | None = None,
    cache: ReplayCache | None = None,
) -> Row:
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
    first = head(settings, scene.scenario, spec_hash(settings, content))
    first |= {"demonstration": simulated.demonstration.code}
    if simulated.demonstration.code != "ok":
        return first | result(demonstration_failure(simulated.demonstration), success=None)
    truth = simulated.layout.goals
    noise = noise_of(settings, scene, simulated)
    observation = observe_demonstration(simulated, noise, settings.seed, settings.salt)
    corrector_input = _corrector_input(settings, observation, truth)
    look = looks_at(simulated, noise, settings.seed, settings.looks, settings.salt, corrector_input.assembly)
    return first | _row(settings, scene, observation, corrector_input, truth, truth, method, watch, cache, look)


def trial_row(spec: TrialSettings, scene: Scene, simulated: SimulatedDemonstration, content: str, **more: Any) -> Row:
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


def noise_of(settings: TrialSettings, scene: Scene, simulated: SimulatedDemonstration) -> Noise:
    """The noise model of a trial, or the range finder that watched its demonstration."""
    if settings.eye == RANGE:
        return range_sensor(scene, simulated, settings.level_mm)
    return make_noise(settings.noise, Level(settings.level_mm, settings.level_deg))


def run_measured(
    settings: TrialSettings,
    scene: Scene,
    observation: Observation,
    text: str,
    *,
    watch: Any = None,
) -> Row:
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
    first = head(settings, scene.scenario, spec_hash(settings, content, text)) | MEASURED | {"demonstration": "ok"}
    reference = nominal_where_seen(scene.scenario.goals, observation)
    corrector_input = _corrector_input(settings, observation, None)
    return first | _row(settings, scene, observation, corrector_input, reference, None, None, watch, None, None)


def _row(
    settings: TrialSettings,
    scene: Scene,
    observation: Observation,
    corrector_input: Observation,
    reference: Array,
    truth: Array | None,
    method: Any,
    watch: Any,
    cache: ReplayCache | None,
    look: Looks | None,
) -> Row:
    """What the method made of the observation, and what came of its plan.

    Args:
        corrector_input: What a corrector gets in place of the observation.
        reference: (n, 4, 4) goals that are right for the judge.
        truth: (n, 4, 4) goals of the layout; None if they are not known.
    """
    planned = apply_method(method or parsed(settings.method).plan, corrector_input, truth, look, scene)
    if planned.plan is None:
        assert planned.failure is not None
        row = result(planned.failure, success=False)
    else:
        predicted, promised = _say_before(settings, scene, corrector_input, planned.plan, planned.correction)
        # What is carried out are goals; which contacts they make, the truth says.
        plan = replace(planned.plan, assembly=observation.assembly)
        row = _carry_out(settings, scene, promised, plan, reference, truth, watch, cache)
        row |= {"predicted": predicted, "promised": promised}
    row |= method_columns(planned) | confidence_columns(planned, observation, corrector_input, truth)
    if planned.correction is not None:
        row |= {"seen_again": look.seen_again if look else 0}
    if knows_relations(settings.method):
        row |= cast(Row, count_contacts(observation.assembly, corrector_input.assembly))
    return row


def _corrector_input(settings: TrialSettings, observation: Observation, truth: Array | None) -> Observation:
    """The observation as a corrector gets it: with the relations as given, as recognised, or wrong ones."""
    if not knows_relations(settings.method):
        return observation
    if settings.relations in RECOGNISED:
        return with_recognised_contacts(observation, settings.relations)
    if truth is None:
        return observation
    rng = stream(settings.seed, RELATIONS, settings.salt)
    return with_relations(observation, make_relations(settings.relations), truth, rng)


def _say_before(
    settings: TrialSettings, scene: Scene, given: Observation, plan: Plan, correction: Correction | None
) -> tuple[Predicted, float]:
    """What a plan says of itself before anything moves: what will fail, and how likely it succeeds.

    Args:
        given: What the planner was given; the plan has the same contacts.
    """
    _, searches, by_touch = parsed(settings.method)
    promised = promised_success(plan, given, correction, scene, settings.robot_error, searches, by_touch)
    return predicted_outcome(plan, scene, searches), promised


def _carry_out(
    settings: TrialSettings,
    scene: Scene,
    promised: float,
    plan: Plan,
    reference: Array,
    truth: Array | None,
    watch: Any,
    cache: ReplayCache | None,
) -> Row:
    """What came of a plan, if it promises enough.

    Args:
        plan: With the right contacts.
    """
    if promised < settings.abstain:
        return result(abstained(promised, settings.abstain), success=False)
    _, searches, by_touch = parsed(settings.method)
    error = draw_robot_error(settings.robot_error, scene, settings.seed, settings.salt)
    feels = _feels(settings, plan, scene) if by_touch else None
    attempt = replay_and_judge(
        plan, scene, reference, watch, settings.fidelity, cache, searches, error=error, feels=feels
    )
    end = result(trial_outcome(attempt), success=attempt.verdict.success)
    driven: Row = {"joint_control": scene.arm.control}
    return end | driven | replay_columns(attempt, plan, truth)


def _feels(settings: TrialSettings, plan: Plan, scene: Scene) -> Feels:
    """How the robot feels: it is told standard deviations, never what was drawn."""
    told = told_error(settings.stated_error, settings.robot_error)
    return feels_of(plan, scene, told, stream_key(settings.seed, WRENCH, settings.salt), settings.wrench)
