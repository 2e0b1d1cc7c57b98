"""A generated assembly as files: a scenario and its parts, as a person would write them."""

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from apo_bench.io import write_file
from apo_bench.scenario.generated.assembly import GeneratedAssembly
from apo_bench.scenario.generated.laying import Table
from apo_bench.scenario.parts.making import Body, write_part

_DENSITY = 700.0
_FRICTION = (0.8, 0.005, 0.0001)
_SOURCE = "apo_bench.scenario.generated"
_LICENCE = "CC0-1.0"
_GREY = (0.45, 0.47, 0.50)
_COLORS = (
    (0.80, 0.36, 0.27),
    (0.27, 0.53, 0.78),
    (0.91, 0.79, 0.33),
    (0.36, 0.62, 0.42),
    (0.60, 0.62, 0.66),
    (0.62, 0.45, 0.70),
    (0.85, 0.58, 0.30),
)


def write(made: GeneratedAssembly, table: Table, folder: Path, name: str) -> Path:
    """Write the files of an assembly; returns that of the scenario."""
    files = _stems(made.parts)
    for part, stem in files.items():
        if part == stem:
            write_part(
                part, made.parts[part], folder, density=_DENSITY, friction=_FRICTION, source=_SOURCE, licence=_LICENCE
            )
    path = folder / f"{name}.toml"
    write_file(path, "\n".join(_lines(made, table, files)) + "\n")
    return path


def _stems(parts: Mapping[str, Body]) -> Mapping[str, str]:
    """Part -> the first part that is the same body."""
    first: dict[int, str] = {}
    return {name: first.setdefault(id(body), name) for name, body in parts.items()}


def _lines(made: GeneratedAssembly, table: Table, files: Mapping[str, str]) -> Iterable[str]:
    yield from ("schema = 1", f'title = "{made.title}"', 'paper = "generated"', "clearance_mm = 0.25", "gap_mm = 0.1")
    yield from ("", "[parts.table]", 'file = "table"', "fixed = true")
    for k, part in enumerate(made.parts):
        yield from ("", f"[parts.{part}]", f'file = "{files[part]}.xml"')
        color = _GREY if part in made.fixed else _COLORS[k % len(_COLORS)]
        yield f"color = {_list(color)}"
        if part in made.fixed:
            yield from ("fixed = true", "follows_site = true", f"start = {{ at_mm = {_list(made.fixed[part])} }}")
        else:
            yield f"start = {{ at_mm = {_list(table.starts[part])} }}"
    for act in made.acts:
        yield from ("", "[[operations]]", f'move = "{act.part}"')
        if act.carries:
            yield f"carries = {_names(act.carries)}"
        yield f"goal = {{ at_mm = {_list(act.at)} }}"
        yield f"contacts = [{', '.join(map(_names, act.contacts))}]"
        yield f'grasp = {{ at_mm = {_list(act.grasp)}, across = "{act.across}" }}'
        if act.vary_mm:
            varies = (f'{{ along = "{axis}", mm = [{-far:g}, {far:g}] }}' for axis, far in act.vary_mm)
            yield f"vary = [{', '.join(varies)}]"
    yield from ("", "[site]", f"center_mm = {_list(table.center)}", f"spread_mm = {_list(table.spread)}")
    yield f"yaw_deg = [{-table.yaw_deg:g}, {table.yaw_deg:g}]"


def _list(values: Iterable[float]) -> str:
    return "[" + ", ".join(f"{float(np.round(value, 4)) + 0.0:g}" for value in values) + "]"


def _names(words: Iterable[str]) -> str:
    return "[" + ", ".join(f'"{word}"' for word in words) + "]"
