"""One demonstration through the range finder, with everything that it thought on the way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from apo_bench.depth_camera.follow import Event
from apo_bench.depth_camera.range_finder import RangeFinder
from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.records.settings import RANGE, check
from apo_bench.scenario.file import load_scenario
from apo_bench.simulation.scene.scene import build_scene
from apo_bench.simulation.sensor.watch import DemonstrationImages
from apo_bench.trial.stages import (
    OBSERVATION,
    Recording,
    demonstration_failure,
    range_sensor,
    record_demonstration,
    stream,
)


@final
@dataclass(frozen=True, eq=False)
class SensorRun:
    """A demonstration, what was measured of it, and what was made of that."""

    name: str
    """The name of the scenario."""
    shown: Recording
    watched: DemonstrationImages
    images: tuple[Array, ...]
    """Measured range images, (views, height, width) each, [m]."""
    events: tuple[Event, ...]


def run_sensor(scenario: str, level_mm: float, seed: int, careless: float) -> SensorRun:
    """Let the human demonstrate, and watch: the same images and poses as in a trial with these settings.

    Raises:
        InputError: A setting that is not allowed.
        RuntimeError: The demonstration itself failed.
    """
    check("level_mm", level_mm, RANGE)
    check("careless", careless)
    check("seed", seed)
    scene = build_scene(load_scenario(scenario))
    shown = record_demonstration(scene, careless, seed, RANGE)
    if shown.demonstration.code != "ok":
        raise RuntimeError(f"{demonstration_failure(shown.demonstration).sentence}; try another seed")
    assert shown.watched is not None
    eye = range_sensor(scene, shown, level_mm)
    images = tuple(eye.sensed(stream(seed, OBSERVATION)))
    return SensorRun(scene.scenario.name, shown, shown.watched, images, eye.events(shown.demonstration, images))


def checked_view(view: int) -> int:
    """The number of a view, from 0, of one given from 1.

    Raises:
        InputError: The range finder has no such view.
    """
    views = len(RangeFinder().views)
    if not 1 <= view <= views:
        raise InputError(f"--view {view} was given; the range finder has views 1 to {views}.")
    return view - 1
