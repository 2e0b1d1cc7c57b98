"""The line of a page of results that says which MuJoCo its trials were simulated with."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path


def mujoco_of(folders: Iterable[Path]) -> list[str]:
    """The versions of MuJoCo that these sweeps were run with."""
    runs = [json.loads((folder / "run.json").read_text(encoding="utf-8")) for folder in folders]
    return sorted({run["versions"]["mujoco"] for run in runs})


def states_of_code(folders: Iterable[Path]) -> int:
    """How many states of the package these sweeps were made with."""
    runs = [json.loads((folder / "run.json").read_text(encoding="utf-8")) for folder in folders]
    return len({json.dumps([run["versions"], run.get("code") or run.get("revision")], sort_keys=True) for run in runs})


def said_by(page: str) -> list[str]:
    """The versions that a page names already."""
    found = re.search(r"^\*Simulated with MuJoCo (.*)\.\*$", page, re.MULTILINE)
    return found[1].split(" and ") if found else []


def with_mujoco(page: str, versions: Iterable[str]) -> str:
    """The page with that line below its heading."""
    heading = next(line for line in page.splitlines() if line.startswith("# "))
    return page.replace(f"{heading}\n", f"{heading}\n\n*Simulated with MuJoCo {' and '.join(versions)}.*\n", 1)
