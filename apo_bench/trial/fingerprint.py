"""Hashes that say whether two rows were made of the same things: files, settings, and the code that shapes a row.

The code is every source file of the package but those of `ROOMS_WITHOUT_TRIALS`.
"""

import hashlib
import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import asdict, fields, is_dataclass
from functools import cache
from importlib.machinery import ModuleSpec
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from apo_bench import __version__
from apo_bench.files.json_forms import OBSERVATION_SCHEMA, PLAN_SCHEMA
from apo_bench.io import read_bytes
from apo_bench.names import admit
from apo_bench.observation.noise_file import noise_path
from apo_bench.records import ROW, TrialSettings
from apo_bench.records.run.replay_command import DATA_PREFIXES, is_own_code
from apo_bench.resources import folder
from apo_bench.scenario import Scenario, scenario_path

_SCHEMAS = (ROW, OBSERVATION_SCHEMA, PLAN_SCHEMA)
ROOMS_WITHOUT_TRIALS = (
    "cad",
    "cli",
    "datasets",
    "drafting",
    "envs",
    "recording",
    "report",
    "scoring",
    "show",
    "statistics",
    "sweeps/local",
    "sweeps/ray",
)
"""Commands, imports that end in files, how work is spread, and all that is made of rows afterwards."""


def content_hash(scenario: Scenario, source: str | Path | Scenario, arm_files: Path | tuple[Path, ...]) -> str:
    """16 hexadecimal digits over all that shapes a trial besides its specification.

    The pieces of `content_pieces`, the code of the package, its version and that of every schema.

    Args:
        source: What `load_scenario` was given.
    """
    content = [content_pieces(scenario, source, arm_files), dict(code_files()), __version__, _SCHEMAS]
    return _hash(json.dumps(content, sort_keys=True).encode())


def content_pieces(
    scenario: Scenario, source: str | Path | Scenario, arm_files: Path | tuple[Path, ...]
) -> dict[str, str]:
    """What a trial of a scenario is made of -> 16 hexadecimal digits.

    The scenario (its file's bytes, or its numbers if it never was a file), the files of its parts, the arm with all
    that it was made of, the room, the judge's thresholds.
    """
    arm = arm_files if isinstance(arm_files, tuple) else (arm_files,)
    pieces = {
        "scenario": _scenario_bytes(scenario, source),
        **{f"part {part}": read_bytes(path, "part file") for part, path in sorted(scenario.part_files.items())},
        "room": (folder("assets") / "room.xml").read_bytes(),
        "arm": b"".join(Path(each).read_bytes() for each in arm),
        "thresholds": json.dumps(asdict(scenario.thresholds), sort_keys=True).encode(),
    }
    return {name: _hash(piece) for name, piece in pieces.items()}


@cache
def code_files() -> Mapping[str, str]:
    """Source file, relative to the package -> 16 hexadecimal digits over its lines; read once per process."""
    return MappingProxyType({path: _hash(text) for path, text in sorted(sources(files("apo_bench"))) if counts(path)})


def counts(path: str) -> bool:
    """Whether a source file of the package shapes rows."""
    return not path.startswith(tuple(f"{room}/" for room in ROOMS_WITHOUT_TRIALS))


def sources(package: Traversable, prefix: str = "") -> Iterator[tuple[str, bytes]]:
    """Every Python file of a package and what stands in it, wherever it is installed.

    Ends of lines are the same everywhere: they are the version control's.
    """
    for entry in package.iterdir():
        if entry.is_dir() and entry.name != "__pycache__":
            yield from sources(entry, f"{prefix}{entry.name}/")
        elif entry.name.endswith(".py"):
            yield prefix + entry.name, entry.read_bytes().replace(b"\r\n", b"\n")


def spec_hash(spec: TrialSettings, content: str, observation: str = "") -> str:
    """16 hexadecimal digits over the content and every setting but method, seed and the scenario's path.

    A noise model that is a file, and noise, relations or an arm of one's own, count by what stands in the file as well;
    a salt counts by its hash.

    Rows with the same hash differ in method and seed alone, so they may be counted together or paired.

    Args:
        content: From `content_hash`.
        observation: The text of the observation's file, when it was not drawn.
    """
    settings = {k: v for k, v in asdict(spec).items() if k not in ("method", "seed", "scenario", "salt")}
    if spec.salt is not None:
        settings["salt"] = spec.salt.hash
    brought = {**noise_content(spec.noise), **own_content("relations", spec.relations), **own_content("arm", spec.arm)}
    return _hash(json.dumps([content, settings, observation, *brought.values()], sort_keys=True).encode())


def noise_content(*names: str) -> dict[str, str]:
    """Of the noise models that are files or of one's own: `noise NAME` -> 16 hexadecimal digits over the file."""
    paths = {f"noise {name}": path for name in names if (path := noise_path(name)) is not None}
    return {name: _hash(read_bytes(path, "noise file")) for name, path in paths.items()} | own_content("noise", *names)


def own_content(kind: str, *names: str) -> dict[str, str]:
    """Of what is given as `module:name`: `KIND NAME` -> 16 hexadecimal digits over the file of the module.

    What that module imports in turn does not count.
    """
    own = [name for name in names if is_own_code(name, DATA_PREFIXES[kind])]
    return {f"{kind} {name}": hashed for name in own if (hashed := _module_hash(name.partition(":")[0])) is not None}


@cache
def _module_hash(module: str) -> str | None:
    """Over the source file of a module as it was when it was first asked for; None if it has none."""
    spec = _located(module)
    path = Path(spec.origin) if spec is not None and spec.has_location and spec.origin else None
    return _hash(path.read_bytes()) if path is not None and path.is_file() else None


def _located(module: str) -> ModuleSpec | None:
    """Where a module would be imported from; nothing is imported, nor are the packages that it is in."""
    admit(module)
    spec = None
    path = None
    for end in range(1, module.count(".") + 2):
        name = ".".join(module.split(".")[:end])
        try:
            specs = (finder.find_spec(name, path) for finder in sys.meta_path)
            spec = next((each for each in specs if each is not None), None)
            path = None if spec is None else spec.submodule_search_locations
        except (ImportError, ValueError, KeyError, AttributeError):
            return None
        if spec is None or (path is None and name != module):
            return None
    return spec


def _hash(text: bytes) -> str:
    return hashlib.sha256(text).hexdigest()[:16]


def _scenario_bytes(scenario: Scenario, source: str | Path | Scenario) -> bytes:
    if isinstance(source, Scenario):
        return json.dumps(_plain(scenario), sort_keys=True).encode()
    return read_bytes(scenario_path(source), "scenario file")


def _plain(value: Any) -> Any:
    """Nested dataclasses, mappings, sets and arrays as what `json` can write; file paths, already hashed, left out."""
    if is_dataclass(value):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Path):
        return None
    if isinstance(value, (frozenset, set)):
        return sorted(value)
    if hasattr(value, "items"):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(v) for v in value]
    return value
