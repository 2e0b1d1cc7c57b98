"""Hashes that say whether two rows were made of the same things."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench import __version__, files
from apo_bench.benchmark.spec import ROW, TrialSpec
from apo_bench.observation.noise_file import noise_path
from apo_bench.resources import folder
from apo_bench.scenario import Scenario
from apo_bench.scenario_file import scenario_names

SCHEMAS = (ROW, files.DEMONSTRATION, files.OBSERVATION, files.PLAN)


def content_hash(scenario: Scenario, given: str | Path | Scenario, arm_file: Path) -> str:
    """16 hexadecimal digits over all that shapes a trial besides its specification.

    The scenario (its file's bytes, or its numbers if it never was a file), the files of its parts, the arm and
    the room, the judge's thresholds, the version of the package and of every schema.

    Args:
        given: What `load_scenario` was given.
    """
    digest = hashlib.sha256()
    for piece in (
        _scenario_bytes(scenario, given),
        *(path.read_bytes() for _, path in sorted(scenario.part_files.items())),
        (folder("assets") / "room.xml").read_bytes(),
        Path(arm_file).read_bytes(),
        json.dumps([asdict(scenario.thresholds), __version__, SCHEMAS], sort_keys=True).encode(),
    ):
        digest.update(len(piece).to_bytes(8, "big") + piece)
    return digest.hexdigest()[:16]


def spec_hash(spec: TrialSpec, content: str, observation: str = "") -> str:
    """16 hexadecimal digits over the content and every setting but method, seed and the scenario's path.

    A noise model that is a file counts by what stands in it as well.

    Rows with the same hash differ in method and seed alone, so they may be counted together or paired.

    Args:
        content: From `content_hash`.
        observation: The text of the observation's file, when it was not drawn.
    """
    settings = {k: v for k, v in asdict(spec).items() if k not in ("method", "seed", "scenario")}
    text = json.dumps([content, settings, observation, *noise_content(spec.noise).values()], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def noise_content(*names: str) -> dict[str, str]:
    """Of the noise models that are files: `noise NAME` -> 16 hexadecimal digits over the bytes of the file."""
    files = {f"noise {name}": path for name in names if (path := noise_path(name)) is not None}
    return {name: hashlib.sha256(path.read_bytes()).hexdigest()[:16] for name, path in files.items()}


def _scenario_bytes(scenario: Scenario, given: str | Path | Scenario) -> bytes:
    if isinstance(given, Scenario):
        return json.dumps(_plain(scenario), sort_keys=True).encode()
    return (folder("scenarios") / f"{given}.toml" if given in scenario_names() else Path(given)).read_bytes()


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
