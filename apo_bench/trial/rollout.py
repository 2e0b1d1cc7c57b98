"""Assemble a rollout for display: demonstration and replay of a trial, with observed, corrected and true poses."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import final

import numpy as np

from apo_bench.assembly import Observation, Poses, compute_placements
from apo_bench.geometry import Array
from apo_bench.records import DEPTH_CAMERA, TrialConfig, TrialRecord
from apo_bench.scenario.layout import place_layout
from apo_bench.simulation.film.track import FilmTrack, Segment, scenario_segment
from apo_bench.simulation.scene import Scene
from apo_bench.trial.trial_stages import SimulatedDemonstration, watch_again

# Names of the poses in a rollout.
AS_OBSERVED = "as observed"
AS_CORRECTED = "as corrected"
AS_TRUE = "true"


@final
@dataclass(frozen=True, eq=False)
class Rollout:
    """The segments of one trial, or of a scenario, and the poses to show with them."""

    scene: Scene
    segments: tuple[Segment, ...]
    assembled: Poses
    """Final poses that are right, or as planned if the truth is not known."""
    poses: Mapping[str, Array] = field(default_factory=dict)
    """Name, such as `as observed` -> (n, 4, 4), world frame, [m]."""


def scenario_story(scene: Scene) -> Rollout:
    """The rollout of a scenario: its nominal assembly, operation by operation."""
    layout = place_layout(scene.scenario, 0.0, 0.0, 0.0, clearance_mm=scene.clearance_mm)
    segment = scenario_segment(scene, layout.start, layout.poses)
    return Rollout(scene, (segment,), compute_placements(scene.scenario.assembly, layout.start, layout.poses)[-1])


def trial_story(
    spec: TrialConfig,
    scene: Scene,
    seen: Observation,
    track: FilmTrack,
    record: TrialRecord,
    simulated: SimulatedDemonstration | None = None,
) -> Rollout:
    """The rollout of a trial that was replayed.

    Args:
        spec: Settings of the trial.
        seen: Its observation.
        track: The recording of the replay.
        record: The record of the replay.
        simulated: Its demonstration, which is simulated again to record it; None for an observation from a file.
    """
    plan = track.plan
    assert plan is not None
    method = record["method"]
    start = plan.start
    goals = {AS_OBSERVED: seen.poses, AS_CORRECTED: plan.target_poses}
    if method == "uncorrected" or np.array_equal(seen.poses, plan.target_poses):
        del goals[AS_CORRECTED]
    segments = []
    if simulated is not None:
        goals[AS_TRUE] = simulated.layout.poses
        start = simulated.layout.start
        segments.append(_demonstration(spec, scene, simulated))
    reached = Segment(
        title=f"{scene.scenario.name}: replay, method {method}",
        world=scene.work,
        start=start,
        moments=tuple(track.moments),
        ending=ending(record),
        good=record["success"],
    )
    true = goals.get(AS_TRUE, plan.target_poses)
    return Rollout(scene, (*segments, reached), compute_placements(scene.scenario.assembly, start, true)[-1], goals)


def ending(record: TrialRecord) -> str:
    """The outcome of a replay: `failure at operation 3 (force_stop): the motion .. was stopped`."""
    if record["success"]:
        return f"success: {record['sentence']}"
    operation = record["failure_operation"]
    where = "" if operation is None else f" at operation {operation}"
    return f"failure{where} ({record['failure_code']}): {record['sentence']}"


def _demonstration(spec: TrialConfig, scene: Scene, simulated: SimulatedDemonstration) -> Segment:
    """The segment of the demonstration, simulated once more to record it."""
    track = FilmTrack()
    watch_again(scene, simulated, spec.human_error_scale, spec.seed, spec.secret_seed, track.hooks)
    observed = f"observed with noise of {spec.noise_mm:g} mm and {spec.noise_deg:g} deg"
    if spec.pose_source == DEPTH_CAMERA:
        observed = "observed by a depth camera"
    return Segment(
        title=f"{scene.scenario.name}: demonstration, seed {spec.seed}",
        world=scene.shown,
        start=simulated.layout.start,
        moments=tuple(track.moments),
        ending=f"demonstrated; {observed}, then planned and replayed",
        good=None,
    )
