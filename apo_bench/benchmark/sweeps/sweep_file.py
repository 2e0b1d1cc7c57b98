"""Sweep files: grids as TOML; every complaint names file, key and remedy.

    scenarios = ["stick_in_tower", "carried_bridge"]
    levels = [0.5, 1, 2]
    methods = ["none", "paper", "contact"]
    trials = 40

    [[also]]                  # a further grid: what it does not say is as above
    methods = ["oracle"]
    levels = [0]

Lengths in mm, angles in degrees; paths as on the command line, from the current folder.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from apo_bench.arguments import check_arguments
from apo_bench.benchmark.sweeps.grid import AXES, SHARED, SweepSettings
from apo_bench.errors import InputError, require
from apo_bench.io import JsonNode, read_toml
from apo_bench.records import SETTINGS, in_python

_SEVERAL = {info.axis: info for info in AXES}
"""Keys whose values are lists."""
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
    return "scenarios" in keys or not {"parts", "operations"} & set(keys)


@check_arguments
def read_sweep(
    path: str | Path, overrides: Mapping[str, Any] | None = None, besides: Sequence[str] = ()
) -> tuple[SweepSettings, ...]:
    """The grids of a sweep file: the top one, and one for each `[[also]]`.

    Args:
        overrides: Key of the file -> what to take instead, in every grid.
        besides: Keys of the file that are read elsewhere.

    Raises:
        InputError: Anything in the file that is not as described.
    """
    top = read_toml(path, "sweep file").fields(("scenarios",), (*SWEEP_KEYS[1:], *_ALONE, *besides, "also"))
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


def _grid(name: str, values: Mapping[str, Any]) -> SweepSettings:
    """The grid of some values, which it checks itself."""
    try:
        return SweepSettings(**in_python(values))
    except InputError as error:
        raise InputError(f"{name}: {error}") from error


def _value(key: str, node: JsonNode) -> Any:
    """What stands behind a key: a list of values, or one."""
    if key not in _SEVERAL:
        return node.value if key not in _ALONE or _ALONE[key].is_text else node.number(0.0, above=True)
    if isinstance(node.value, str):
        return (node.value,)
    if not isinstance(node.value, list):
        node.fail("a list is needed", f"write {key} = [...]")
    return tuple(tuple(entry) if isinstance(entry, list) else entry for entry in node.value)
