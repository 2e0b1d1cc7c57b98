"""The command line that runs the trial of a record again."""

import shlex
from collections.abc import Mapping
from typing import Any

from apo_bench.records.limits import USUAL_LIMITS, Limits
from apo_bench.records.settings import DEPTH_CAMERA, NOISE_LEVEL, SETTINGS

_SALT_FILE = "FILE"
"""Placeholder for the file of the secret seed, whose path a page must not reveal."""
_ALWAYS = ("clearance_mm", "method")
"""Settings that a command states even if they have their default."""
_APART = ("scenario", "noise_mm", "noise_deg", "seed", "secret_seed")
"""Settings that a command states in another form."""
Files = Mapping[str, str]
"""Name -> path of each scenario that was given as a file."""


def format_replay_command(
    record: Mapping[str, Any], files: Files | None = None, limits: Limits = USUAL_LIMITS, *, measured: bool = False
) -> str:
    """Return `apo-bench run SCENARIO .. --seed N`, quoted for a shell.

    Of the defaults, only method and clearance are stated.

    Args:
        files: Scenarios that were given as files.
        limits: Limits of the sweep, which are stated for a trial that was lost.
        measured: Whether the observation comes from a file, so that settings of a random draw are left out.
    """
    if measured:
        drawn = {name: info.default for name, info in SETTINGS.items() if info.drawn or name == "noise"}
        return format_command_without_seed({**record, **drawn}, files, limits)
    return f"{format_command_without_seed(record, files, limits)} --seed {record['seed']}"


def format_command_without_seed(
    record: Mapping[str, Any], files: Files | None = None, limits: Limits = USUAL_LIMITS
) -> str:
    """Return a replay command without its seed, which all trials of a condition share."""
    scenario = str((files or {}).get(record["scenario"], record["scenario"]))
    scenario = f"./{scenario}" if scenario.startswith("-") else scenario  # not an option
    return shlex.join(["apo-bench", "run", scenario, *_list_options(record, limits)])


def _list_options(record: Mapping[str, Any], limits: Limits) -> list[str]:
    """Return the options of the settings of a record, other than scenario and seed."""
    words: list[str] = []

    def add(option: str, value: object, default: object = None) -> None:
        if value != default:
            words.extend((f"--{option}", format_number(value) if isinstance(value, float) else str(value)))

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
        add(info.option, round_up_to_ms(value) if info.scale != 1.0 else value if info.is_text else float(value))
    add(SETTINGS["secret_seed"].option, _SALT_FILE if record.get("secret_seed") else None)
    if record.get("failure_stage") == "worker":
        add("trial-limit", limits.trial_s)
    return words


def format_number(x: float) -> str:
    """Return the shortest text that is read back as the same number."""
    return str(int(x)) if x == int(x) and abs(x) < 1e15 else repr(x)


def round_up_to_ms(seconds: float) -> float:
    """Convert to thousandths, such that the result times 1e-3 is the same number again, if there is such a number."""
    rounded = float(f"{seconds * 1e3:.12g}")
    return rounded if rounded * 1e-3 == seconds else seconds * 1e3
