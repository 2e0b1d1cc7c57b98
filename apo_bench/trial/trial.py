"""One trial: a demonstration, watched, planned by a method, replayed, judged; as one row."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, cast

import numpy as np

from apo_bench.assembly.goals import Observation, Plan
from apo_bench.assembly.reached import Snapshot
from apo_bench.errors import InputError
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.observation.noise import Level, Noise, make_noise
from apo_bench.observation.relations import make_relations, with_relations
from apo_bench.records.method import knows_relations, knows_truth, parsed
from apo_bench.records.relations import RECOGNISED
from apo_bench.records.row import Row, finite
from apo_bench.records.settings import RANGE, TrialSettings
from apo_bench.simulation.execution.replay_cache import ReplayCache
from apo_bench.simulation.scene.scene import Scene
from apo_bench.trial.confidence import confidence
from apo_bench.trial.fingerprint import content_hash, spec_hash
from apo_bench.trial.planning import Planned, plan
from apo_bench.trial.pose_error import pose_errors
from apo_bench.trial.recognised import counted, understood
from apo_bench.trial.row import head, result
from apo_bench.trial.scene import scene_of
from apo_bench.trial.stages import (
    RELATIONS,
    Attempt,
    Recording,
    demonstration_failure,
    observe_recording,
    predicted_outcome,
    range_sensor,
    record_demonstration,
    replay_and_judge,
    stream,
    trial_outcome,
)

MEASURED: Row = {"level": None, "level_deg": None, "careless": None, "noise": "measured"}
"""What a row says of a trial that was not drawn."""


def run_trial(
    spec: TrialSettings,
    scene: Scene | None = None,
    *,
    recording: Recording | None = None,
    content: str | None = None,
    method: Any = None,
    watch: Any = None,
    cache: ReplayCache | None = None,
) -> Row:
    """Run one trial.

    Args:
        scene: Compiled for the scenario, clearance, grasp, arm and time step of `spec`; compiled here if it is not at
            hand.
        recording: The demonstration of this seed and carelessness, if it is at hand.
        content: From `content_hash`, if it is at hand.
        method: What `OwnCorrectors.find` makes of the method of `spec`, if it is at hand.
        watch: Called with the `MjData` of the replay about every 20 ms of simulated time.
        cache: What replays of this scene and seed have in common; changes nothing but the time it takes.

    Raises:
        InputError: The noise model, the relations or the corrector are unknown or returned what they must not.
    """
    scene = scene or scene_of(spec)
    recording = recording or record_demonstration(scene, spec.careless, spec.seed, spec.eye, spec.salt)
    content = content or content_hash(scene.scenario, spec.scenario, scene.arm.mjcf)
    first = head(spec, scene.scenario, spec_hash(spec, content)) | {"demonstration": recording.demonstration.code}
    if recording.demonstration.code != "ok":
        return first | result(demonstration_failure(recording.demonstration), success=None)
    seen = observe_recording(recording, noise_of(spec, scene, recording), spec.seed, spec.salt)
    truth = recording.layout.goals
    given = _corrector_input(spec, seen, truth)
    planned = plan(method or parsed(spec.method).plan, seen, truth, given)
    said = confidence(planned, seen, given, truth)
    return first | _carry_out(planned, scene, truth, truth, watch, spec, cache) | said | _contacts(spec, seen, given)


def noise_of(spec: TrialSettings, scene: Scene, recording: Recording) -> Noise:
    """The noise model of a trial, or the range finder that recorded its demonstration."""
    if spec.eye == RANGE:
        return range_sensor(scene, recording, spec.level_mm)
    return make_noise(spec.noise, Level(spec.level_mm, spec.level_deg))


def run_measured(
    spec: TrialSettings, scene: Scene, seen: Observation, text: str, *, method: Any = None, watch: Any = None
) -> Row:
    """Replay an observation that came from a file: its truth is not known.

    The judge compares overlaps with those of the scenario's nominal goals, put where the first part was seen; level,
    carelessness and pose errors of the row are null, its noise is `measured`.

    Args:
        text: The content of the file, for the hash.
        method: As in `run_trial`.

    Raises:
        InputError: The method is `oracle`, which would need the truth.
    """
    if knows_truth(spec.method):
        raise InputError(
            f"the method '{spec.method}' was given for a measured observation, whose truth is not known; use none or "
            "paper."
        )
    content = content_hash(scene.scenario, spec.scenario, scene.arm.mjcf)
    first = head(spec, scene.scenario, spec_hash(spec, content, text)) | MEASURED | {"demonstration": "ok"}
    given = _corrector_input(spec, seen, None)
    planned = plan(method or parsed(spec.method).plan, seen, None, given)
    said = confidence(planned, seen, given, None) | _contacts(spec, seen, given)
    return (
        first
        | _carry_out(planned, scene, nominal_where_seen(scene.scenario.goals, seen), None, watch, spec, None)
        | said
    )


def nominal_where_seen(nominal: Array, seen: Observation) -> Array:
    """The nominal goals (n, 4, 4) shifted and turned on the table to where the first operation was seen."""
    k = int(np.argmax(seen.seen))
    T = seen.goals[k] @ pose.inverse(nominal[k])
    flat = pose.at((0.0, 0.0, 0.0), (0.0, 0.0, float(np.degrees(np.arctan2(T[1, 0], T[0, 0])))))
    flat[:2, 3] = (seen.goals[k] - flat @ nominal[k])[:2, 3]
    return np.asarray(flat @ nominal)


def _corrector_input(spec: TrialSettings, seen: Observation, truth: Array | None) -> Observation:
    """The observation as a corrector gets it: with the relations as given, as recognised, or wrong ones."""
    if not knows_relations(spec.method):
        return seen
    if spec.relations in RECOGNISED:
        return understood(seen, spec.relations)
    if truth is None:
        return seen
    return with_relations(seen, make_relations(spec.relations), truth, stream(spec.seed, RELATIONS, spec.salt))


def _contacts(spec: TrialSettings, seen: Observation, given: Observation) -> Row:
    """How many of the contacts that a method was given are right."""
    return cast(Row, counted(seen.assembly, given.assembly)) if knows_relations(spec.method) else {}


def _carry_out(
    planned: Planned,
    scene: Scene,
    reference: Array,
    truth: Array | None,
    watch: Any,
    spec: TrialSettings,
    cache: ReplayCache | None,
) -> Row:
    said = _correction(planned)
    if planned.plan is None:
        assert planned.refused is not None
        return result(planned.refused, success=False) | said
    said |= {"predicted": predicted_outcome(planned.plan, scene)}
    searches = parsed(spec.method).searches
    attempt = replay_and_judge(planned.plan, scene, reference, watch, spec.fidelity, cache, searches)
    end = result(trial_outcome(attempt), success=attempt.verdict.success)
    return end | said | _physics(attempt, planned.plan, truth)


def _correction(planned: Planned) -> Row:
    """What the method did, and what carrying it out would take beyond doing every operation once."""
    extra = None if planned.plan is None else len(planned.plan.schedule) - len(planned.plan.assembly)
    return {
        "freed": _numbers(planned.freed),
        "tried": [
            {"step": int(step) + 1, "free": _numbers(free), "gap_mm": _mm(gap_m)} for step, free, gap_m in planned.tried
        ],
        "extra_operations": extra,
        "gap_before_mm": _mm(planned.gap_before_m),
        "gap_after_mm": _mm(planned.gap_after_m),
    }


def _numbers(operations: Iterable[int]) -> list[int]:
    """Counted from 1, as whole numbers that JSON can hold."""
    return [int(k) + 1 for k in operations]


def _physics(attempt: Attempt, plan: Plan, truth: Array | None) -> Row:
    result, verdict = attempt.result, attempt.verdict
    fixed, free = None, None
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
        "sim_seconds": result.sim_seconds,
    }


def _poses(final: Snapshot | None) -> dict[str, list[float]] | None:
    """Part -> [x, y, z in mm, qw, qx, qy, qz], world frame."""
    if final is None:
        return None
    packed = {part: pose.pack(T) for part, T in final.poses.items()}
    return {part: [*(p[:3] * 1e3).tolist(), *p[3:].tolist()] for part, p in packed.items()}


def _mm(metres: float) -> float | None:
    return finite(metres * 1e3)
