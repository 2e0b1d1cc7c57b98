"""Estimate the poses of one demonstration by the depth camera, and return the result as one JSON object."""

from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.perception.depth_camera.operation_detection import DetectedOperation
from apo_bench.records import DEPTH_CAMERA, check
from apo_bench.scenario.scenario_file import load_scenario
from apo_bench.simulation.scene import build_scene
from apo_bench.simulation.sensor.rays import ModelRays
from apo_bench.simulation.sensor.watch import DemonstrationImages
from apo_bench.trial.trial_stages import (
    OBSERVATION,
    SimulatedDemonstration,
    demonstration_failure,
    range_sensor,
    simulate_demonstration,
    stream,
)

_SCHEMA = "apo-bench/depth/1"
DEPTH_COLUMNS = {
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
"""Columns of the operations of `make_depth_form`, with their formats."""


class DepthRun(NamedTuple):
    """A demonstration, its images, and the events that the depth camera detects in them."""

    scenario: str
    simulated: SimulatedDemonstration
    # camera pictures and their times
    watched: DemonstrationImages
    images: tuple[Array, ...]
    """Measured depth images, (views, height, width) each, [m]."""
    events: tuple[DetectedOperation, ...]
    models: ModelRays
    """Casts rays at models of the parts, which are smaller by the clearance as the real parts are."""


def run_depth_camera(scenario: str, noise_mm: float, seed: int, human_error_scale: float) -> DepthRun:
    """Simulate a demonstration and estimate its poses: the same images and poses as in a trial with these settings.

    Args:
        scenario: Name or file.
        noise_mm: Standard deviation of the depth per ray, [mm].
        seed: Number of the trial.
        human_error_scale: Factor on the human error of the scenario.

    Raises:
        InputError: A setting is not allowed.
        RuntimeError: The demonstration itself failed.
    """
    check("noise_mm", noise_mm)
    check("human_error_scale", human_error_scale)
    check("seed", seed)
    scene = build_scene(load_scenario(scenario))
    simulated = simulate_demonstration(scene, human_error_scale, seed, DEPTH_CAMERA)
    if simulated.demonstration.code != "ok" or simulated.images is None:
        raise RuntimeError(f"{demonstration_failure(simulated.demonstration).sentence}; try another seed.")
    sensor = range_sensor(scene, simulated, noise_mm)
    images = tuple(sensor.add_noise(stream(seed, OBSERVATION)))
    events = sensor.detect_operations(simulated.demonstration, images)
    models = ModelRays(simulated.demonstration.assembly.solids, sensor.play_m)
    return DepthRun(scene.scenario.name, simulated, simulated.images, images, events, models)


def make_depth_form(run: DepthRun, noise_mm: float, seed: int, human_error_scale: float) -> dict[str, Any]:
    """Return a run as a JSON object: operations from 1, errors of the depth camera without those of the human."""
    operations = []
    # unexpected events have operation None and are not looked up
    events = {event.operation: event for event in run.events}
    for k, operation in enumerate(run.simulated.demonstration.assembly.operations):
        event = events.get(k)
        form = {"operation": k + 1, "moves": list(operation.moves), "found": False}
        operations.append(form if event is None or event.found is None else form | _make_estimate_form(event, run, k))
    return {
        "schema": _SCHEMA,
        "scenario": run.scenario,
        "noise_mm": noise_mm,
        "seed": seed,
        "human_error_scale": human_error_scale,
        "images_s": [round(t, 3) for t in run.watched.times_s],
        "operations": operations,
    }


def _make_estimate_form(event: Any, run: DepthRun, k: int) -> dict[str, Any]:
    """Return the estimated pose of operation k, (x, y, z [mm], qw, qx, qy, qz), its deviations and its true error."""
    found = event.found
    deviation = np.sqrt(np.diag(found.covariance))
    error = pose.log(pose.inverse(found.T) @ run.simulated.demonstration.poses[k])
    packed = pose.pack(found.T)
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
