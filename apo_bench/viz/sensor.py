"""One demonstration through the range finder, and what it made of that: as a record, as JSON, and as a table."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import Array, pose
from apo_bench.perception.depth_camera.follow import Event
from apo_bench.perception.depth_camera.range_finder import RangeFinder
from apo_bench.records import DEPTH_CAMERA, check
from apo_bench.scenario.file import load_scenario
from apo_bench.simulation.scene import build_scene
from apo_bench.simulation.sensor.rays import ModelRays
from apo_bench.simulation.sensor.watch import DemonstrationImages
from apo_bench.trial.stages import (
    OBSERVATION,
    SimulatedDemonstration,
    demonstration_failure,
    range_sensor,
    simulate_demonstration,
    stream,
)
from apo_bench.viz.tables import form_table

_FORM = "apo-bench/eye/1"
_COLUMNS = {
    "operation": "d",
    "moves": "",
    "found": "",
    "time_s": ".2f",
    "error_mm": ".2f",
    "error_deg": ".2f",
    "deviation_mm": ".2f",
    "deviation_deg": ".2f",
    "explained": ".0%",
}


@final
@dataclass(frozen=True, eq=False)
class SensorRun:
    """A demonstration, what was measured of it, and what was made of that."""

    name: str
    """The name of the scenario."""
    simulated: SimulatedDemonstration
    watched: DemonstrationImages
    images: tuple[Array, ...]
    """Measured range images, (views, height, width) each, [m]."""
    events: tuple[Event, ...]
    models: ModelRays
    """The parts as the range finder knows them."""


def run_sensor(scenario: str, noise_mm: float, seed: int, human_error_scale: float) -> SensorRun:
    """Let the human demonstrate, and watch: the same images and poses as in a trial with these settings.

    Raises:
        InputError: A setting that is not allowed.
        RuntimeError: The demonstration itself failed.
    """
    check("noise_mm", noise_mm, DEPTH_CAMERA)
    check("human_error_scale", human_error_scale)
    check("seed", seed)
    scene = build_scene(load_scenario(scenario))
    simulated = simulate_demonstration(scene, human_error_scale, seed, DEPTH_CAMERA)
    if simulated.demonstration.code != "ok":
        raise RuntimeError(f"{demonstration_failure(simulated.demonstration).sentence}; try another seed")
    assert simulated.images is not None
    sensor = range_sensor(scene, simulated, noise_mm)
    images = tuple(sensor.sensed(stream(seed, OBSERVATION)))
    events = sensor.events(simulated.demonstration, images)
    models = ModelRays(simulated.demonstration.assembly.solids, sensor.play_m)
    return SensorRun(scene.scenario.name, simulated, simulated.images, images, events, models)


def checked_view(view: int) -> int:
    """The number of a view, from 0, of one given from 1.

    Raises:
        InputError: The range finder has no such view.
    """
    views = len(RangeFinder().views)
    require(1 <= view <= views, f"--view {view} was given; the range finder has views 1 to {views}.")
    return view - 1


def sensor_form(run: SensorRun, noise_mm: float, seed: int, human_error_scale: float) -> dict[str, Any]:
    """Everything that `apo-bench inspect depth` says, operations from 1; the error is that of the sensor, not the human's."""
    by_operation = {event.operation: event for event in run.events if event.operation is not None}
    return {
        "schema": _FORM,
        "scenario": run.name,
        "noise_mm": noise_mm,
        "seed": seed,
        "human_error_scale": human_error_scale,
        "firings_s": [round(t, 3) for t in run.watched.times_s],
        "operations": [
            {"operation": k + 1, "moves": list(operation.moves)} | _operation_form(by_operation.get(k), run, k)
            for k, operation in enumerate(run.simulated.demonstration.assembly.operations)
        ],
    }


def _operation_form(event: Event | None, run: SensorRun, k: int) -> dict[str, Any]:
    if event is None or event.found is None:
        return {"found": False}
    deviation = np.sqrt(np.diag(event.found.covariance))
    error = pose.log(pose.inverse(event.found.T) @ run.simulated.demonstration.poses[k])
    packed = pose.pack(event.found.T)
    return {
        "found": True,
        "time_s": round(run.watched.times_s[event.last], 3),
        "explained": {name: round(share, 3) for name, share in event.explained.items()},
        "pose": [*(1e3 * packed[:3]).tolist(), *packed[3:].tolist()],
        "deviation_mm": (1e3 * deviation[:3]).tolist(),
        "deviation_deg": np.degrees(deviation[3:]).tolist(),
        "error_mm": float(1e3 * np.linalg.norm(error[:3])),
        "error_deg": float(np.degrees(np.linalg.norm(error[3:]))),
    }


def sensor_table(form: dict[str, Any]) -> Any:
    """The operations of `sensor_form` as a table of `rich`: when, how far off, how well known, explained by what."""
    return form_table(form["operations"], _COLUMNS)
