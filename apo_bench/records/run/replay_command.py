"""The command that runs the trial of a record again."""

import shlex
from collections.abc import Mapping
from typing import Any

from apo_bench.records.limits import USUAL_LIMITS, Limits
from apo_bench.records.settings import DEPTH_CAMERA, NOISE_LEVEL, SETTINGS

_SALT_FILE = "FILE"
"""Stands for the file of the salt of a trial: where it is, is nobody's business who reads a page."""
_ALWAYS = ("clearance_mm", "method")
"""Said even if it is as usual."""
_APART = ("scenario", "noise_mm", "noise_deg", "seed", "secret_seed")
"""Said in a way of its own."""
Files = Mapping[str, str]
"""Scenarios that were given as files: name -> path."""


def replay_command(
    record: Mapping[str, Any], files: Files | None = None, limits: Limits = USUAL_LIMITS, *, measured: bool = False
) -> str:
    """`apo-bench run SCENARIO .. --seed N`, quoted for a shell; of the defaults it names method and clearance.

    Args:
        measured: Whether the observation comes from a file: settings of a random draw are left out.
    """
    if measured:
        drawn = {name: info.default for name, info in SETTINGS.items() if info.drawn or name == "noise"}
        return without_seed({**record, **drawn}, files, limits)
    return f"{without_seed(record, files, limits)} --seed {record['seed']}"


def without_seed(record: Mapping[str, Any], files: Files | None = None, limits: Limits = USUAL_LIMITS) -> str:
    """A replay command without its seed: what the trials of a cell have in common."""
    scenario = str((files or {}).get(record["scenario"], record["scenario"]))
    scenario = f"./{scenario}" if scenario.startswith("-") else scenario
    return shlex.join(["apo-bench", "run", scenario, *_options(record, limits)])


def _options(record: Mapping[str, Any], limits: Limits) -> list[str]:
    words: list[str] = []

    def add(option: str, value: object, default: object = None) -> None:
        if value != default:
            words.extend((f"--{option}", number(value) if isinstance(value, float) else str(value)))

    measured = record["pose_source"] == DEPTH_CAMERA
    if measured or record["noise_mm"] == record["noise_deg"]:
        add(NOISE_LEVEL.option, float(record["noise_mm"]), SETTINGS["noise_mm"].default)
    else:
        for name in ("noise_mm", "noise_deg"):
            info = SETTINGS[name]
            add(info.option, float(record[info.name]), info.default)
    for name, info in SETTINGS.items():
        value = record.get(info.name, info.default)
        if name in _APART or (name == "noise" and measured) or (value == info.default and name not in _ALWAYS):
            continue
        add(info.option, milli(value) if info.scale != 1.0 else value if info.is_text else float(value))
    add(SETTINGS["secret_seed"].option, _SALT_FILE if record.get("secret_seed") else None)
    if record.get("failure_stage") == "worker":
        add("trial-limit", limits.trial_s)
    return words


def number(x: float) -> str:
    """The shortest text that is read as the same number."""
    return str(int(x)) if x == int(x) and abs(x) < 1e15 else repr(x)


def milli(seconds: float) -> float:
    """In thousandths, such that these times 1e-3 are the same number again wherever there are such."""
    rounded = float(f"{seconds * 1e3:.12g}")
    return rounded if rounded * 1e-3 == seconds else seconds * 1e3
