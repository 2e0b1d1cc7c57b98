"""Noise files, by path or by the name under which they come with the package: a measured estimator as TOML."""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.io import JsonNode, read_toml
from apo_bench.perception.observation.models import (
    LEAST_FREEDOM,
    SMALLEST_SCALE,
    Camera,
    ConstantError,
    Empirical,
    Fitted,
    MeasuredNoise,
    NoiseLevel,
    Split,
    Tail,
    ViewNoise,
    empirical_noise,
)
from apo_bench.records import RESIDUALS
from apo_bench.resources import folder
from apo_bench.scenario.values import read_pose


def presets() -> Mapping[str, Path]:
    """The noise files that come with the package, by the names they go by."""
    return {path.stem: path for path in sorted(folder("assets").glob("noise/*.toml"))}


def noise_path(name: str) -> Path | None:
    """The file behind the name of a noise model, None if there is none.

    A path that ends in .toml, a name that comes with the package, or `empirical:` and the path of a file of residuals.
    """
    if name.startswith(RESIDUALS):
        return Path(name.removeprefix(RESIDUALS))
    if name.endswith(".toml"):
        return Path(name)
    return presets().get(name)


_SCHEMA = "apo-bench/noise/2"
"""Without errors of the whole view."""
_FARTHEST_MM = 1e5
_LARGEST_VIEW_MM = 200.0
_LARGEST_VIEW_DEG = 45.0
_HUGE = 1e300
"""Degrees of freedom beyond are infinitely many."""


def noise_of_file(name: str, noise_level: NoiseLevel) -> Fitted | Empirical | None:
    """The noise model of such a name, None if it is no such name.

    Raises:
        InputError: Anything in the file that is not as described, naming file and place.
    """
    path = noise_path(name)
    if path is None:
        return None
    if name.startswith(RESIDUALS):
        return empirical_noise(path, noise_level)
    measured, camera = read_noise(path)
    return Fitted(measured, noise_level, camera)


def read_noise(path: str | Path) -> tuple[MeasuredNoise, Camera]:
    """What a noise file states, and the camera it names, else the default one."""
    required = ("source", "missed_rate", "outlier_rate", "outlier_farthest_mm", "shift", "turn")
    top = read_toml(path, "noise file").fields_of(_SCHEMA, required, ("camera", "view", "constant"))
    shift = _split(top["shift"], "mm", 1000.0)
    turn = _split(top["turn"], "deg", 180.0)
    measured = MeasuredNoise(
        source=top["source"].text(),
        shift_mm=shift,
        turn_deg=turn,
        missed=_number(top["missed_rate"], 0.0, 1.0),
        outliers=_number(top["outlier_rate"], 0.0, 1.0),
        farthest_mm=_number(top["outlier_farthest_mm"], shift.limit, _FARTHEST_MM),
        view=_view(top["view"]) if "view" in top else None,
        constant=_constant(top["constant"]) if "constant" in top else None,
    )
    return measured, Camera(read_pose(top["camera"])) if "camera" in top else Camera()


def noise_text(measured: MeasuredNoise, notes: tuple[str, ...] = (), T_world_camera: Array | None = None) -> str:
    """A noise file, with notes at its head, and the pose of the camera if it is known."""
    source = measured.source.replace("\\", "\\\\").replace('"', '\\"')
    head = (
        [f"# {note}" for note in notes],
        [f'schema = "{_SCHEMA}"', f'source = "{source}"'],
        [f"missed_rate = {measured.missed:.5g}  # of the parts that are there"],
        [f"outlier_rate = {measured.outliers:.5g}  # of the parts that are found"],
        [f"outlier_farthest_mm = {measured.farthest_mm:.5g}"],
        _split_lines("shift", measured.shift_mm, "mm"),
        _split_lines("turn", measured.turn_deg, "deg"),
        [] if T_world_camera is None else _camera_lines(T_world_camera),
        [] if measured.view is None else _view_lines(measured.view),
        [] if measured.constant is None else _constant_lines(measured.constant),
    )
    return "\n".join(line for lines in head for line in lines) + "\n"


def _split_lines(name: str, split: Split, unit: str) -> list[str]:
    lines = ["", f"[{name}]", f"limit_{unit} = {split.limit:.5g}"]
    for direction, tail in (("across", split.across), ("along", split.along)):
        lines.append(f"{direction}_scale_{unit} = {tail.scale:.5g}")
        lines.append(f"{direction}_degrees_of_freedom = {tail.freedom:.5g}")
    return lines


def _camera_lines(T_world_camera: Array) -> list[str]:
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_matrix(T_world_camera[:3, :3]).as_euler("xyz", degrees=True)
    at = 1e3 * T_world_camera[:3, 3]
    return ["", "[camera]  # in the world", f"at_mm = {_listed(at)}", f"turn_deg = {_listed(turn)}"]


def _view_lines(view: ViewNoise) -> list[str]:
    return [
        *("", "[view]  # one error for each demonstration, about the middle of what is seen"),
        *(f"shift_mm = {view.shift_mm:.5g}", f"turn_deg = {view.turn_deg:.5g}"),
    ]


def _constant_lines(constant: ConstantError) -> list[str]:
    packed = pose.pack(constant.frame)
    shift = constant.twist[:3] * 1e3
    turn = np.degrees(constant.twist[3:])
    return [
        *("", "[constant]  # what is seen is displaced by this, in this frame"),
        *(f"shift_mm = {_listed(shift)}", f"turn_deg = {_listed(turn)}"),
        *(f"position_mm = {_listed(packed[:3] * 1e3)}", f"quaternion_wxyz = {_listed(packed[3:])}"),
    ]


def _listed(numbers: Array) -> str:
    return f"[{', '.join(f'{x:.9g}' for x in numbers)}]"


def _view(node: JsonNode) -> ViewNoise:
    keys = node.fields(("shift_mm", "turn_deg"))
    return ViewNoise(
        _number(keys["shift_mm"], 0.0, _LARGEST_VIEW_MM), _number(keys["turn_deg"], 0.0, _LARGEST_VIEW_DEG)
    )


def _constant(node: JsonNode) -> ConstantError:
    keys = node.fields(("shift_mm", "turn_deg", "position_mm", "quaternion_wxyz"))
    shift = keys["shift_mm"].numbers(3)
    turn = keys["turn_deg"].numbers(3)
    q = keys["quaternion_wxyz"].quaternion()
    if np.abs(shift).max() > _LARGEST_VIEW_MM:
        keys["shift_mm"].fail(f"numbers from {-_LARGEST_VIEW_MM:g} to {_LARGEST_VIEW_MM:g} are needed")
    if np.abs(turn).max() > _LARGEST_VIEW_DEG:
        keys["turn_deg"].fail(f"numbers from {-_LARGEST_VIEW_DEG:g} to {_LARGEST_VIEW_DEG:g} are needed")
    place = keys["position_mm"].numbers(3)
    if np.abs(place).max() > _FARTHEST_MM:
        keys["position_mm"].fail(f"numbers of at most {_FARTHEST_MM:g} are needed")
    twist = np.concatenate([shift * 1e-3, np.radians(turn)])
    return ConstantError(twist, pose.unpack(np.concatenate([place * 1e-3, q])))


def _split(node: JsonNode, unit: str, largest: float) -> Split:
    tails = [(f"{d}_scale_{unit}", f"{d}_degrees_of_freedom") for d in ("across", "along")]
    keys = node.fields((f"limit_{unit}", *(key for pair in tails for key in pair)))
    limit = _number(keys[f"limit_{unit}"], 1e-3, largest)
    across, along = (
        Tail(_number(keys[scale], 0.9 * SMALLEST_SCALE * limit, limit), _number(keys[freedom], LEAST_FREEDOM, math.inf))
        for scale, freedom in tails
    )
    return Split(across, along, limit)


def _number(node: JsonNode, low: float, high: float) -> float:
    """A number within bounds; infinity only where that is the bound."""
    x = node.value
    if isinstance(x, bool) or not isinstance(x, int | float) or not low <= x <= high:
        node.fail(f"a number from {low:g}{' on, or inf,' if high == math.inf else f' to {high:g}'} is needed")
    return float(x) if x < _HUGE else math.inf
