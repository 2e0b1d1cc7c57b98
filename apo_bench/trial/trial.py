"""One trial as one row: demonstrated, observed, planned by a method, replayed, judged."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, cast

import numpy as np

from apo_bench.assembly.goals import Observation, Plan
from apo_bench.assembly.reached import InHand, Snapshot
from apo_bench.errors import InputError
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.observation.looking import Looks
from apo_bench.observation.noise import Level, Noise, make_noise
from apo_bench.observation.relations import make_relations, with_relations
from apo_bench.records.method import knows_relations, knows_truth, parsed
from apo_bench.records.relations import RECOGNISED
from apo_bench.records.row import MovedInHand, Row, finite
from apo_bench.records.settings import RANGE, TrialSettings
from apo_bench.simulation.execution.replay_cache import ReplayCache
from apo_bench.simulation.scene.scene import Scene
from apo_bench.trial.confidence import confidence
from apo_bench.trial.fingerprint import content_hash, spec_hash
from apo_bench.trial.planning import MethodResult, apply_method
from apo_bench.trial.pose_error import pose_errors
from apo_bench.trial.recognised_contacts import count_contacts, with_recognised_contacts
from apo_bench.trial.row import head, result
from apo_bench.trial.scene import scene_of
from apo_bench.trial.stages import (
    RELATIONS,
    Attempt,
    SimulatedDemonstration,
    demonstration_failure,
    draw_robot_error,
    looks_at,
    observe_demonstration,
    predicted_outcome,
    range_sensor,
    replay_and_judge,
    simulate_demonstration,
    stream,
    trial_outcome,
)

MEASURED: Row = {"level": None, "level_deg": None, "careless": None, "noise": "measured"}
"""What a row says of a trial that was not drawn."""


def run_trial(
    settings: TrialSettings,
    scene: Scene | None = None,
    *,
    simulated: SimulatedDemonstration | None = None,
    content: str | None = None,
    method: Any = None,
    watch: Any = None,
    cache: ReplayCache | None = None,
) -> Row:
    """Run one trial.

    Args:
        scene: Compiled for the scenario, clearance, grasp, arm and time step of `settings`; compiled here if it is
            not at hand.
        simulated: The demonstration of this seed and carelessness, if it is at hand.
        content: From `content_hash`, if it is at hand.
        method: What `OwnCorrectors.find` makes of the method of `settings`, if it is at hand.
        watch: Called with the `MjData` of the replay about every 20 ms of simulated time; or several `Hooks`.
        cache: What replays of this scene and seed have in common; changes nothing but the time it takes.

    Raises:
        InputError: The noise model, the relations or the corrector are unknown or returned what they must not.
    """
    scene = scene or scene_of(settings)
    simulated = simulated or simulate_demonstration(
        scene, settings.careless, settings.seed, settings.eye, settings.salt
    )
    content = content or content_hash(scene.scenario, settings.scenario, scene.arm.files)
    asked = head(settings, scene.scenario, spec_hash(settings, content))
    asked |= {"demonstration": simulated.demonstration.code}
    if simulated.demonstration.code != "ok":
        return asked | result(demonstration_failure(simulated.demonstration), success=None)
    truth = simulated.layout.goals
    noise = noise_of(settings, scene, simulated)
    observation = observe_demonstration(simulated, noise, settings.seed, settings.salt)
    given = _corrector_input(settings, observation, truth)
    look = looks_at(simulated, noise, settings.seed, settings.looks, settings.salt, given.assembly)
    return asked | _row(settings, scene, observation, given, truth, truth, method, watch, cache, look)


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
    method: Any = None,
    watch: Any = None,
) -> Row:
    """Replay an observation that came from a file: its truth is not known.

    The judge compares overlaps with those of the scenario's nominal goals, put where the first part was seen; level,
    carelessness and pose errors of the row are null, its noise is `measured`.

    Args:
        text: The content of the file, for the hash.
        method: The method, as in `run_trial`.

    Raises:
        InputError: The method is `oracle`, which would need the truth.
    """
    if knows_truth(settings.method):
        raise InputError(
            f"the method '{settings.method}' was given for a measured observation, whose truth is not known; use none "
            "or paper."
        )
    content = content_hash(scene.scenario, settings.scenario, scene.arm.files)
    asked = head(settings, scene.scenario, spec_hash(settings, content, text)) | MEASURED | {"demonstration": "ok"}
    reference = nominal_where_seen(scene.scenario.goals, observation)
    given = _corrector_input(settings, observation, None)
    return asked | _row(settings, scene, observation, given, reference, None, method, watch, None, None)


def nominal_where_seen(nominal: Array, observation: Observation) -> Array:
    """The nominal goals (n, 4, 4) shifted and turned on the table to where the first operation was seen."""
    k = int(np.argmax(observation.seen))
    T = observation.goals[k] @ pose.inverse(nominal[k])
    flat = pose.at((0.0, 0.0, 0.0), (0.0, 0.0, float(np.degrees(np.arctan2(T[1, 0], T[0, 0])))))
    flat[:2, 3] = (observation.goals[k] - flat @ nominal[k])[:2, 3]
    return np.asarray(flat @ nominal)


def _row(
    settings: TrialSettings,
    scene: Scene,
    observation: Observation,
    given: Observation,
    reference: Array,
    truth: Array | None,
    method: Any,
    watch: Any,
    cache: ReplayCache | None,
    look: Looks | None,
) -> Row:
    """What the method made of the observation, and what came of its plan.

    Args:
        given: What a corrector gets in its place.
        reference: (n, 4, 4) goals that are right for the judge.
        truth: (n, 4, 4) goals of the layout; None if they are not known.
    """
    made = apply_method(method or parsed(settings.method).plan, observation, truth, given, look, scene)
    row = _outcome(settings, scene, made, reference, truth, watch, cache) | confidence(made, observation, given, truth)
    if made.correction is not None:
        row |= {"seen_again": look.seen_again if look else 0}
    if knows_relations(settings.method):
        row |= cast(Row, count_contacts(observation.assembly, given.assembly))
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


def _outcome(
    settings: TrialSettings,
    scene: Scene,
    made: MethodResult,
    reference: Array,
    truth: Array | None,
    watch: Any,
    cache: ReplayCache | None,
) -> Row:
    """Carry out the plan, if there is one."""
    if made.plan is None:
        assert made.failure is not None
        return result(made.failure, success=False) | _correction(made)
    searches = parsed(settings.method).searches
    predicted: Row = {"predicted": predicted_outcome(made.plan, scene, searches)}
    error = draw_robot_error(settings.robot_error, scene, settings.seed, settings.salt)
    attempt = replay_and_judge(made.plan, scene, reference, watch, settings.fidelity, cache, searches, error=error)
    end = result(trial_outcome(attempt), success=attempt.verdict.success)
    driven: Row = {"joint_control": scene.arm.control}
    return end | _correction(made) | predicted | driven | _physics(attempt, made.plan, truth)


def _correction(made: MethodResult) -> Row:
    """What the method did, and what carrying it out would take beyond doing every operation once."""
    extra = None if made.plan is None else len(made.plan.schedule) - len(made.plan.assembly)
    moved = None if made.fitting is None else made.fitting.moves
    freed, tried = ((), ()) if made.correction is None else (made.correction.freed, made.correction.tried)
    return {
        "freed": _numbers(freed),
        "tried": [{"step": int(step) + 1, "free": _numbers(free), "gap_mm": _mm(gap_m)} for step, free, gap_m in tried],
        "extra_operations": extra,
        "free_moved": None if moved is None else [{"operation": k + 1, "mm": mm, "deg": deg} for k, mm, deg in moved],
        "gap_before_mm": _mm(made.gap_before_m),
        "gap_after_mm": _mm(made.gap_after_m),
    }


def _numbers(operations: Iterable[int]) -> list[int]:
    """Counted from 1, as whole numbers that JSON can hold."""
    return [int(k) + 1 for k in operations]


def _physics(attempt: Attempt, plan: Plan, truth: Array | None) -> Row:
    result = attempt.result
    verdict = attempt.verdict
    fixed = None
    free = None
    if truth is not None:
        fixed, free = pose_errors(plan.assembly, plan.start, truth, result.reached)
    found = verdict.rests_on
    return {
        "as_demonstrated": verdict.as_demonstrated,
        "as_demonstrated_code": verdict.demonstrated.code,
        "loose_success": verdict.loose_success,
        "conditions": dict(found.conditions),
        "worst_gap_mm": finite(found.gap_mm),
        "worst_angle_deg": finite(found.angle_deg),
        "least_overlap": finite(found.overlap),
        "penetration_mm": finite(found.penetration_mm),
        "pushed_mm": finite(found.pushed_mm),
        "reached": _poses(result.reached.final),
        "pose_error_fixed_mm": finite(fixed),
        "pose_error_free_mm": finite(free),
        "peak_force_n": finite(result.peak_force_n),
        "moved_in_hand": [_moved(each) for each in result.in_hand],
        "sim_seconds": result.sim_seconds,
    }


def _moved(each: InHand) -> MovedInHand:
    return {
        "operation": each.operation + 1,
        "carried_mm": 1e3 * each.carried_m,
        "carried_deg": math.degrees(each.carried_rad),
        "mm": 1e3 * each.moved_m,
        "deg": math.degrees(each.moved_rad),
    }


def _poses(final: Snapshot | None) -> dict[str, list[float]] | None:
    """Part -> [x, y, z in mm, qw, qx, qy, qz], world frame."""
    if final is None:
        return None
    packed = {part: pose.pack(T) for part, T in final.poses.items()}
    return {part: [*(p[:3] * 1e3).tolist(), *p[3:].tolist()] for part, p in packed.items()}


def _mm(metres: float) -> float | None:
    return finite(metres * 1e3)
