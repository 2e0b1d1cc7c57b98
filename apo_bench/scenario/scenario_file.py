"""Load scenarios by name or from a TOML file.

Lengths in mm, angles in degrees, operations numbered from 1; the file of the scenario `stick_in_tower` shows every key.
"""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import msgspec
import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Assembly, Gap
from apo_bench.errors import require, require_known
from apo_bench.io import UNSHOWN, convert_typed, read_typed
from apo_bench.planning.insertion.attach_line import Preference
from apo_bench.records import Thresholds
from apo_bench.resources import folder
from apo_bench.scenario.attach_lines import add_attach_lines
from apo_bench.scenario.generated import complete_name, is_generated, make_generated_file
from apo_bench.scenario.layout_checks import check_layouts
from apo_bench.scenario.part_and_operation_entries import OperationEntry, read_operations, read_parts
from apo_bench.scenario.scenario import HumanError, Scenario, Shift, Site, Turn
from apo_bench.scenario.tables import HumanErrorTable, JudgeTable, ScenarioTable, SiteTable
from apo_bench.scenario.values import check_span, normalize_axis


def list_scenario_names() -> tuple[str, ...]:
    """The names of the scenarios in the package, sorted."""
    return tuple(sorted(path.stem for path in folder("scenarios").glob("*.toml")))


def is_named(given: str) -> bool:
    """True if `given` names a scenario of the package or a generated one, which every installation has."""
    return is_generated(given) or given in list_scenario_names()


@check_arguments
def load_scenario(given: str | Path | Scenario) -> Scenario:
    """Load a scenario.

    Args:
        given: A short name (`apo-bench scenario list`), `generated:SEED`, `generated:FAMILY:SEED`, a TOML file, or a
            `Scenario`, which is returned. Part files are short names, or paths relative to the scenario file.

    Raises:
        InputError: There is no such scenario, or the file breaks a rule; the sentence names file, key and remedy.

    Examples:
        >>> import apo_bench
        >>> apo_bench.load_scenario("stick_in_tower").clearance_mm
        0.25
    """
    if isinstance(given, Scenario):
        return given
    if isinstance(given, str) and is_named(given):
        return _load_named(complete_name(given) if is_generated(given) else given)
    return _read_file(find_scenario_path(given))


@lru_cache(maxsize=128)
def _load_named(name: str) -> Scenario:
    """Load a scenario of the package or a generated one; part files of the latter need no check."""
    return replace(_read_file(find_scenario_path(name), checked=not is_generated(name)), name=name)


def _read_file(path: Path, checked: bool = True) -> Scenario:
    """Read and check a scenario file; `checked` as in `load_part`."""
    document = read_typed(path, ScenarioTable, "scenario file")
    require(
        not UNSHOWN.search(path.stem),
        f"{path}: the file's name, which the scenario gets, holds control characters; rename the file.",
    )
    scenario, stated = _build_scenario(document, path, checked)
    check_layouts(scenario, str(path))
    return add_attach_lines(scenario, stated, str(path))


def find_scenario_path(given: str | Path) -> Path:
    """The path of a scenario file; a generated scenario is written first."""
    if is_generated(given):
        return make_generated_file(str(given))
    if isinstance(given, Path) or given.endswith(".toml") or "/" in given or "\\" in given:
        return Path(given)
    require_known(
        "scenario", given, list_scenario_names(), rest=" Or give the path of a .toml file, or generated:SEED."
    )
    return folder("scenarios") / f"{given}.toml"


def _build_scenario(top: ScenarioTable, path: Path, checked: bool) -> tuple[Scenario, tuple[Preference, ...]]:
    """The scenario without insertion axes, and the preferences for them that the file states per operation."""
    parts = read_parts(top.parts, path, checked)
    entries = read_operations(top.operations, path, parts)
    assembly = Assembly(
        {name: part.solid for name, part in parts.items()},
        tuple(entry.operation for entry in entries),
        frozenset(name for name, part in parts.items() if part.table.fixed),
        {contact: gap for entry in entries for contact, gap in entry.gaps.items() if gap != Gap()},
    )
    moved = {part for operation in assembly.operations for part in operation.moves}
    for name in parts:
        require(
            name in assembly.fixed | moved, f"{path}, parts: no operation moves '{name}'; give it one, or say fixed."
        )
    judge = msgspec.structs.asdict(convert_typed(top.judge, JudgeTable, f"{path}, judge"))
    success_means = judge.pop("success")
    scenario = Scenario(
        name=path.stem,
        title=top.title,
        paper=top.paper,
        human=top.human,
        success=top.success,
        assembly=assembly,
        part_files={name: part.path for name, part in parts.items()},
        colors={name: part.table.color for name, part in parts.items() if part.table.color is not None},
        start={name: part.start for name, part in parts.items()},
        nominal_poses=np.array([entry.goal for entry in entries]),
        attach=(),
        grasps=tuple(entry.grasp for entry in entries),
        site=_read_site(top.site, f"{path}, site"),
        shifts=tuple(vary for entry in entries for vary in entry.varies if isinstance(vary, Shift)),
        turns=tuple(vary for entry in entries for vary in entry.varies if isinstance(vary, Turn)),
        human_error=None
        if top.human_error is None
        else _read_human_error(top.human_error, f"{path}, human_error", entries),
        thresholds=Thresholds(**judge),
        success_means=success_means,
        clearance_mm=top.clearance_mm,
        gap_mm=top.gap_mm,
        follows_site=frozenset(name for name, part in parts.items() if part.table.follows_site),
        source=path,
    )
    return scenario, tuple(entry.attach for entry in entries)


def _read_site(table: SiteTable, place: str) -> Site:
    """The site of a `[site]` table, in m and radians."""
    x, y = table.center_mm
    wide, deep = table.spread_mm
    low, high = np.radians(check_span(table.yaw_deg, f"{place}, yaw_deg"))
    return Site((1e-3 * x, 1e-3 * y), (1e-3 * wide, 1e-3 * deep), (float(low), float(high)))


def _read_human_error(table: HumanErrorTable, place: str, entries: tuple[OperationEntry, ...]) -> HumanError:
    """The human error of a `[human_error]` table; its direction must be horizontal at the goal."""
    known = 1 <= table.operation <= len(entries)
    require(known, f"{place}, operation: an operation from 1 to {len(entries)} is needed, {table.operation} was given.")
    axis = normalize_axis(table.along, f"{place}, along")
    level = abs((entries[table.operation - 1].goal[:3, :3] @ axis)[2]) <= 1e-6
    require(level, f"{place}, along: a direction that is level at the goal is needed.")
    low, high = check_span(table.size_mm, f"{place}, size_mm")
    return HumanError(table.operation - 1, axis, 1e-3 * low, 1e-3 * high)
