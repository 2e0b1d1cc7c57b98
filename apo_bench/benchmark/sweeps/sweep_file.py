"""Sweep files: grids of settings as TOML.

    scenario = ["stick_in_tower", "carried_bridge"]
    noise_level = [0.5, 1, 2]
    method = ["uncorrected", "paper", "contact"]
    trials = 40

    [[also]]                  # a further grid: keys that it does not have are as above
    method = ["oracle"]
    noise_level = [0]

Lengths in mm, angles in degrees; paths as on the command line, from the current folder.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
from msgspec import UNSET

from apo_bench.arguments import check_arguments
from apo_bench.benchmark.sweeps.grid import AXES, SHARED, SweepConfig, as_tuple
from apo_bench.errors import InputError
from apo_bench.io import FileTable, Positive, convert_typed, read_plain
from apo_bench.records import SETTINGS, convert_to_python_units

_SEVERAL = (*(info.name for info in AXES), "noise_mm", "noise_deg")
"""Keys that take one value or several."""
_ALONE = {SETTINGS[name].keyword: SETTINGS[name] for name in SHARED}
"""One for the whole sweep: they stand at the top of the file only."""
SWEEP_KEYS = (*_SEVERAL, "trials", "seed")
_VALUES = [(key, Any, UNSET) for key in SWEEP_KEYS]
AlsoTable = msgspec.defstruct("AlsoTable", _VALUES, bases=(FileTable,), kw_only=True)
"""`[[also]]`: a further grid."""
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
"""A whole file."""


def is_sweep_file(text: str) -> bool:
    """Whether what was given in place of scenarios is a sweep file: TOML that is no scenario file.

    Raises:
        InputError: It is TOML that cannot be read.
    """
    if not text.lower().endswith(".toml"):
        return False
    keys = read_plain(text, "sweep or scenario file")
    return "scenario" in keys or not {"parts", "operations"} & set(keys)


@check_arguments
def read_sweep(
    path: str | Path, overrides: Mapping[str, Any] | None = None, besides: Sequence[str] = ()
) -> tuple[SweepConfig, ...]:
    """The grids of a sweep file: the top one, and one for each `[[also]]`.

    Args:
        overrides: Key of the file -> what to take instead, in every grid.
        besides: Keys of the file that are read elsewhere.

    Raises:
        InputError: Anything in the file that is not as described.
    """
    keys = {key: value for key, value in read_plain(path, "sweep file").items() if key not in besides}
    top: Any = convert_typed(keys, SweepTable, str(path))
    first = _values(top)
    grids = {str(path): first}
    for i, table in enumerate(top.also, start=1):
        grids[f"{path}, also {i}"] = first | _values(table)
    return tuple(_grid(name, {**values, **(overrides or {})}) for name, values in grids.items())


def _grid(name: str, values: Mapping[str, Any]) -> SweepConfig:
    """The grid of some values, which it checks itself."""
    try:
        return SweepConfig(**convert_to_python_units(values))
    except InputError as error:
        raise InputError(f"{name}: {error}") from error


def _values(table: msgspec.Struct) -> dict[str, Any]:
    """The values of the keys that a table has."""
    stated = {key: value for key, value in msgspec.structs.asdict(table).items() if value is not UNSET}
    return {key: as_tuple(value) if key in _SEVERAL else value for key, value in stated.items() if key != "also"}
