"""The files that determine a trial, and their digests, which identify a record.

Python plugins of the user count with the modules that they import from the same folder, as far as their source names
them. Data files that a plugin reads do not count.
"""

import hashlib
import json
import sysconfig
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, fields, is_dataclass
from functools import cache
from importlib.util import find_spec
from modulefinder import ModuleFinder
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.io import open_file
from apo_bench.names import find_own_module
from apo_bench.perception.observation.noise_file import list_noise_files
from apo_bench.records.user_code import DATA_PREFIXES, is_user_code
from apo_bench.resources import folder
from apo_bench.scenario import Scenario, find_scenario_path
from apo_bench.scenario.parts import read_part

_CHUNK = 1 << 20  # bytes read at once


def hash_input_files(
    scenario: Scenario, source: str | Path | Scenario, arm_files: Path | tuple[Path, ...]
) -> dict[str, str]:
    """Each input of a trial of a scenario -> 16 hexadecimal digits.

    Inputs are the scenario (file, or values without a file), the files of each part, the files of the arm, the room,
    and the judge's thresholds.

    Args:
        source: The scenario as given to `load_scenario`.
        arm_files: `Arm.files`.
    """
    thresholds = json.dumps(asdict(scenario.thresholds), sort_keys=True).encode()
    files = {
        **{f"part {part}": read_part(path).files for part, path in sorted(scenario.part_files.items())},
        "room": (folder("assets") / "room.xml",),
        "arm": arm_files if isinstance(arm_files, tuple) else (arm_files,),
    }
    return {
        "scenario": _digest_scenario(scenario, source),
        **{name: digest_files(paths) for name, paths in files.items()},
        "thresholds": compute_digest(thresholds),
    }


def hash_noise_files(*names: str) -> dict[str, str]:
    """`noise NAME` -> 16 hexadecimal digits over the file, for noise models that are files or plugins."""
    paths = {f"noise {name}": list_noise_files(name) for name in names}
    return {name: digest_files(found) for name, found in paths.items() if found} | hash_user_code("noise", *names)


def hash_user_code(kind: str, *names: str) -> dict[str, str]:
    """`KIND NAME` -> 16 hexadecimal digits over the files of the module, for plugins `module:name`."""
    own = [name for name in names if is_user_code(kind, name)]
    digests = {f"{kind} {name}": _digest_module(name.partition(":")[0]) for name in own}
    return {name: found for name, found in digests.items() if found is not None}


def list_user_files(name: str) -> tuple[Path, ...]:
    """The files of a plugin `module:name`; empty for any other name."""
    is_own = all(is_user_code(column, name) for column in DATA_PREFIXES)
    return list_module_files(name.partition(":")[0]) if is_own else ()


def digest_files(paths: Iterable[Path]) -> str:
    """16 hexadecimal digits over the contents of files, in order.

    Raises:
        InputError: A file cannot be read.
    """
    found = []
    for path in paths:
        with open_file(path, "input file") as file:
            whole = hashlib.sha256()
            while chunk := file.read(_CHUNK):
                whole.update(chunk)
        found.append(whole.digest())
    return compute_digest(b"".join(found))


def compute_digest(content: bytes) -> str:
    """16 hexadecimal digits of SHA-256."""
    return hashlib.sha256(content).hexdigest()[:16]


@cache
def _digest_module(module: str) -> str | None:
    """Digest of the source files of a module at the first call; None if it has none."""
    files = list_module_files(module)
    return digest_files(files) if files else None


def list_module_files(module: str) -> tuple[Path, ...]:
    """The source files of a module and of its imports from the same folder, found without running it.

    For a module installed in site-packages, only files of its own package count.
    """
    top = module.partition(".")[0]
    spec = find_spec(top) or find_own_module(top)
    if spec is None or not spec.has_location or spec.origin is None:
        return ()
    # The folder that holds the module: parents[0] of a file, parents[1] of the `__init__.py` of a package.
    home = Path(spec.origin).parents[spec.submodule_search_locations is not None]
    others = ["apo_bench"]
    if home in {Path(sysconfig.get_path(name)) for name in ("purelib", "platlib", "stdlib")}:
        others = [path.stem for path in home.iterdir() if path.stem != top]
    finder = ModuleFinder([str(home)], excludes=others)
    with suppress(ImportError, SyntaxError):
        finder.import_hook(module)
    found = (getattr(module, "__file__", None) for module in finder.modules.values())
    return tuple(sorted(Path(file) for file in found if file and file.endswith(".py")))


def _digest_scenario(scenario: Scenario, source: str | Path | Scenario) -> str:
    """Digest of a scenario's file, or of its values if it is given as an object."""
    if isinstance(source, Scenario):
        return compute_digest(json.dumps(_convert_to_plain(scenario), sort_keys=True).encode())
    return digest_files([find_scenario_path(source)])


def _convert_to_plain(value: Any) -> Any:
    """Nested dataclasses, mappings, sets and arrays as values for `json`; paths, hashed elsewhere, become None."""
    if is_dataclass(value):
        return {f.name: _convert_to_plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Path):
        return None
    if isinstance(value, (frozenset, set)):
        return sorted(value)
    if isinstance(value, Mapping):
        return {str(k): _convert_to_plain(v) for k, v in value.items()}
    if isinstance(value, (tuple, list)):
        return [_convert_to_plain(v) for v in value]
    return value
