"""The command that runs the trial of a row again.

Which trials name code of somebody's own, which is imported to run them: `package.module:name`.

A file is data. What rows or `run.json` name is never imported unless it comes with the package, or a person says that
the folder is trusted.
"""

import shlex
from collections.abc import Iterable, Mapping
from typing import Any

from apo_bench.records.settings import DEPTH_CAMERA, NOISE_LEVEL, SETTINGS
from apo_bench.records.short_names import FAILURES, FOREIGN_ARMS, RESIDUALS, WRONG
from apo_bench.records.thresholds import USUAL_LIMITS, Limits

_SALT_FILE = "FILE"
"""Stands for the file of the salt of a trial: where it is, is nobody's business who reads a page."""
_ALWAYS = ("clearance_mm", "method")
"""Said even if it is as usual."""
_APART = ("scenario", "noise_mm", "noise_deg", "seed", "secret_seed")
"""Said in a way of its own."""
Files = Mapping[str, str]
"""Scenarios that were given as files: name -> path."""


def replay_command(row: Mapping[str, Any], files: Files | None = None, limits: Limits = USUAL_LIMITS) -> str:
    """`apo-bench run SCENARIO .. --seed N`, quoted for a shell; of the defaults it names method and clearance."""
    return f"{without_seed(row, files, limits)} --seed {row['seed']}"


def without_seed(row: Mapping[str, Any], files: Files | None = None, limits: Limits = USUAL_LIMITS) -> str:
    """A replay command without its seed: what the trials of a cell have in common."""
    scenario = str((files or {}).get(row["scenario"], row["scenario"]))
    scenario = f"./{scenario}" if scenario.startswith("-") else scenario
    return shlex.join(["apo-bench", "run", scenario, *_options(row, limits)])


def _options(row: Mapping[str, Any], limits: Limits) -> list[str]:
    words: list[str] = []

    def add(option: str, value: object, default: object = None) -> None:
        if value != default:
            words.extend((f"--{option}", number(value) if isinstance(value, float) else str(value)))

    measured = row["pose_source"] == DEPTH_CAMERA
    if measured or row["noise_mm"] == row["noise_deg"]:
        add(NOISE_LEVEL.option, float(row["noise_mm"]), SETTINGS["noise_mm"].default)
    else:
        for name in ("noise_mm", "noise_deg"):
            info = SETTINGS[name]
            add(info.option, float(row[info.name]), info.default)
    for name, info in SETTINGS.items():
        value = row.get(info.name, info.default)
        if name in _APART or (name == "noise" and measured) or (value == info.default and name not in _ALWAYS):
            continue
        add(info.option, milli(value) if info.scale != 1.0 else value if info.is_text else float(value))
    add(SETTINGS["secret_seed"].option, _SALT_FILE if row.get("secret_seed") else None)
    if row.get("failure_stage") == "worker":
        add("trial-limit", limits.trial_s)
    return words


def number(x: float) -> str:
    """The shortest text that is read as the same number."""
    return str(int(x)) if x == int(x) and abs(x) < 1e15 else repr(x)


def milli(seconds: float) -> float:
    """In thousandths, such that these times 1e-3 are the same number again wherever there are such."""
    rounded = float(f"{seconds * 1e3:.12g}")
    return rounded if rounded * 1e-3 == seconds else seconds * 1e3


DATA_PREFIXES: Mapping[str, tuple[str, ...]] = {
    "method": (),
    "arm": FOREIGN_ARMS,
    "noise": (RESIDUALS, *(f"{name}:" for name in FAILURES)),
    "contact_source": tuple(f"{kind}:" for kind in WRONG),
}
"""Column -> how names with a colon begin that are data, and no code."""
_MOST = 3
"""Names in the sentence."""


def own_code(row: Mapping[str, Any]) -> tuple[str, ...]:
    """What of a row is code of somebody's own; files of noise and scenarios are data."""
    names = [row[column] for column, data in DATA_PREFIXES.items() if is_own_code(row[column], data)]
    return tuple(dict.fromkeys(names))


def is_own_code(name: str, data: tuple[str, ...]) -> bool:
    """Whether a name is `module:name`, and none that begins as one of the `DATA_PREFIXES`."""
    return ":" in name and not name.startswith(data)


def left_out(rows: Iterable[Mapping[str, Any]]) -> str:
    """The sentence on failed trials that are not run again for a picture; empty if there are none."""
    of_rows = [own for row in rows if row["success"] is False and (own := own_code(row))]
    if not of_rows:
        return ""
    names = list(dict.fromkeys(name for own in of_rows for name in own))
    more = f" and {len(names) - _MOST} more" * (len(names) > _MOST)
    many = "1 failed trial names" if len(of_rows) == 1 else f"{len(of_rows):,} failed trials name"
    return (
        f"{many} code that does not come with the package ({', '.join(names[:_MOST])}{more}); a report runs it only "
        "with --trust-code"
    )
