"""Hashes that say whether two rows were made of the same things: files, settings, and the code that shapes a row.

The files are those of `apo_bench.trial.inputs`; the code is every source file of the package but those of
`PACKAGES_WITHOUT_TRIALS`.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from functools import cache
from importlib import metadata
from importlib.resources import files
from importlib.resources.abc import Traversable
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType

from apo_bench import __version__
from apo_bench.formats.observation_json import OBSERVATION_SCHEMA
from apo_bench.formats.plan_json import PLAN_SCHEMA
from apo_bench.records import RECORD_SCHEMA, TrialConfig
from apo_bench.scenario import Scenario
from apo_bench.trial.inputs import content_pieces, digest, noise_content, own_content

_SCHEMAS = (RECORD_SCHEMA, OBSERVATION_SCHEMA, PLAN_SCHEMA)
PACKAGES_WITHOUT_TRIALS = ("benchmark", "cli", "envs", "importers", "viz")
"""Commands, imports that end in files, how work is spread, and all that is made of rows afterwards."""

_PACKAGES = (
    *("apo_bench", "mujoco", "mink", "daqp", "gymnasium"),
    *("numpy", "scipy", "trimesh", "manifold3d", "shapely"),
)
"""The packages whose version may show in a row."""
_OPTIONAL = ("numba",)
"""The same, and without them rows are only rounded otherwise."""


def versions() -> dict[str, str]:
    """Package -> version, as installed here; `none` of an optional one that is not."""
    return {package: metadata.version(package) for package in _PACKAGES} | {
        package: metadata.version(package) if find_spec(package) else "none" for package in _OPTIONAL
    }


def content_hash(scenario: Scenario, source: str | Path | Scenario, arm_files: Path | tuple[Path, ...]) -> str:
    """16 hexadecimal digits over all that shapes a trial besides its specification.

    The pieces of `content_pieces`, the code of the package, its version and that of every schema.

    Args:
        source: What `load_scenario` was given.
    """
    content = [content_pieces(scenario, source, arm_files), dict(code_files()), __version__, _SCHEMAS]
    return digest(json.dumps(content, sort_keys=True).encode())


@cache
def code_files() -> Mapping[str, str]:
    """Source file, relative to the package -> 16 hexadecimal digits over its lines; read once per process."""
    return MappingProxyType({path: digest(text) for path, text in sorted(sources(files("apo_bench"))) if counts(path)})


def counts(path: str) -> bool:
    """Whether a source file of the package shapes rows."""
    return not path.startswith(tuple(f"{package}/" for package in PACKAGES_WITHOUT_TRIALS))


def sources(package: Traversable, prefix: str = "") -> Iterator[tuple[str, bytes]]:
    """Every Python file of a package and what stands in it, wherever it is installed.

    Ends of lines are the same everywhere: they are the version control's.
    """
    for entry in package.iterdir():
        if entry.is_dir() and entry.name != "__pycache__":
            yield from sources(entry, f"{prefix}{entry.name}/")
        elif entry.name.endswith(".py"):
            yield prefix + entry.name, entry.read_bytes().replace(b"\r\n", b"\n")


def config_hash(spec: TrialConfig, content: str, observation: str = "") -> str:
    """16 hexadecimal digits over the content and every setting but method, seed and the scenario's path.

    A noise model that is a file, and noise, relations or an arm of one's own, count by what stands in the file as well;
    a salt counts by its hash.

    Rows with the same hash differ in method and seed alone, so they may be counted together or paired.

    Args:
        content: From `content_hash`.
        observation: The text of the observation's file, when it was not drawn.
    """
    settings = {k: v for k, v in asdict(spec).items() if k not in ("method", "seed", "scenario", "secret_seed")}
    if spec.secret_seed is not None:
        settings["secret_seed"] = spec.secret_seed.hash
    brought = {
        **noise_content(spec.noise),
        **own_content("contact_source", spec.contact_source),
        **own_content("arm", spec.arm),
    }
    return digest(json.dumps([content, settings, observation, *brought.values()], sort_keys=True).encode())
