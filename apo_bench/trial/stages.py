"""The stages that every method of a trial shares: show, see, attempt. Chance enters here and nowhere else."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.assembly.goals import Demonstration, Layout, Observation, Plan, ReplayResult
from apo_bench.depth_camera.range_sensor import RangeSensor
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.judging.verdict import Verdict, judge
from apo_bench.observation.noise import Noise
from apo_bench.observation.observing import observe
from apo_bench.observation.relations import Relations, with_relations
from apo_bench.prediction.failure import predict
from apo_bench.records.outcomes import sentence
from apo_bench.records.salt import Salt
from apo_bench.records.settings import RANGE
from apo_bench.scenario.layout import draw_layout
from apo_bench.simulation.execution.controller import replay
from apo_bench.simulation.execution.replay_cache import ReplayCache
from apo_bench.simulation.human.demonstration import demonstrate
from apo_bench.simulation.scene.scene import Scene
from apo_bench.simulation.sensor.watch import DemonstrationCamera, DemonstrationImages

LAYOUT, DEMONSTRATION, OBSERVATION, ARM, RELATIONS, TV = range(6)
"""Streams of chance of a trial. The arm's is reserved: the arm that comes with the benchmark draws nothing."""


@final
@dataclass(frozen=True, eq=False)
class Shown:
    """What was drawn and what the human made of it: shared by every method and level of a seed."""

    layout: Layout
    demonstration: Demonstration
    watched: DemonstrationImages | None = None
    """What the range finder saw of it; None if only poses are asked for."""


@final
@dataclass(frozen=True, eq=False)
class Tried:
    """One replay and what the judge says of it."""

    result: ReplayResult
    verdict: Verdict


class Ending(NamedTuple):
    """Where and why a trial ended; stage `done` and code `ok` if nothing failed."""

    stage: str
    code: str
    operation: int | None
    """Counted from 0."""
    sentence: str

    @property
    def failed(self) -> bool:
        return self.stage != "done"


def stream(seed: int, which: int, salt: Salt | None = None) -> np.random.Generator:
    """The random numbers of one stage of one trial; nothing but seed, stage and salt is in the key."""
    return np.random.default_rng([seed, which, *(salt.words(seed, which) if salt else ())])


def show(scene: Scene, careless: float, seed: int, eye: str = "noise", salt: Salt | None = None) -> Shown:
    """Draw the truth of a trial and let the human demonstrate it; with the eye `range` it is watched meanwhile."""
    layout = draw_layout(scene.scenario, stream(seed, LAYOUT, salt), scene.clearance_mm)
    watcher = DemonstrationCamera(scene.shown, stream(seed, TV, salt)) if eye == RANGE else None
    demonstration = demonstrate(scene, layout, careless, stream(seed, DEMONSTRATION, salt), watcher)
    return Shown(layout, demonstration, watcher.watched() if watcher else None)


def through(scene: Scene, shown: Shown, level_mm: float) -> RangeSensor:
    """The range finder that watched a demonstration, to be passed to `see`; `level_mm` is the noise of a ray."""
    assert shown.watched is not None, "watch the demonstration: show(..., eye='range')"
    yaw = float(np.degrees(np.mean(scene.scenario.site.yaw_rad)))
    turns = pose.at((0.0, 0.0, 0.0), (0.0, 0.0, yaw))[:3, :3] @ scene.scenario.goals[:, :3, :3]
    seen = shown.watched
    return RangeSensor(seen.finder, seen.images, 1e-3 * level_mm, turns, 1e-3 * scene.clearance_mm)


def see(scene: Scene, shown: Shown, noise: Noise, seed: int, salt: Salt | None = None) -> Observation:
    """Watch the demonstration of a trial through a noise model."""
    rng = stream(seed, OBSERVATION, salt)
    gap_m, play_m = scene.scenario.gap_mm * 1e-3, scene.clearance_mm * 1e-3
    return observe(shown.demonstration, noise, rng, gap_m=gap_m, play_m=play_m)


def tell(
    seen: Observation, relations: Relations | None, truth: Array, seed: int, salt: Salt | None = None
) -> Observation:
    """The observation of a trial as a corrector gets it: with relations that may be wrong."""
    return with_relations(seen, relations, truth, stream(seed, RELATIONS, salt))


def misshown(shown: Demonstration) -> Ending:
    """Why a demonstration that is not right itself is not replayed."""
    why = f": {shown.why}" if shown.why else ""
    return Ending("demonstrate", shown.code, None, sentence(shown.code) + why)


def unseen(seen: Observation) -> Ending | None:
    """Why an observation cannot be replayed as it is: an operation was not seen."""
    if seen.seen.all():
        return None
    k = int(np.argmin(seen.seen))
    return Ending("observe", "not_seen", k, sentence("not_seen", operation=k))


def foretold(plan: Plan, scene: Scene) -> dict[str, Any]:
    """What the plan says about itself before it is carried out, as it stands in a row: operations from 1, mm."""
    said = predict(plan, scene.clearance_mm, scene.scenario.thresholds, scene.scenario.attach)
    operation = None if said.operation is None else said.operation + 1
    return {"fails": said.fails, "operation": operation, "code": said.code, "size_mm": said.size_mm}


def attempt(
    plan: Plan,
    scene: Scene,
    reference: Array,
    watch: Any = None,
    fidelity: str = "full",
    branches: ReplayCache | None = None,
    searches: bool = False,
    most_s: float = math.inf,
) -> Tried:
    """Replay a plan and judge what was reached.

    Args:
        reference: (n, 4, 4) goals that are right; the judge takes the true overlap of faces from them.
        watch: Called with the `MjData` about every 20 ms of simulated time.
        searches: The robot feels for a hole where a motion into it is stopped by force.
        most_s: Simulated time that the replay may take.
    """
    result = replay(plan, scene, watch, fidelity=fidelity, branches=branches, searches=searches, most_s=most_s)
    scenario = scene.scenario
    verdict = judge(
        scenario.assembly,
        result.reached,
        reference,
        scenario.thresholds,
        scene.clearance_mm,
        scenario.success_means,
    )
    return Tried(result, verdict)


def ending(tried: Tried) -> Ending:
    """Physics decides: what is right is done, and of what is wrong the robot's own word comes first."""
    outcome, verdict = tried.result.outcome, tried.verdict
    if verdict.success:
        return Ending("done", "ok", None, sentence("ok"))
    if outcome.code != "ok":
        return Ending(outcome.stage, outcome.code, outcome.operation, outcome.sentence)
    found = verdict.rests_on
    why = f": {found.why}" if found.why else ""
    return Ending("judge", found.code, None, sentence(found.code) + why)
