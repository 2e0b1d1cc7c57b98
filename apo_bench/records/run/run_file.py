"""Read and write `run.json`: the settings of a sweep, and the inputs of its records."""

import json
import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from apo_bench.errors import InputError, require
from apo_bench.io import clean, read_bytes, write_file
from apo_bench.records.limits import USUAL_LIMITS, Limits
from apo_bench.records.run.validation import decode_run
from apo_bench.records.secret_seed import SecretSeed

_RUN = "apo-bench/run/4"
_LARGEST_BYTES = 16_000_000


def make_run_record(
    grids: Sequence[Mapping[str, Any]],
    content: Mapping[str, str],
    versions: Mapping[str, str],
    files: Mapping[str, str],
    command: str,
    secret_seed: SecretSeed | None = None,
    limits: Limits = USUAL_LIMITS,
    revision: str = "",
) -> dict[str, Any]:
    """Return the content of `run.json`.

    Args:
        grids: The grids, of `describe_grids`.
        content: Input of the trials -> its hash.
        versions: Package -> version, for packages that may affect a record.
        files: Name -> path of each scenario that was given as a file.
        revision: Git revision of the package, for information only; it is not compared.
    """
    return {
        "schema": _RUN,
        "grids": list(grids),
        "files": dict(files),
        "secret_seed": None if secret_seed is None else secret_seed.hash,
        "limits": {"trial_s": limits.trial_s},
        "content": dict(content),
        "versions": dict(versions),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "command": clean(command),
        "revision": revision or None,
    }


def write_run(folder: Path, run: Mapping[str, Any]) -> None:
    """Replace `run.json` at once, so that a reader finds the old or the new content, never a part."""
    write_file(folder / "run.json", json.dumps(run, indent=2) + "\n")


def read_run(folder: Path) -> dict[str, Any]:
    """Read `run.json`; returns an empty dictionary if there is none.

    Raises:
        InputError: The file cannot be read, or is invalid; the message names file and field.
    """
    path = folder / "run.json"
    return decode_run(read_bytes(path, "run file", _LARGEST_BYTES), str(path)) if os.path.lexists(path) else {}


def list_scenario_files(run: Mapping[str, Any]) -> dict[str, str]:
    """Return name -> path of each scenario that was given as a file."""
    return dict(run.get("files") or {})


def read_limits(run: Mapping[str, Any]) -> Limits:
    """Return the limits that a sweep had when it was last started; the usual ones if `run.json` states none."""
    limits = {"trial_s": USUAL_LIMITS.trial_s} | (run.get("limits") or {})
    trial_s = limits["trial_s"]
    return Limits(None if trial_s is None else float(trial_s))


def check_same(folder: Path, run: Mapping[str, Any]) -> None:
    """Raise an `InputError` that names the difference, unless a folder is of the same sweep.

    The folder may have fewer trials per combination than the sweep now has.
    """
    try:
        before = read_run(folder)
    except InputError as error:
        raise InputError(f"'{folder}' has trials but no readable run.json ({error}); choose another folder.") from error
    require(before, f"'{folder}' has trials but no readable run.json; choose another folder.")
    schema = before.get("schema")
    require(
        schema == _RUN, f"'{folder}' has a run.json of schema '{schema}', '{_RUN}' is needed; choose another folder."
    )
    now = json.loads(json.dumps(run))  # as it will be read back
    grids = before.get("grids", [])
    count = f"it had {len(grids)} grids, now {len(now['grids'])}" if len(grids) != len(now["grids"]) else ""
    differences = [
        *(("grid", _find_difference(old, new, may_grow=True)) for old, new in zip(grids, now["grids"], strict=False)),
        ("versions", _find_difference(before.get("versions"), now["versions"])),
        ("inputs", _find_difference(before.get("content"), now["content"])),
    ]
    why = count or next((f"{what}: {text}" for what, text in differences if text), "")
    require(not why, f"'{folder}' holds trials of another sweep ({why}); choose another folder.")


def _find_difference(before: Any, now: Mapping[str, Any], *, may_grow: bool = False) -> str:
    """Return the first key with another value, and both values, as text; empty if there is none.

    Args:
        may_grow: Whether a larger number of `trials` counts as equal.
    """
    before = before if isinstance(before, dict) else {}
    for key in sorted({*before, *now}):
        old = before.get(key)
        new = now.get(key)
        grown = may_grow and key == "trials" and isinstance(old, int) and old <= (new or 0)
        if old != new and not grown:
            return f"{key} was {json.dumps(old)}, now {json.dumps(new)}"
    return ""
