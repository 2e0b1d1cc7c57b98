"""Noise files: what was measured of a pose estimator, as TOML."""

from __future__ import annotations

import math
from pathlib import Path

from apo_bench.io.strict_json import JsonNode
from apo_bench.io.strict_toml import read_toml
from apo_bench.observation.models.camera import Camera
from apo_bench.observation.models.empirical import Empirical, empirical_noise
from apo_bench.observation.models.fitted import LEAST_FREEDOM, SMALLEST, Fitted, MeasuredNoise
from apo_bench.observation.models.level import Level
from apo_bench.observation.models.tails import Split, Tail
from apo_bench.observation.presets import noise_path
from apo_bench.records.short_names import RESIDUALS
from apo_bench.scenario.keys import read_pose

_SCHEMA = "apo-bench/noise/1"
_FARTHEST_MM = 1e5
_HUGE = 1e300
"""Degrees of freedom beyond are infinitely many."""


def noise_of_file(name: str, level: Level) -> Fitted | Empirical | None:
    """The noise model of such a name, None if it is no such name.

    Raises:
        InputError: Anything in the file that is not as described, naming file and place.
    """
    path = noise_path(name)
    if path is None:
        return None
    if name.startswith(RESIDUALS):
        return empirical_noise(path, level)
    measured, camera = read_noise(path)
    return Fitted(measured, level, camera)


def read_noise(path: str | Path) -> tuple[MeasuredNoise, Camera]:
    """What a noise file states, and the camera it names, else the default one."""
    root = read_toml(path, "noise file")
    if isinstance(root.value, dict) and root.value.get("schema", _SCHEMA) != _SCHEMA:
        root.child(root.value["schema"], "schema").fail(f'"{_SCHEMA}" is needed')
    required = ("schema", "source", "missed_rate", "outlier_rate", "outlier_farthest_mm", "shift", "turn")
    top = root.fields(required, ("camera",))
    shift, turn = _split(top["shift"], "mm", 1000.0), _split(top["turn"], "deg", 180.0)
    measured = MeasuredNoise(
        source=top["source"].text(),
        shift_mm=shift,
        turn_deg=turn,
        missed=_number(top["missed_rate"], 0.0, 1.0),
        outliers=_number(top["outlier_rate"], 0.0, 1.0),
        farthest_mm=_number(top["outlier_farthest_mm"], shift.limit, _FARTHEST_MM),
    )
    return measured, Camera(read_pose(top["camera"])) if "camera" in top else Camera()


def noise_text(measured: MeasuredNoise, notes: tuple[str, ...] = ()) -> str:
    """A noise file, with notes at its head."""
    source = measured.source.replace("\\", "\\\\").replace('"', '\\"')
    head = (
        [f"# {note}" for note in notes],
        [f'schema = "{_SCHEMA}"', f'source = "{source}"'],
        [f"missed_rate = {measured.missed:.5g}  # of the parts that are there"],
        [f"outlier_rate = {measured.outliers:.5g}  # of the parts that are found"],
        [f"outlier_farthest_mm = {measured.farthest_mm:.5g}"],
        _split_lines("shift", measured.shift_mm, "mm"),
        _split_lines("turn", measured.turn_deg, "deg"),
    )
    return "\n".join(line for lines in head for line in lines) + "\n"


def _split_lines(name: str, split: Split, unit: str) -> list[str]:
    lines = ["", f"[{name}]", f"limit_{unit} = {split.limit:.5g}"]
    for direction, tail in (("across", split.across), ("along", split.along)):
        lines.append(f"{direction}_scale_{unit} = {tail.scale:.5g}")
        lines.append(f"{direction}_degrees_of_freedom = {tail.freedom:.5g}")
    return lines


def _split(node: JsonNode, unit: str, largest: float) -> Split:
    tails = [(f"{d}_scale_{unit}", f"{d}_degrees_of_freedom") for d in ("across", "along")]
    keys = node.fields((f"limit_{unit}", *(key for pair in tails for key in pair)))
    limit = _number(keys[f"limit_{unit}"], 1e-3, largest)
    across, along = (
        Tail(_number(keys[scale], 0.9 * SMALLEST * limit, limit), _number(keys[freedom], LEAST_FREEDOM, math.inf))
        for scale, freedom in tails
    )
    return Split(across, along, limit)


def _number(node: JsonNode, low: float, high: float) -> float:
    """A number within bounds; infinity only where that is the bound."""
    x = node.value
    if isinstance(x, bool) or not isinstance(x, int | float) or not low <= x <= high:
        node.fail(f"a number from {low:g}{' on, or inf,' if high == math.inf else f' to {high:g}'} is needed")
    return float(x) if x < _HUGE else math.inf
