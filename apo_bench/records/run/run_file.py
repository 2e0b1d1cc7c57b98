"""`run.json`: the settings of a sweep and the inputs of its records."""

import json
import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from apo_bench.errors import InputError, require
from apo_bench.io import clean, read_bytes, write_file
from apo_bench.records.limits import USUAL_LIMITS, Limits
from apo_bench.records.run.validation import run_of
from apo_bench.records.secret_seed import SecretSeed

_RUN = "apo-bench/run/4"
_LARGEST_BYTES = 16_000_000


def run_record(
    grids: Sequence[Mapping[str, Any]],
    content: Mapping[str, str],
    versions: Mapping[str, str],
    files: Mapping[str, str],
    command: str,
    secret_seed: SecretSeed | None = None,
    limits: Limits = USUAL_LIMITS,
    revision: str = "",
) -> dict[str, Any]:
    """The content of `run.json`.

    Args:
        grids: From `described`.
        content: Input of the trials -> its hash.
        files: Scenarios that were given as files: name -> path.
        versions: Package -> version, of those that may show in a record.
        revision: Git revision of the package; it is noted and not compared.
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
    """Replace the file at once: it is the old one or the new one, never half of it."""
    write_file(folder / "run.json", json.dumps(run, indent=2) + "\n")


def read_run(folder: Path) -> dict[str, Any]:
    """What `run.json` says; nothing if it is not there.

    Raises:
        InputError: It cannot be read, or is something else; one sentence with file and field.
    """
    path = folder / "run.json"
    return run_of(read_bytes(path, "run file", _LARGEST_BYTES), str(path)) if os.path.lexists(path) else {}


def scenario_files(run: Mapping[str, Any]) -> dict[str, str]:
    """Scenarios that were given as files: name -> path."""
    return dict(run.get("files") or {})


def limits_of(run: Mapping[str, Any]) -> Limits:
    """The limits that a sweep had when it was last started; the usual ones where it does not say."""
    limits = {"trial_s": USUAL_LIMITS.trial_s} | (run.get("limits") or {})
    trial_s = limits["trial_s"]
    return Limits(None if trial_s is None else float(trial_s))


def check_same(folder: Path, run: Mapping[str, Any]) -> None:
    """Raise an `InputError` that says what differs, unless a folder is of the same sweep; it may have fewer trials."""
    try:
        before = read_run(folder)
    except InputError as error:
        raise InputError(f"'{folder}' has trials but no readable run.json ({error}); choose another folder.") from error
    require(before, f"'{folder}' has trials but no readable run.json; choose another folder.")
    schema = before.get("schema")
    require(
        schema == _RUN, f"'{folder}' has a run.json of schema '{schema}', '{_RUN}' is needed; choose another folder."
    )
    now = json.loads(json.dumps(run))
    grids = before.get("grids", [])
    count = f"it had {len(grids)} grids, now {len(now['grids'])}" if len(grids) != len(now["grids"]) else ""
    differences = [
        *(("grid", _difference(old, new, may_grow=True)) for old, new in zip(grids, now["grids"], strict=False)),
        ("versions", _difference(before.get("versions"), now["versions"])),
        ("inputs", _difference(before.get("content"), now["content"])),
    ]
    why = count or next((f"{what}: {text}" for what, text in differences if text), "")
    require(not why, f"'{folder}' holds trials of another sweep ({why}); choose another folder.")


def _difference(before: Any, now: Mapping[str, Any], *, may_grow: bool = False) -> str:
    """The first key with another value, and both values; empty if there is none.

    Args:
        may_grow: More `trials` are no difference.
    """
    before = before if isinstance(before, dict) else {}
    for key in sorted({*before, *now}):
        old = before.get(key)
        new = now.get(key)
        grown = may_grow and key == "trials" and isinstance(old, int) and old <= (new or 0)
        if old != new and not grown:
            return f"{key} was {json.dumps(old)}, now {json.dumps(new)}"
    return ""
