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
from functools import partial
from pathlib import Path
from typing import Any

from apo_bench.errors import InputError, require
from apo_bench.io import JsonNode, read_toml
from apo_bench.records import LEVEL, SETTINGS, in_python
from apo_bench.sweeps.grid import AXES, LARGEST_TRIALS, SHARED, SweepSettings

_SEVERAL = {info.axis: info for info in AXES}
"""Keys whose values are lists."""
_COUNTS = {"trials": (1, LARGEST_TRIALS), "seed": SETTINGS["seed"].range}
_ALONE = {SETTINGS[name].keyword: SETTINGS[name] for name in SHARED}
"""One for the whole sweep: they stand at the top of the file only."""
_MOST_ENTRIES = 1000
SWEEP_KEYS = (*_SEVERAL, *_COUNTS)


def is_sweep_file(text: str) -> bool:
    """Whether what was given in place of scenarios is a sweep file: TOML that is no scenario file.

    Raises:
        InputError: It is TOML that cannot be read.
    """
    if not text.lower().endswith(".toml"):
        return False
    keys = read_toml(text, "sweep or scenario file").value
    return "scenarios" in keys or not {"parts", "operations"} & set(keys)


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
    return _few(node.items("also"), node)


def _grid(name: str, values: Mapping[str, Any]) -> SweepSettings:
    try:
        return SweepSettings(**in_python(values))
    except InputError as error:
        raise InputError(f"{name}: {error}") from error


def _value(key: str, node: JsonNode) -> Any:
    if key in _COUNTS:
        return _count(node, *_COUNTS[key])
    if key in _ALONE:
        return node.text() if _ALONE[key].is_text else node.number(0.0, above=True)
    if _SEVERAL[key].is_text:
        return tuple(entry.text() for entry in _entries(node, key, "texts in quotes"))
    low, high = _SEVERAL[key].range
    if _SEVERAL[key].is_whole:
        return tuple(_count(entry, low, high) for entry in _entries(node, key, "whole numbers"))
    read = _level if key == LEVEL.axis else partial(JsonNode.number, low=low, high=high)
    return tuple(read(entry) for entry in _entries(node, key, "numbers"))


def _entries(node: JsonNode, key: str, of: str) -> Sequence[JsonNode]:
    if not isinstance(node.value, list) or not node.value:
        empty = "an empty grid has no trials, so name at least one or leave the key out"
        node.fail(f"a list of {of} is needed", empty if node.value == [] else f"write {key} = [...]")
    return _few(
        [JsonNode(entry, node.file, f"{node.key}, entry {i}") for i, entry in enumerate(node.value, start=1)], node
    )


def _few(entries: Sequence[JsonNode], node: JsonNode) -> Sequence[JsonNode]:
    require(
        len(entries) <= _MOST_ENTRIES,
        f"{node.file}, {node.key}: at most {_MOST_ENTRIES} entries are allowed, {len(entries)} were given.",
    )
    return entries


def _level(node: JsonNode) -> float | tuple[float, float]:
    """A number, or a pair of mm and degrees."""
    if not isinstance(node.value, list):
        return node.number(*LEVEL.range)
    mm, deg = map(float, node.numbers(2))
    return mm, deg


def _count(node: JsonNode, low: int, high: int) -> int:
    if not isinstance(node.value, int) or isinstance(node.value, bool) or not low <= node.value <= high:
        node.fail(f"a whole number from {low} to {high} is needed")
    return int(node.value)
