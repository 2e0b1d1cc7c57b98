"""Read sweep files: grids of settings as TOML.

    scenario = ["stick_in_tower", "carried_bridge"]
    noise_level = [0.5, 1, 2]
    method = ["uncorrected", "paper", "contact"]
    trials = 40

    [[also]]                  # a further grid; keys that it lacks are as above
    method = ["oracle"]
    noise_level = [0]

Lengths are in mm, angles in degrees. Paths are relative to the current folder, as on the command line.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
from msgspec import UNSET

from apo_bench.arguments import check_arguments
from apo_bench.benchmark.sweeps.grid import AXES, SHARED, SweepConfig, convert_to_tuple
from apo_bench.errors import InputError
from apo_bench.io import FileTable, Positive, convert_typed, read_plain
from apo_bench.records import SETTINGS, convert_to_python_units

_SEVERAL = (*(info.name for info in AXES), "noise_mm", "noise_deg")
"""Keys that take one value or several."""
_ALONE = {SETTINGS[name].keyword: SETTINGS[name] for name in SHARED}
"""Key -> setting that the whole sweep shares; these keys stand at the top of the file only."""
SWEEP_KEYS = (*_SEVERAL, "trials", "seed", "independent_seeds")
_VALUES = [(key, Any, UNSET) for key in SWEEP_KEYS]  # every key is optional
AlsoTable = msgspec.defstruct("AlsoTable", _VALUES, bases=(FileTable,), kw_only=True)
"""The table `[[also]]`: a further grid."""
SweepTable = msgspec.defstruct(
    "SweepTable",
    [
        *(("scenario", Any) if key == "scenario" else value for key, value in zip(SWEEP_KEYS, _VALUES, strict=True)),
        *((key, Any if info.is_text else Positive, UNSET) for key, info in _ALONE.items()),
        ("also", list[AlsoTable], []),  # type: ignore[valid-type]
    ],
    bases=(FileTable,),
    kw_only=True,
)
"""The whole file."""


def is_sweep_file(text: str) -> bool:
    """Return whether an argument is a sweep file: a TOML file that is no scenario file.

    Raises:
        InputError: It is a TOML file that cannot be read.
    """
    if not text.lower().endswith(".toml"):
        return False
    keys = read_plain(text, "sweep or scenario file")
    return "scenario" in keys or not {"parts", "operations"} & set(keys)


@check_arguments
def read_sweep(
    path: str | Path, overrides: Mapping[str, Any] | None = None, besides: Sequence[str] = ()
) -> tuple[SweepConfig, ...]:
    """Read the grids of a sweep file: the top one, and one for each `[[also]]`.

    Args:
        overrides: Key -> value that replaces the one of the file in every grid.
        besides: Keys of the file that the caller reads itself.

    Raises:
        InputError: The file is invalid.
    """
    keys = {key: value for key, value in read_plain(path, "sweep file").items() if key not in besides}
    top: Any = convert_typed(keys, SweepTable, str(path))
    first = _read_values(top)
    grids = {str(path): first}
    for i, table in enumerate(top.also, start=1):
        grids[f"{path}, also {i}"] = first | _read_values(table)  # missing keys are those of the first grid
    return tuple(_make_grid(name, {**values, **(overrides or {})}) for name, values in grids.items())


def _make_grid(name: str, values: Mapping[str, Any]) -> SweepConfig:
    """Make a grid from its values; errors name the place in the file."""
    try:
        return SweepConfig(**convert_to_python_units(values))
    except InputError as error:
        raise InputError(f"{name}: {error}") from error


def _read_values(table: msgspec.Struct) -> dict[str, Any]:
    """Return the keys that a table states, with their values."""
    stated = {key: value for key, value in msgspec.structs.asdict(table).items() if value is not UNSET}
    return {
        key: convert_to_tuple(value) if key in _SEVERAL else value for key, value in stated.items() if key != "also"
    }
