"""The card of a data set, for people and for programs: every field with its unit and frame, the licence, every file.

One episode as learners take it, and what is known of all of a data set.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, final

from apo_bench import __version__
from apo_bench.geometry import Array
from apo_bench.io import write_file

FPS = 20
"""Frames, and actions, a second of simulated time."""


class Field(NamedTuple):
    """A row of numbers of every frame."""

    names: tuple[str, ...]
    unit: str
    frame: str
    """In which coordinates."""
    meaning: str
    most: float | tuple[float, ...] = math.inf
    """No number is larger, nor its negative."""


@final
@dataclass(frozen=True, eq=False)
class Rollout:
    """One episode of T actions."""

    seed: int
    """The number of its trial."""
    task: str
    """In words."""
    observations: Mapping[str, Array]
    """Field -> (T + 1, k), before the first action and after each."""
    actions: Array
    """(T, k)."""
    rewards: Array
    """(T,)."""
    more: Mapping[str, Any]
    """Column of the table of episodes -> what it says of this one; `success` is among them."""


@final
@dataclass(frozen=True, eq=False)
class About:
    """What is known of all episodes."""

    name: str
    """`replays` or `insertions`."""
    summary: str
    command: str
    """What made them."""
    fields: Mapping[str, Field]
    """Of the observations."""
    action: Field
    episodes: Mapping[str, str]
    """Column of the table of episodes -> what it is."""
    robot: str
    env_spec: str | None = None
    """Of the environment, as Gymnasium writes it."""


LICENCE = "Apache-2.0"
_TYPES = {".parquet": "application/x-parquet", ".json": "application/json", ".hdf5": "application/x-hdf5"}
_CROISSANT = "http://mlcommons.org/croissant/"
_WORDS = (
    *("citeAs", "column", "equivalentProperty", "extract", "field", "fileObject", "fileProperty", "fileSet", "format"),
    *("includes", "isLiveDataset", "jsonPath", "key", "md5", "parentField", "path", "recordSet", "references", "regex"),
    *("repeated", "replace", "samplingRate", "separator", "source", "subField", "transform"),
)
"""What Croissant 1.0 adds to schema.org, as far as its readers ask for it."""
_DATA_TYPES = {"string": "sc:Text", "bool": "sc:Boolean", "int": "sc:Integer"}


def noise_sheet(about: About, out: Path, counted: tuple[int, int], tables: Mapping[str, Mapping[str, Any]]) -> None:
    """Write `README.md`, and the same for programs: `croissant.json` (Croissant 1.0), with the hash of every file.

    Args:
        counted: How many episodes there are, and how many of them are right.
        tables: Files, as a pattern -> column -> a `Field`, or in words what it is.
    """
    summary = f"{counted[0]} simulated trials, {counted[1]} of them right, made by apo_bench {__version__} with MuJoCo"
    lerobot = "LeRobot, " if any(pattern.startswith("meta/") for pattern in tables) else ""
    lines = [
        *("---", "license: apache-2.0", "task_categories: [robotics]", f"tags: [{lerobot}assembly, simulation]"),
        *(f"configs: [{{config_name: {name}, data_files: '{name}'}}]" for name in [*tables][:1] if "parquet" in name),
        "---",
        *("# Assemblies that a robot repeats", "", f"{summary}:", "", f"    {about.command}", "", about.summary, ""),
        f"Nothing was measured on a real robot. `seed` is the number of a trial. There are {FPS} frames in a second of",
        f"simulated time. The robot is `{about.robot}`.",
        *("", f"Licence: {LICENCE}, as that of apo_bench."),
    ]
    for title, columns in tables.items():
        lines += ["", f"## {title}", "", "| column | size | unit | frame | what it is |", "|---|---|---|---|---|"]
        lines += [f"| `{name}` | {' | '.join(_cells(column))} |" for name, column in columns.items()]
        several = {name: c.names for name, c in columns.items() if isinstance(c, Field) and len(c.names) > 1}
        lines += ["", *(f"Numbers of `{name}`: {', '.join(names)}." for name, names in several.items())]
    files = sorted(path for path in out.rglob("*") if path.suffix in _TYPES)
    write_file(out / "README.md", "\n".join(lines) + "\n")
    croissant = _croissant(about, out, files, f"{summary}. {about.summary}", tables)
    write_file(out / "croissant.json", json.dumps(croissant, indent=1))


def _cells(column: Field | str) -> tuple[str, ...]:
    if isinstance(column, str):
        return ("", "", "", column)
    return (str(len(column.names) or ""), column.unit, column.frame, column.meaning)


def _croissant(about: About, out: Path, files: list[Path], summary: str, tables: Mapping[str, Any]) -> dict[str, Any]:
    """The same as JSON-LD; columns of Parquet files are named one by one."""
    distribution = [
        {
            "@type": "cr:FileObject",
            "@id": path.relative_to(out).as_posix(),
            "name": path.relative_to(out).as_posix(),
            "contentUrl": path.relative_to(out).as_posix(),
            "encodingFormat": _TYPES[path.suffix],
            "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        }
        for path in files
    ]
    records = []
    for pattern, columns in tables.items():
        first = min(out.glob(pattern), default=None)
        if first is None:
            continue
        name = pattern.removesuffix(".parquet").rstrip("/*")
        from pyarrow import parquet

        schema = parquet.read_schema(first)
        distribution.append(
            {
                "@type": "cr:FileSet",
                "@id": name,
                "name": name,
                "encodingFormat": _TYPES[".parquet"],
                "includes": pattern,
            }
        )
        fields = [
            {
                "@type": "cr:Field",
                "@id": f"{name}/{column}",
                "name": column,
                "description": "; ".join(filter(None, _cells(each)[1:])),
                "dataType": _data_type(schema.field(column).type),
                "repeated": hasattr(schema.field(column).type, "value_type"),
                "source": {"fileSet": {"@id": name}, "extract": {"column": column}},
            }
            for column, each in columns.items()
        ]
        records.append({"@type": "cr:RecordSet", "@id": f"records/{name}", "name": name, "field": fields})
    return {
        "@context": {
            "@language": "en",
            "@vocab": "https://schema.org/",
            "sc": "https://schema.org/",
            "cr": _CROISSANT,
            "rai": f"{_CROISSANT}RAI/",
            "dct": "http://purl.org/dc/terms/",
            "conformsTo": "dct:conformsTo",
            "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
            **{name: {"@id": f"cr:{name}", "@type": "@json"} for name in ("data", "examples")},
            **{name: f"cr:{name}" for name in _WORDS},
        },
        "@type": "sc:Dataset",
        "conformsTo": f"{_CROISSANT}1.0",
        "name": f"apo_bench_{about.name}",
        "description": summary,
        "license": f"https://spdx.org/licenses/{LICENCE}",
        "creator": {"@type": "sc:Organization", "name": "The apo_bench authors"},
        "version": __version__,
        "distribution": distribution,
        "recordSet": records,
    }


def _data_type(kind: Any) -> str:
    """What schema.org calls a type of Arrow, of a list its entries."""
    name = str(getattr(kind, "value_type", kind))
    return next((told for begins, told in _DATA_TYPES.items() if name.startswith(begins)), "sc:Float")
