"""Scenario files: a TOML file becomes a checked `Scenario`; every complaint names file, key and remedy.

Lengths in mm, angles in degrees, operations numbered from 1; the file of the scenario `stick_in_tower` shows every key.
"""

import os
from dataclasses import fields, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Assembly, Gap
from apo_bench.errors import require, require_known
from apo_bench.generated import generated_file, is_generated, whole_name
from apo_bench.insertion.arrival import Preference
from apo_bench.io import UNSHOWN, JsonNode, read_toml
from apo_bench.records import MEANINGS, Meaning, Thresholds
from apo_bench.resources import folder
from apo_bench.scenario.checks import check_scenario
from apo_bench.scenario.contacts import LARGEST_LENGTH_MM, read_span, read_unit_axis, refuse_unless
from apo_bench.scenario.entries import OperationEntry, read_operations, read_parts
from apo_bench.scenario.layout import with_attach_lines
from apo_bench.scenario.scenario import Carelessness, Scenario, Shift, Site, Turn

_SCHEMA = 1
_LARGEST_CLEARANCE_MM = 5.0


def scenario_names() -> tuple[str, ...]:
    """The short names of the scenarios that come with the package."""
    return tuple(sorted(path.stem for path in folder("scenarios").glob("*.toml")))


def is_named(given: str) -> bool:
    """Whether something is the name of a scenario that every installation has, so that no file has to travel."""
    return is_generated(given) or given in scenario_names()


@check_arguments
def load_scenario(given: str | Path | Scenario) -> Scenario:
    """The scenario of a short name, `generated:SEED` or `generated:FAMILY:SEED`, of a TOML file anywhere, or the
    object itself.

    Part files in it are short names, or paths relative to the scenario file. Of a short name it is one object for as
    long as the files of the package stay as they are.

    Raises:
        InputError: No such scenario, or the file breaks a rule; one sentence with file, key, what was given, what is
            allowed and what to do.
    """
    if isinstance(given, Scenario):
        return given
    path = scenario_path(given)
    if isinstance(given, str) and is_generated(given):
        return _generated(path, whole_name(given))
    return _kept(path, _stamps()) if path.stem == given else _read(path)


def _stamps() -> tuple[tuple[str, int, int], ...]:
    """Name, time and size of every file that scenarios of the package are made of."""
    folders = (folder("scenarios"), folder("assets") / "parts")
    entries = [(each.path, each.stat(follow_symlinks=False)) for place in folders for each in os.scandir(place)]
    return tuple(sorted((path, stat.st_mtime_ns, stat.st_size) for path, stat in entries))


@lru_cache(maxsize=64)
def _kept(path: Path, stamps: tuple[tuple[str, int, int], ...]) -> Scenario:
    return _read(path)


@lru_cache(maxsize=64)
def _generated(path: Path, name: str) -> Scenario:
    return replace(_read(path, checked=False), name=name)


def _read(path: Path, checked: bool = True) -> Scenario:
    document = read_toml(path, "scenario file")
    require(
        not UNSHOWN.search(path.stem),
        f"{path}: the file's name, which the scenario gets, holds control characters; rename the file.",
    )
    scenario, stated = _scenario(document, path, checked)
    check_scenario(scenario, str(path))
    return with_attach_lines(scenario, stated, str(path))


def scenario_path(given: str | Path) -> Path:
    """The file of a scenario, as `load_scenario` finds it; a generated one is written first."""
    require(
        isinstance(given, str | Path),
        f"a scenario is a short name, a path or a Scenario, a {type(given).__name__} was given.",
    )
    if isinstance(given, str) and is_generated(given):
        return generated_file(given)
    if isinstance(given, Path) or given.endswith(".toml") or "/" in given or "\\" in given:
        return Path(given)
    require_known("scenario", given, scenario_names(), rest=" Or give the path of a .toml file, or generated:SEED.")
    return folder("scenarios") / f"{given}.toml"


def _scenario(root: JsonNode, path: Path, checked: bool) -> tuple[Scenario, tuple[Preference, ...]]:
    """The scenario without lines of attach, and what the file states of them."""
    schema = root.value.get("schema", _SCHEMA)
    root.child(schema, "schema").require(
        schema == _SCHEMA and not isinstance(schema, bool),
        f"schema = {_SCHEMA} is needed",
        "no other format is known to this version",
    )
    top = root.fields(
        ("schema", "title", "parts", "operations"),
        ("paper", "human", "success", "clearance_mm", "gap_mm", "site", "careless", "judge"),
    )
    parts = read_parts(top["parts"], path.parent, checked)
    entries = read_operations(top["operations"], parts)
    assembly = Assembly(
        {name: part.solid for name, part in parts.items()},
        tuple(entry.operation for entry in entries),
        frozenset(name for name, part in parts.items() if part.fixed),
        {contact: gap for entry in entries for contact, gap in entry.gaps.items() if gap != Gap()},
    )
    for name in parts:
        refuse_unless(
            name in assembly.fixed or any(name in operation.moves for operation in assembly.operations),
            top["parts"],
            f"no operation moves '{name}'; give it one, or say fixed = true",
        )
    thresholds, means = _judge(top["judge"]) if "judge" in top else (Thresholds(), MEANINGS[0])
    scenario = Scenario(
        name=path.stem,
        **{key: top[key].text() if key in top else "" for key in ("title", "paper", "human", "success")},
        assembly=assembly,
        part_files={name: part.path for name, part in parts.items()},
        colors={name: part.color for name, part in parts.items() if part.color is not None},
        start={name: part.start for name, part in parts.items()},
        goals=np.array([entry.goal for entry in entries]),
        attach=(),
        grasps=tuple(entry.grasp for entry in entries),
        site=_site(top["site"]) if "site" in top else Site(),
        shifts=tuple(vary for entry in entries for vary in entry.varies if isinstance(vary, Shift)),
        turns=tuple(vary for entry in entries for vary in entry.varies if isinstance(vary, Turn)),
        careless=_careless(top["careless"], entries) if "careless" in top else None,
        thresholds=thresholds,
        success_means=means,
        clearance_mm=_number(top["clearance_mm"], _LARGEST_CLEARANCE_MM) if "clearance_mm" in top else 0.25,
        gap_mm=_number(top["gap_mm"], _LARGEST_CLEARANCE_MM, above=True) if "gap_mm" in top else 0.1,
        follows_site=frozenset(name for name, part in parts.items() if part.follows_site),
    )
    return scenario, tuple(entry.attach for entry in entries)


def _site(node: JsonNode) -> Site:
    keys = node.fields((), ("center_mm", "spread_mm", "yaw_deg"))
    center = _pair(keys["center_mm"], -LARGEST_LENGTH_MM) if "center_mm" in keys else (0.0, 0.0)
    spread = _pair(keys["spread_mm"], 0.0) if "spread_mm" in keys else (0.0, 0.0)
    yaw = read_span(keys["yaw_deg"], -360.0, 360.0) if "yaw_deg" in keys else (0.0, 0.0)
    return Site(
        (1e-3 * center[0], 1e-3 * center[1]),
        (1e-3 * spread[0], 1e-3 * spread[1]),
        (float(np.radians(yaw[0])), float(np.radians(yaw[1]))),
    )


def _pair(node: JsonNode, low: float) -> tuple[float, float]:
    x, y = node.numbers(2)
    node.require(
        low <= min(x, y) and max(x, y) <= LARGEST_LENGTH_MM,
        f"two lengths from {low:g} to {LARGEST_LENGTH_MM:g} mm are needed",
    )
    return float(x), float(y)


def _careless(node: JsonNode, entries: tuple[OperationEntry, ...]) -> Carelessness:
    keys = node.fields(("operation", "along", "size_mm"))
    number = keys["operation"].integer()
    keys["operation"].require(1 <= number <= len(entries), f"an operation from 1 to {len(entries)} is needed")
    axis = read_unit_axis(keys["along"])
    keys["along"].require(
        abs((entries[number - 1].goal[:3, :3] @ axis)[2]) <= 1e-6,
        "a direction that is level at the goal is needed",
        "what lies below decides the height",
    )
    low, high = read_span(keys["size_mm"], 0.0, 100.0)
    return Carelessness(number - 1, axis, 1e-3 * low, 1e-3 * high)


def _judge(node: JsonNode) -> tuple[Thresholds, Meaning]:
    keys = dict(node.fields((), ("success", *(field.name for field in fields(Thresholds)))))
    means = keys.pop("success", None)
    if means is not None and means.value not in MEANINGS:
        means.fail(f"{' or '.join(MEANINGS)} is needed")
    largest = {"overlap_fraction": 1.0, "loose_angle_deg": 180.0}
    thresholds = Thresholds(**{key: _number(value, largest.get(key, 1e4)) for key, value in keys.items()})
    return thresholds, MEANINGS[0] if means is None else means.value


def _number(node: JsonNode, high: float, *, above: bool = False) -> float:
    x = node.number(0.0, above=above)
    node.require(x <= high, f"a number of at most {high:g} is needed")
    return x
