"""`run.json`: what a sweep was asked to do and what its rows are made of; and whether another sweep is the same."""

import json
import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from apo_bench.errors import InputError, require
from apo_bench.io import read_bytes, write_file
from apo_bench.records.run.validation import run_of
from apo_bench.records.secret_seed import SecretSeed
from apo_bench.records.thresholds import USUAL_LIMITS, Limits

_RUN = "apo-bench/run/3"
_LARGEST_BYTES = 16_000_000


def run_record(
    grids: Sequence[Mapping[str, Any]],
    content: Mapping[str, str],
    code: Mapping[str, str],
    versions: Mapping[str, str],
    files: Mapping[str, str],
    command: str,
    secret_seed: SecretSeed | None = None,
    limits: Limits = USUAL_LIMITS,
) -> dict[str, Any]:
    """What `run.json` says.

    Args:
        grids: From `described`.
        content: What the trials are made of besides the package -> its hash.
        code: Source file -> its hash.
        files: Scenarios that were given as files: name -> path.
        versions: Of packages that may show in a row.
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
        "command": command,
        "code": dict(code),
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
    schema = before.get("schema")
    require(schema is not None, f"'{folder}' has trials but no readable run.json; choose another folder.")
    require(
        schema == _RUN, f"'{folder}' has a run.json of schema '{schema}', '{_RUN}' is needed; choose another folder."
    )
    now = json.loads(json.dumps(run))
    grids = before.get("grids")
    if not isinstance(grids, list) or len(grids) != len(now["grids"]):
        count = len(grids) if isinstance(grids, list) else 0
        _refuse(folder, f"it had {count} grids, now {len(now['grids'])}")
    for i, (old, new) in enumerate(zip(grids, now["grids"], strict=True), start=1):
        _refuse_other(folder, f"grid {i}" if len(grids) > 1 else "grid", old, new)
    _refuse_changed(folder, "code: apo_bench/{} changed", before.get("code"), now["code"])
    _refuse_other(folder, "versions", before.get("versions"), now["versions"])
    _refuse_changed(folder, "inputs changed: {}", before.get("content"), now["content"])


def _refuse_changed(folder: Path, what: str, before: Any, now: Mapping[str, str]) -> None:
    """Nothing that has a hash may differ."""
    before = before if isinstance(before, dict) else {}
    changed = sorted(name for name in {*before, *now} if before.get(name) != now.get(name))
    if changed:
        more = f" and {len(changed) - 1} more" if len(changed) > 1 else ""
        _refuse(folder, what.format(f"{changed[0]}{more}"))


def _refuse_other(folder: Path, what: str, before: Any, now: Mapping[str, Any]) -> None:
    """More trials of the same grid are welcome; anything else that differs makes another sweep."""
    before = before if isinstance(before, dict) else {}
    for key in sorted({*before, *now}):
        old = before.get(key)
        new = now.get(key)
        grown = what.startswith("grid") and key == "trials" and isinstance(old, int) and old <= (new or 0)
        if old != new and not grown:
            _refuse(folder, f"{what}: {key} was {json.dumps(old)}, now {json.dumps(new)}")


def _refuse(folder: Path, why: str) -> NoReturn:
    raise InputError(f"'{folder}' holds trials of another sweep ({why}); choose another folder.")
