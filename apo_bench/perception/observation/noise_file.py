"""Read and write noise files (TOML), which state the measured error distribution of a pose estimator."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from apo_bench.errors import require
from apo_bench.io import FileTable, Text, format_toml, read_typed
from apo_bench.perception.observation.models import (
    LEAST_FREEDOM,
    SMALLEST_SCALE,
    Camera,
    EmpiricalNoise,
    FittedNoise,
    MeasuredNoise,
    NoiseLevel,
    PoseResults,
    StudentT,
    TruncatedTails,
    load_empirical_noise,
    read_pose_results,
)
from apo_bench.records import ESTIMATES, RESIDUALS
from apo_bench.resources import folder
from apo_bench.scenario.values import Pose

SEPARATOR = "::"
"""Between a results file and the noise file that states its errors."""
_FARTHEST_MM = 1e5
"""Largest allowed distance of an outlier."""
_INFINITE_FREEDOM = 1e300
"""Largest degrees of freedom in a file; read as infinite, which is a Gaussian."""
_Share = Annotated[float, Meta(ge=0.0, le=1.0)]
_Freedom = Annotated[float, Meta(ge=LEAST_FREEDOM)]


def _make_split_table_type(name: str, unit: str) -> Any:
    """Make the type of a table that states the distribution of errors across and along a camera ray."""
    fields = [
        (f"limit_{unit}", Annotated[float, Meta(ge=1e-3)]),
        (f"across_scale_{unit}", float),
        ("across_degrees_of_freedom", _Freedom),
        (f"along_scale_{unit}", float),
        ("along_degrees_of_freedom", _Freedom),
    ]
    return msgspec.defstruct(name, fields, bases=(FileTable,), frozen=True)


ShiftTable = _make_split_table_type("ShiftTable", "mm")
"""Table `[shift]`: errors of the position."""
TurnTable = _make_split_table_type("TurnTable", "deg")
"""Table `[turn]`: errors of the rotation."""


class NoiseFileTable(FileTable, frozen=True, kw_only=True):
    """All entries of a noise file."""

    schema: Literal["apo-bench/noise/2"]
    source: Text
    missed_rate: _Share
    outlier_rate: _Share
    outlier_farthest_mm: Annotated[float, Meta(le=_FARTHEST_MM)]
    shift: ShiftTable  # type: ignore[valid-type]
    turn: TurnTable  # type: ignore[valid-type]
    camera: Pose | None = None


def list_presets() -> Mapping[str, Path]:
    """Return the noise files of the package: name -> path."""
    return {path.stem: path for path in sorted(folder("assets").glob("noise/*.toml"))}


def list_noise_files(name: str) -> tuple[Path, ...]:
    """Return the files that the name of a noise model refers to, the main one first; empty if it refers to none.

    Args:
        name: A path that ends in .toml, the name of a noise file of the package, `empirical:` and the path of a file of
            residuals, or `poses:` and the path of a results file, which `::` and a noise file may follow.
    """
    if name.startswith(RESIDUALS):
        return (Path(name.removeprefix(RESIDUALS)),)
    if name.startswith(ESTIMATES):
        results, _, fitted = name.removeprefix(ESTIMATES).partition(SEPARATOR)
        return Path(results), *(list_noise_files(fitted) or (Path(fitted),) * bool(fitted))
    preset = list_presets().get(name)
    return (Path(name),) if name.endswith(".toml") else () if preset is None else (preset,)


def make_noise_of_file(name: str, noise_level: NoiseLevel) -> FittedNoise | EmpiricalNoise | PoseResults | None:
    """Make the noise model of a name as in `list_noise_files`; None if the name refers to no file.

    Raises:
        InputError: The file is not valid; the message names file and place.
    """
    paths = list_noise_files(name)
    if not paths:
        return None
    if name.startswith(RESIDUALS):
        return load_empirical_noise(paths[0], noise_level)
    if name.startswith(ESTIMATES):
        return read_pose_results(paths[0], noise_level, *(read_noise(path)[0] for path in paths[1:]))
    measured, camera = read_noise(paths[0])
    return FittedNoise(measured, noise_level, camera)


def read_noise(path: str | Path) -> tuple[MeasuredNoise, Camera]:
    """Read a noise file; return the measured distribution and the camera, the default one if the file states none.

    Raises:
        InputError: The file is not valid; the message names file and place.
    """
    top = read_typed(path, NoiseFileTable, "noise file")
    shift = _read_split(top.shift, f"{path}, shift", 1000.0)
    far = top.outlier_farthest_mm
    require(far >= shift.limit, f"{path}, outlier_farthest_mm: the limit of the shift or more is needed, not {far:g}.")
    measured = MeasuredNoise(
        source=top.source,
        shift_mm=shift,
        turn_deg=_read_split(top.turn, f"{path}, turn", 180.0),
        missed=top.missed_rate,
        outliers=top.outlier_rate,
        farthest_mm=far,
    )
    return measured, Camera() if top.camera is None else Camera(top.camera.matrix)


def _read_split(table: msgspec.Struct, place: str, largest: float) -> TruncatedTails:
    """Make the distribution of a `[shift]` or `[turn]` table.

    Args:
        place: File and table, for error messages.
        largest: Largest allowed limit, [mm] or [degrees].
    """
    limit, across_scale, across_freedom, along_scale, along_freedom = msgspec.structs.astuple(table)
    require(limit <= largest, f"{place}, limit: a number up to {largest:g} is needed, not {limit:g}.")
    low = 0.9 * SMALLEST_SCALE * limit  # 0.9 is a margin for rounded numbers in a file
    for scale in (across_scale, along_scale):
        require(low <= scale <= limit, f"{place}: scales from {low:g} to the limit are needed, not {scale:g}.")
    return TruncatedTails(_read_tail(across_scale, across_freedom), _read_tail(along_scale, along_freedom), limit)


def _read_tail(scale: float, freedom: float) -> StudentT:
    """The tail of numbers in a file, where `_INFINITE_FREEDOM` stands for infinite degrees of freedom."""
    return StudentT(scale, freedom if freedom < _INFINITE_FREEDOM else math.inf)


def format_noise_file(measured: MeasuredNoise, notes: tuple[str, ...] = ()) -> str:
    """Return the text of a noise file, with notes as comments at its head."""
    document = {
        "schema": "apo-bench/noise/2",
        "source": measured.source,
        "missed_rate": _round_digits(measured.missed),
        "outlier_rate": _round_digits(measured.outliers),
        "outlier_farthest_mm": _round_digits(measured.farthest_mm),
        "shift": _format_split(measured.shift_mm, "mm"),
        "turn": _format_split(measured.turn_deg, "deg"),
    }
    return "".join(f"# {note}\n" for note in notes) + format_toml(document)


def _format_split(split: TruncatedTails, unit: str) -> dict[str, float]:
    """The `[shift]` or `[turn]` table of a distribution; the inverse of `_read_split`."""
    return {
        f"limit_{unit}": _round_digits(split.limit),
        f"across_scale_{unit}": _round_digits(split.across.scale),
        "across_degrees_of_freedom": min(_round_digits(split.across.freedom), _INFINITE_FREEDOM),
        f"along_scale_{unit}": _round_digits(split.along.scale),
        "along_degrees_of_freedom": min(_round_digits(split.along.freedom), _INFINITE_FREEDOM),
    }


def _round_digits(x: float) -> float:
    """Round to five significant digits."""
    return float(f"{x:.5g}")
