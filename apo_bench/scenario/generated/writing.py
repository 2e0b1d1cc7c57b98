"""Write a generated assembly as scenario and part files."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.io import format_toml, write_file
from apo_bench.scenario.generated.assembly import DrawnOperation, GeneratedAssembly
from apo_bench.scenario.generated.table_layout import TableLayout
from apo_bench.scenario.parts.making import Body, write_part

_DENSITY = 700.0
"""[kg/m^3]."""
_FRICTION = (0.8, 0.005, 0.0001)
"""Sliding, torsional, rolling."""
_SOURCE = "apo_bench.scenario.generated"
_LICENCE = "CC0-1.0"
_GREY = (0.45, 0.47, 0.50)
"""Colour of fixed parts."""
_COLORS = (
    (0.80, 0.36, 0.27),
    (0.27, 0.53, 0.78),
    (0.91, 0.79, 0.33),
    (0.36, 0.62, 0.42),
    (0.60, 0.62, 0.66),
    (0.62, 0.45, 0.70),
    (0.85, 0.58, 0.30),
)


def write_assembly(made: GeneratedAssembly, table: TableLayout, folder: Path, name: str) -> Path:
    """Write the part files and the scenario file of an assembly; return the path of the scenario file."""
    files = _list_file_names(made.parts)
    for part, stem in files.items():
        if part == stem:
            write_part(
                part, made.parts[part], folder, density=_DENSITY, friction=_FRICTION, source=_SOURCE, licence=_LICENCE
            )
    path = folder / f"{name}.toml"
    write_file(path, format_toml(_make_document(made, table, files)))
    return path


def _list_file_names(parts: Mapping[str, Body]) -> Mapping[str, str]:
    """Part -> name of its part file, which is the first part with the same body."""
    first: dict[int, str] = {}
    return {name: first.setdefault(id(body), name) for name, body in parts.items()}


def _make_document(made: GeneratedAssembly, table: TableLayout, files: Mapping[str, str]) -> dict[str, Any]:
    """The content of the scenario file; `files` is the result of `_list_file_names`."""
    parts: dict[str, Any] = {"table": {"file": "table", "fixed": True}}
    for k, part in enumerate(made.parts):
        is_fixed = part in made.fixed
        parts[part] = {
            "file": f"{files[part]}.xml",
            "color": _GREY if is_fixed else _COLORS[k % len(_COLORS)],
            "fixed": is_fixed,
            "follows_site": is_fixed,
            "start": {"at_mm": _round_lengths((made.fixed if is_fixed else table.starts)[part])},
        }
    return {
        "schema": 1,
        "title": made.title,
        "paper": "generated",
        "clearance_mm": 0.25,
        "gap_mm": 0.1,
        "parts": parts,
        "operations": [_make_operation_entry(act) for act in made.acts],
        "site": {
            "center_mm": _round_lengths(table.center),
            "spread_mm": _round_lengths(table.spread),
            "yaw_deg": [-table.yaw_deg, table.yaw_deg],
        },
    }


def _make_operation_entry(act: DrawnOperation) -> dict[str, Any]:
    """The entry of `[[operations]]`."""
    return {
        "move": act.part,
        "carries": act.carries,
        "contacts": act.contacts,
        "goal": {"at_mm": _round_lengths(act.at)},
        "grasp": {"at_mm": _round_lengths(act.grasp), "across": act.across},
        "vary": [{"along": axis, "mm": [-far, far]} for axis, far in act.vary_mm],
    }


def _round_lengths(values: Iterable[float]) -> list[float]:
    """Return lengths rounded to 0.0001 mm and to six digits."""
    return [float(f"{float(np.round(value, 4)) + 0.0:g}") for value in values]
