"""The six lines that `apo-bench run` prints about a trial."""

import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType

from apo_bench.records import SETTINGS, TrialRecord, probes
from apo_bench.records.run.replay_command import format_replay_command

Line = tuple[str, str]
"""Name and text of a line."""
_IF_UNUSUAL = (
    *("pose_source", "noise", "contact_source", "max_reobservations", "robot_error", "min_predicted_success"),
    *("ft_sensor", "assumed_robot_error"),
)
"""Settings that are printed if they differ from their default; the last two only for a robot that probes."""
_DECISIVE: Mapping[str, Line] = MappingProxyType(
    {
        "overlap": ("least overlap", "{least_overlap:.0%} of the true overlap"),
        "penetration": ("penetration", "{penetration_mm:.3f} mm"),
        "pushed": ("displacement", "{placed_part_shift_mm:.2f} mm"),
        "force_stop": ("peak force", "{peak_force_n:.1f} N"),
        "doubtful": ("p-value", "{p_value:.2g} of the consistency test"),
        "inconsistent": ("contact gap", "{gap_before_mm:.3f} mm observed"),
    }
)
"""Failure code -> name and template of the number that explains the failure."""
_OTHERWISE: Mapping[str, Line] = MappingProxyType(
    {
        "worst_gap_mm": ("worst gap", "{worst_gap_mm:.3f} mm between faces that should touch"),
        "peak_force_n": ("peak force", "{peak_force_n:.1f} N"),
        "gap_before_mm": ("contact gap", "{gap_before_mm:.3f} mm observed"),
    }
)
"""Column -> name and template of the number for all other outcomes; the first column with a value is printed."""


def format_summary(record: TrialRecord, scenario: str, observation: Path | None = None) -> list[Line]:
    """Return the six lines: settings, correction, result, decisive number, predicted success, command to view.

    Args:
        scenario: Name or file, as the command takes it.
        observation: File of the observation, if it was measured and not simulated.
    """
    predicted = record.get("predicted_success")
    gaps = [record.get(name) for name in ("gap_before_mm", "gap_after_mm")]
    known = [f"{gap:.3f} mm {when}" for gap, when in zip(gaps, ("observed", "planned"), strict=True) if gap is not None]
    correction = ", contact gap ".join((record["method"], *known[:1])) + "".join(f", {gap}" for gap in known[1:])
    if observation is None:
        again = format_replay_command(record, {record["scenario"]: scenario})
    else:
        command = format_replay_command(record, {record["scenario"]: scenario}, measured=True)
        again = f"{command} --observation {shlex.quote(str(observation))}"
    return [
        ("trial", f"{record['scenario']}, {', '.join(_describe_settings(record))}"),
        ("correction", correction),
        ("result", _describe_result(record)),
        _find_decisive_number(record),
        ("predicted success", "unknown, since there is no plan" if predicted is None else f"{predicted:.2f}"),
        ("look at it", f"{again} --view"),
    ]


def _describe_settings(record: TrialRecord) -> Iterator[str]:
    """Yield `noise level 2`, `human error scale 1`, `seed 5`, then settings that differ from their default."""
    mm, deg = record["noise_mm"], record["noise_deg"]
    if mm is None or deg is None:
        yield "measured observation"
        return
    if record["pose_source"] == SETTINGS["pose_source"].default:
        yield f"noise level {mm:g}" if mm == deg else f"noise {mm:g} mm and {deg:g} degrees"
    else:
        yield f"noise {mm:g} mm per ray"
    yield f"human error scale {record['human_error_scale']:g}"
    yield f"seed {record['seed']}"
    for name in _IF_UNUSUAL if probes(record["method"]) else _IF_UNUSUAL[:-2]:
        value = record.get(name) or SETTINGS[name].default
        if value != SETTINGS[name].default:
            yield f"{name.replace('_', ' ')} {value}"


def _describe_result(record: TrialRecord) -> str:
    """Describe success, or the stage, code and operation of the failure."""
    if record["success"] is None:
        return "none: the demonstration failed"
    if record["success"]:
        as_demonstrated = record.get("as_demonstrated_code") in (None, "ok")
        return "success" if as_demonstrated else f"success, not as demonstrated: {record['as_demonstrated_code']}"
    where = "" if record["failure_operation"] is None else f", operation {record['failure_operation']}"
    return f"failure at stage {record['failure_stage']}: {record['failure_code']}{where} ({record.get('sentence')})"


def _find_decisive_number(record: TrialRecord) -> Line:
    """Return the number that explains the failure code, else the first number of `_OTHERWISE` that is known."""
    try:
        name, text = _DECISIVE[record["failure_code"] or ""]
        return name, text.format_map(record)
    except (KeyError, TypeError):  # another code, or its number is unknown
        name, text = next((line for column, line in _OTHERWISE.items() if record.get(column) is not None), ("", ""))
        return name, text.format_map(record)
