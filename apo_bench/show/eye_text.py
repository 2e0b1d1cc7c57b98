"""What the range finder made of a demonstration, as a form and as lines."""

from __future__ import annotations

from typing import Any

import numpy as np

from apo_bench.depth_camera.follow import Event
from apo_bench.geometry import pose
from apo_bench.show.eye_one import SensorRun

_FORM = "apo-bench/eye/1"


def eye_form(run: SensorRun, level_mm: float, seed: int, careless: float) -> dict[str, Any]:
    """Everything that `apo-bench eye` says, operations from 1; the error is that of the eye, not the human's."""
    of = {event.operation: event for event in run.events if event.operation is not None}
    return {
        "schema": _FORM,
        "scenario": run.name,
        "level_mm": level_mm,
        "seed": seed,
        "careless": careless,
        "firings_s": [round(t, 3) for t in run.watched.times_s],
        "operations": [
            {"operation": k + 1, "moves": list(operation.moves)} | _one(of.get(k), run, k)
            for k, operation in enumerate(run.shown.demonstration.assembly.operations)
        ],
    }


def _one(event: Event | None, run: SensorRun, k: int) -> dict[str, Any]:
    if event is None or event.found is None:
        return {"found": False}
    deviation = np.sqrt(np.diag(event.found.covariance))
    error = pose.log(pose.inverse(event.found.T) @ run.shown.demonstration.goals[k])
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


def eye_lines(form: dict[str, Any]) -> list[str]:
    """A form of `eye_form` as lines to be read."""
    lines = [
        f"{form['scenario']}: seed {form['seed']}, careless {form['careless']:g}, "
        f"{form['level_mm']:g} mm per ray, {len(form['firings_s'])} range images",
        "",
    ]
    for operation in form["operations"]:
        head = f"{operation['operation']} {' + '.join(operation['moves'])}: "
        if not operation["found"]:
            lines.append(head + "not recognised")
            continue
        mm = ", ".join(f"{x:.2f}" for x in operation["deviation_mm"])
        deg = ", ".join(f"{x:.2f}" for x in operation["deviation_deg"])
        models = ", ".join(f"{name} {100 * share:.0f} %" for name, share in operation["explained"].items())
        lines.append(
            f"{head}at {operation['time_s']:.2f} s; off by {operation['error_mm']:.2f} mm, "
            f"{operation['error_deg']:.2f} deg; known to {mm} mm, {deg} deg; explained by {models}"
        )
    return lines
