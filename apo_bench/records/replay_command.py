"""The command that runs the trial of a row again."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import Any

from apo_bench.records.limits import CORRECTOR_LIMIT_S, USUAL_LIMITS, Limits
from apo_bench.records.method import is_own
from apo_bench.records.settings import RANGE, USUAL

USUALLY = {"grasp": "friction", "arm": "six_axis", "timestep_s": 0.001}
"""What a row that does not say means."""
SALT_FILE = "FILE"
"""Stands for the file of the salt of a trial: where it is, is nobody's business who reads a page."""
Files = Mapping[str, str]
"""Scenarios that were given as files: name -> path."""


def replay_command(row: Mapping[str, Any], files: Files | None = None, limits: Limits = USUAL_LIMITS) -> str:
    """`apo-bench replay SCENARIO .. --seed N`, quoted for a shell; of the defaults it names method and clearance."""
    return f"{without_seed(row, files, limits)} --seed {row['seed']}"


def without_seed(row: Mapping[str, Any], files: Files | None = None, limits: Limits = USUAL_LIMITS) -> str:
    """The same without the seed: what the trials of a cell have in common."""
    given = str((files or {}).get(row["scenario"], row["scenario"]))
    given = f"./{given}" if given.startswith("-") else given
    usual = {"eye": RANGE if row["noise"] == RANGE else "noise", "fidelity": "full", **USUALLY}
    return shlex.join(["apo-bench", "replay", given, *_options({**usual, **row}, limits)])


def _options(row: Mapping[str, Any], limits: Limits) -> list[str]:
    said: list[str] = []

    def say(option: str, value: object, default: object) -> None:
        if value != default:
            said.extend((option, number(value) if isinstance(value, float) else str(value)))

    measured = row["eye"] == RANGE
    if measured or row["level"] == row["level_deg"]:
        say("--level", float(row["level"]), 1.0)
    else:
        say("--level-mm", float(row["level"]), 1.0)
        say("--level-deg", float(row["level_deg"]), 1.0)
    say("--careless", float(row["careless"]), 1.0)
    say("--noise", row["noise"], RANGE if measured else USUAL)
    say("--relations", row["relations"], "given")
    say("--eye", row["eye"], "noise")
    say("--clearance", float(row["clearance_mm"]), None)
    say("--grasp", row["grasp"], "friction")
    say("--arm", row["arm"], "six_axis")
    say("--timestep-ms", milli(row["timestep_s"]), 1.0)
    say("--fidelity", row["fidelity"], "full")
    say("--method", row["method"], None)
    say("--salt-file", SALT_FILE if row.get("salt") else None, None)
    if row.get("failure_stage") == "worker":
        say("--trial-limit", limits.trial_s, None)
        if is_own(row["method"]):
            say("--corrector-limit", limits.corrector_s, CORRECTOR_LIMIT_S)
    return said


def number(x: float) -> str:
    """The shortest text that is read as the same number."""
    return str(int(x)) if x == int(x) and abs(x) < 1e15 else repr(x)


def milli(seconds: float) -> float:
    """In thousandths, such that these times 1e-3 are the same number again wherever there are such."""
    rounded = float(f"{seconds * 1e3:.12g}")
    return rounded if rounded * 1e-3 == seconds else seconds * 1e3
