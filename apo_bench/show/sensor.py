"""One demonstration through the range finder, and all that it made of that: as a record, a form, lines, and a picture
with a row for each operation: what a camera sees, range, difference, regions, fitted model."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np

from apo_bench.assembly import Assembly
from apo_bench.depth_camera.follow import Event
from apo_bench.depth_camera.range_finder import RangeFinder
from apo_bench.errors import require
from apo_bench.geometry import Array, pose
from apo_bench.io import default_looks, save_figure
from apo_bench.records import RANGE, check
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

_FORM = "apo-bench/eye/1"
_TITLES = ("TV camera, quiet", "range image [m]", "minus the one before [mm]", "appeared, vanished", "fitted model")
_APPEARED = "#1b7837"
_VANISHED = "#b2182b"
_OUTLINE = "#d95f02"
_AROUND = 20
"""Pixels around what changed."""
_LARGEST_MM = 60.0
_RESIDUAL_MM = 5.0


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
    simulated = simulate_demonstration(scene, careless, seed, RANGE)
    if simulated.demonstration.code != "ok":
        raise RuntimeError(f"{demonstration_failure(simulated.demonstration).sentence}; try another seed")
    assert simulated.images is not None
    sensor = range_sensor(scene, simulated, level_mm)
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


def sensor_form(run: SensorRun, level_mm: float, seed: int, careless: float) -> dict[str, Any]:
    """Everything that `apo-bench eye` says, operations from 1; the error is that of the sensor, not the human's."""
    by_operation = {event.operation: event for event in run.events if event.operation is not None}
    return {
        "schema": _FORM,
        "scenario": run.name,
        "level_mm": level_mm,
        "seed": seed,
        "careless": careless,
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
    error = pose.log(pose.inverse(event.found.T) @ run.simulated.demonstration.goals[k])
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


def sensor_lines(form: dict[str, Any]) -> list[str]:
    """A form of `sensor_form` as lines to be read."""
    return [
        f"{form['scenario']}: seed {form['seed']}, careless {form['careless']:g}, "
        f"{form['level_mm']:g} mm per ray, {len(form['firings_s'])} range images",
        "",
        *(f"{o['operation']} {' + '.join(o['moves'])}: {_seen(o)}" for o in form["operations"]),
    ]


def _seen(operation: dict[str, Any]) -> str:
    if not operation["found"]:
        return "not recognised"
    mm, deg = (", ".join(f"{x:.2f}" for x in operation[f"deviation_{unit}"]) for unit in ("mm", "deg"))
    models = ", ".join(f"{name} {100 * share:.0f} %" for name, share in operation["explained"].items())
    return (
        f"at {operation['time_s']:.2f} s; off by {operation['error_mm']:.2f} mm, {operation['error_deg']:.2f} deg; "
        f"known to {mm} mm, {deg} deg; explained by {models}"
    )


@default_looks()
def draw_sensor(run: SensorRun, out: Path, view: int = 0) -> None:
    """Draw every operation that was noticed, in one view of the range finder."""
    from matplotlib.figure import Figure

    events = run.events
    figure = Figure(figsize=(15.0, 2.55 * max(1, len(events)) + 0.3), layout="constrained")
    rows = figure.subplots(max(1, len(events)), len(_TITLES), squeeze=False)
    for axes, title in zip(rows[0], _TITLES, strict=True):
        axes.set_title(title, fontsize=11)
    for axes in rows.ravel():
        axes.set(xticks=[], yticks=[])
    for row, event in zip(rows, events, strict=False):
        row[0].set_ylabel(_label(run.simulated.demonstration.assembly, event), fontsize=9)
        _draw_row(row, run, event, view)
    # only where anything ever changed is shown
    changed = [event.regions[view].appeared | event.regions[view].vanished for event in events]
    v, u = np.nonzero(np.any(changed, axis=0)) if changed else (np.zeros(0), np.zeros(0))
    for axes in rows[:, 1:].ravel() if len(u) else ():
        axes.set(xlim=(u.min() - _AROUND, u.max() + _AROUND), ylim=(v.max() + _AROUND, v.min() - _AROUND))
    save_figure(figure, out, dpi=72)


def _label(assembly: Assembly, event: Event) -> str:
    moved = ", ".join(sorted(event.moved)) or "nothing"
    if event.operation is None:
        return f"{moved}: not expected"
    ended = "not recognised" if event.found is None else f"{100 * event.found.explained:.0f} % explained"
    return f"{event.operation + 1}: {moved}, {ended}"


def _draw_row(row: Any, run: SensorRun, event: Event, view: int) -> None:
    from matplotlib.colors import ListedColormap

    before = run.images[event.first][view]
    after = run.images[event.last][view]
    regions = event.regions[view]
    row[0].imshow(run.watched.pictures[event.last], cmap="gray", vmin=0.0, vmax=1.0)
    row[1].imshow(after, cmap="viridis_r", vmin=np.nanmin(after), vmax=np.nanquantile(after, 0.95))
    row[2].imshow(1e3 * (after - before), cmap="RdBu", vmin=-_LARGEST_MM, vmax=_LARGEST_MM)
    row[3].imshow(after, cmap="gray_r", vmin=np.nanmin(after), vmax=2.0 * np.nanmax(after))
    for mask, color in ((regions.appeared, _APPEARED), (regions.vanished, _VANISHED)):
        row[3].imshow(np.where(mask, 1.0, np.nan), cmap=ListedColormap([color]), vmin=0.0, vmax=1.0, alpha=0.8)
    row[4].imshow(after, cmap="gray_r", vmin=np.nanmin(after), vmax=2.0 * np.nanmax(after))
    if event.found is not None and event.model is not None:
        camera = run.watched.finder.views[view]
        distance, _ = run.models(event.model.put(event.found.T), camera.origin, camera.rays)
        expected = distance.reshape(after.shape)
        drawn = row[4].imshow(
            np.where(regions.appeared & (np.abs(after - expected) < 0.02), 1e3 * (after - expected), np.nan),
            cmap="coolwarm",
            vmin=-_RESIDUAL_MM,
            vmax=_RESIDUAL_MM,
        )
        row[4].contour(np.isfinite(expected), levels=[0.5], colors=_OUTLINE, linewidths=1.2)
        bar = row[4].figure.colorbar(drawn, ax=row[4], shrink=0.85)
        bar.ax.tick_params(labelsize=7)
        bar.set_label("measured - model [mm]", fontsize=7)
