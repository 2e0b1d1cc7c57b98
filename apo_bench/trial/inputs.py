"""The files that shape a trial, and their digests: what a record's identity is made of.

Python modules of the user count with the modules that they import from the same place, as far as their source names
them. Data that such a module reads for itself does not count.
"""

import ast
import hashlib
import json
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, fields, is_dataclass
from functools import cache
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.io import opened
from apo_bench.names import find_own_module
from apo_bench.perception.observation.noise_file import noise_path
from apo_bench.records.run.replay_command import DATA_PREFIXES, is_own_code
from apo_bench.resources import folder
from apo_bench.scenario import Scenario, scenario_path
from apo_bench.scenario.parts import part_files_of

_CHUNK = 1 << 20


def content_pieces(
    scenario: Scenario, source: str | Path | Scenario, arm_files: Path | tuple[Path, ...]
) -> dict[str, str]:
    """What a trial of a scenario is made of -> 16 hexadecimal digits.

    The scenario (its file, or its numbers if it never was a file), each part with the files that state and draw it, the
    arm with all that it was made of, the room, what networks have learned, the judge's thresholds.

    Args:
        source: What `load_scenario` was given.
        arm_files: `Arm.files`.
    """
    thresholds = json.dumps(asdict(scenario.thresholds), sort_keys=True).encode()
    files = {
        **{f"part {part}": part_files_of(path) for part, path in sorted(scenario.part_files.items())},
        "room": (folder("assets") / "room.xml",),
        "arm": arm_files if isinstance(arm_files, tuple) else (arm_files,),
        "learned weights": tuple(sorted((folder("assets") / "learned").glob("*.npz"))),
    }
    return {
        "scenario": _scenario_digest(scenario, source),
        **{name: digest_files(paths) for name, paths in files.items()},
        "thresholds": digest(thresholds),
    }


def noise_content(*names: str) -> dict[str, str]:
    """Of the noise models that are files or of one's own: `noise NAME` -> 16 hexadecimal digits over the file."""
    paths = {f"noise {name}": path for name in names if (path := noise_path(name)) is not None}
    return {name: digest_files([path]) for name, path in paths.items()} | own_content("noise", *names)


def own_content(kind: str, *names: str) -> dict[str, str]:
    """Of what is given as `module:name`: `KIND NAME` -> 16 hexadecimal digits over the files of the module."""
    own = [name for name in names if is_own_code(name, DATA_PREFIXES[kind])]
    digests = {f"{kind} {name}": _module_digest(name.partition(":")[0]) for name in own}
    return {name: found for name, found in digests.items() if found is not None}


def own_files(name: str) -> tuple[Path, ...]:
    """The files of what is given as `module:name`; none of any other name."""
    data = tuple(prefix for prefixes in DATA_PREFIXES.values() for prefix in prefixes)
    return module_files(name.partition(":")[0]) if is_own_code(name, data) else ()


def digest_files(paths: Iterable[Path]) -> str:
    """16 hexadecimal digits over what stands in files, in their order.

    Raises:
        InputError: One of them cannot be read.
    """
    found = []
    for path in paths:
        with opened(path, "input file") as file:
            whole = hashlib.sha256()
            while chunk := file.read(_CHUNK):
                whole.update(chunk)
        found.append(whole.digest())
    return digest(b"".join(found))


def digest(content: bytes) -> str:
    """16 hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()[:16]


@cache
def _module_digest(module: str) -> str | None:
    """Over the source files of a module as they were when it was first asked for; None if it has none."""
    files = module_files(module)
    return digest_files(files) if files else None


def module_files(module: str) -> tuple[Path, ...]:
    """The source files of a module and of what it imports from where it is; nothing is imported.

    Of a module that is installed among other packages, only its own package is looked through.
    """
    spec = _located(module)
    origin = Path(spec.origin) if spec is not None and spec.has_location and spec.origin else None
    if spec is None or origin is None or not origin.is_file():
        return ()
    home = origin.parents[module.count(".") + (spec.submodule_search_locations is not None)]
    top = module.partition(".")[0] if home in _site_folders() else ""
    files = {origin: None}
    todo = [origin, *_files_of(home, tuple(module.split(".")))]
    while todo:
        file = todo.pop()
        files[file] = None
        for name in _imports(file, home):
            if name[0] == top or not top:
                todo += [each for each in _files_of(home, name) if each not in files]
    return tuple(sorted(files))


def _site_folders() -> set[Path]:
    return {Path(sysconfig.get_path(name)) for name in ("purelib", "platlib", "stdlib")}


def _files_of(home: Path, name: tuple[str, ...]) -> Iterator[Path]:
    """The files that importing a module runs, of those below a folder."""
    if name[0] == "apo_bench":
        return
    for end in range(1, len(name) + 1):
        place = home.joinpath(*name[:end])
        yield from (each for each in (place.with_suffix(".py"), place / "__init__.py") if each.is_file())


def _imports(file: Path, home: Path) -> Iterator[tuple[str, ...]]:
    """The names of all modules that a source file imports anywhere in it, and of what may be one."""
    try:
        nodes = list(ast.walk(ast.parse(file.read_bytes())))
    except (SyntaxError, ValueError):
        return
    package = file.relative_to(home).parent.parts
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (tuple(alias.name.split(".")) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) + 1 - node.level] if node.level else ()
            base = (*base, *(node.module.split(".") if node.module else ()))
            yield from ((*base, alias.name) for alias in node.names)


def _located(module: str) -> ModuleSpec | None:
    """Where a module would be imported from; nothing is imported, nor are the packages that it is in."""
    spec = None
    path = None
    for end in range(1, module.count(".") + 2):
        name = ".".join(module.split(".")[:end])
        try:
            specs = (finder.find_spec(name, path) for finder in sys.meta_path)
            spec = next((each for each in specs if each is not None), None)
            if spec is None and path is None:
                spec = find_own_module(name)
            path = None if spec is None else spec.submodule_search_locations
        except (ImportError, ValueError, KeyError, AttributeError):
            return None
        if spec is None or (path is None and name != module):
            return None
    return spec


def _scenario_digest(scenario: Scenario, source: str | Path | Scenario) -> str:
    if isinstance(source, Scenario):
        return digest(json.dumps(_plain(scenario), sort_keys=True).encode())
    return digest_files([scenario_path(source)])


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
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(v) for v in value]
    return value
