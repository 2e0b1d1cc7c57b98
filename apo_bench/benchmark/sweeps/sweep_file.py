"""Sweep files: grids as TOML; every complaint names file, key and remedy.

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

from apo_bench.arguments import check_arguments
from apo_bench.benchmark.sweeps.grid import AXES, SHARED, SweepConfig
from apo_bench.errors import InputError, require
from apo_bench.io import JsonNode, read_toml
from apo_bench.records import SETTINGS, in_python

_SEVERAL = (*(info.name for info in AXES), "noise_mm", "noise_deg")
"""Keys that take one value or several."""
_ALONE = {SETTINGS[name].keyword: SETTINGS[name] for name in SHARED}
"""One for the whole sweep: they stand at the top of the file only."""
SWEEP_KEYS = (*_SEVERAL, "trials", "seed")


def is_sweep_file(text: str) -> bool:
    """Whether what was given in place of scenarios is a sweep file: TOML that is no scenario file.

    Raises:
        InputError: It is TOML that cannot be read.
    """
    if not text.lower().endswith(".toml"):
        return False
    keys = read_toml(text, "sweep or scenario file").value
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
    top = read_toml(path, "sweep file").fields(("scenario",), (*SWEEP_KEYS[1:], *_ALONE, *besides, "also"))
    tables = [entry.fields((), SWEEP_KEYS) for entry in _tables(top["also"])] if "also" in top else []
    first = {key: _value(key, node) for key, node in top.items() if key not in ("also", *besides)}
    grids = {str(path): first} | {
        f"{path}, also {i}": first | {key: _value(key, node) for key, node in table.items()}
        for i, table in enumerate(tables, start=1)
    }
    return tuple(_grid(name, {**values, **(overrides or {})}) for name, values in grids.items())


def _tables(node: JsonNode) -> Sequence[JsonNode]:
    require(
        isinstance(node.value, list) and all(isinstance(entry, dict) for entry in node.value),
        f"{node.file}, also: further grids are tables; write [[also]] above the keys of each.",
    )
    return node.items("also")


def _grid(name: str, values: Mapping[str, Any]) -> SweepConfig:
    """The grid of some values, which it checks itself."""
    try:
        return SweepConfig(**in_python(values))
    except InputError as error:
        raise InputError(f"{name}: {error}") from error


def _value(key: str, node: JsonNode) -> Any:
    """The values of a key."""
    if key not in _SEVERAL:
        return node.value if key not in _ALONE or _ALONE[key].is_text else node.number(0.0, above=True)
    if not isinstance(node.value, list):
        return (node.value,)
    return tuple(tuple(entry) if isinstance(entry, list) else entry for entry in node.value)
