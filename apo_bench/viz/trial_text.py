"""A trial as text: six lines that answer a person, and one line for every other number of its record."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from apo_bench.records import SETTINGS, TrialRecord, probes
from apo_bench.records.run.replay_command import replay_command

Line = tuple[str, str]
"""Name and text."""
_IF_UNUSUAL = (
    *("pose_source", "noise", "contact_source", "max_reobservations", "robot_error", "min_predicted_success"),
    *("ft_sensor", "assumed_robot_error"),
)
"""Settings that are named where they differ from their default; only a robot that probes uses the last two."""
_DECISIVE: Mapping[str, Line] = MappingProxyType(
    {
        "overlap": ("least overlap", "{least_overlap:.0%} of the true overlap"),
        "penetration": ("penetration", "{penetration_mm:.3f} mm"),
        "pushed": ("displacement", "{displaced_mm:.2f} mm"),
        "force_stop": ("peak force", "{peak_force_n:.1f} N"),
        "doubtful": ("p-value", "{p_value:.2g} of the consistency test"),
        "inconsistent": ("contact gap", "{gap_before_mm:.3f} mm observed"),
    }
)
"""Failure code -> the number that explains it."""
_OTHERWISE: Mapping[str, Line] = MappingProxyType(
    {
        "worst_gap_mm": ("worst gap", "{worst_gap_mm:.3f} mm between faces that should touch"),
        "peak_force_n": ("peak force", "{peak_force_n:.1f} N"),
        "gap_before_mm": ("contact gap", "{gap_before_mm:.3f} mm observed"),
    }
)
"""Column -> the number that explains every other end, of the first column that has a value."""


def summary_lines(record: TrialRecord, scenario: str, observation: Path | None = None) -> list[Line]:
    """What was tried, how it was corrected, how it ended and why, what was predicted, and how to look at it.

    Args:
        scenario: Name or file, as the command takes it.
        observation: File of the observation, if it was measured.
    """
    predicted = record.get("predicted_success")
    gaps = [record.get(name) for name in ("gap_before_mm", "gap_after_mm")]
    known = [f"{gap:.3f} mm {when}" for gap, when in zip(gaps, ("observed", "planned"), strict=True) if gap is not None]
    correction = ", contact gap ".join((record["method"], *known[:1])) + "".join(f", {gap}" for gap in known[1:])
    if observation is None:
        again = replay_command(record, {record["scenario"]: scenario})
    else:
        again = f"apo-bench run {scenario} --observation {observation} --method {record['method']}"
    return [
        ("trial", f"{record['scenario']}, {', '.join(_describe_settings(record))}"),
        ("correction", correction),
        ("result", _describe_result(record)),
        _decisive_line(record),
        ("predicted success", "unknown, since there is no plan" if predicted is None else f"{predicted:.2f}"),
        ("look at it", f"{again} --view"),
    ]


def trial_lines(record: TrialRecord) -> Iterator[Line]:
    """One line for every other value of the record that is known."""
    for column, name, text in _DETAILS:
        value: Any = record.get(column)
        if value is not None and value != []:
            yield name, text.format_map(record) if isinstance(text, str) else text(value, record)


def _describe_settings(record: TrialRecord) -> Iterator[str]:
    """`noise level 2`, `human error scale 1`, `seed 5`, then settings that differ from their default."""
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
    if record["success"] is None:
        return "none: the demonstration failed"
    if record["success"]:
        as_demonstrated = record.get("as_demonstrated_code") in (None, "ok")
        return "success" if as_demonstrated else f"success, not as demonstrated: {record['as_demonstrated_code']}"
    where = "" if record["failure_operation"] is None else f", operation {record['failure_operation']}"
    return f"failure at stage {record['failure_stage']}: {record['failure_code']}{where} ({record.get('sentence')})"


def _decisive_line(record: TrialRecord) -> Line:
    try:
        name, text = _DECISIVE[record["failure_code"] or ""]
        return name, text.format_map(record)
    except (KeyError, TypeError):  # another code, or its number is not known
        name, text = next((line for column, line in _OTHERWISE.items() if record.get(column) is not None), ("", ""))
        return name, text.format_map(record)


def _list_attempts(attempts: Iterable[Mapping[str, Any]], _: TrialRecord) -> str:
    return "; ".join(
        f"after step {each['step']} {_brace(each['free'])} "
        + ("did not converge" if each["gap_mm"] is None else f"leaves {each['gap_mm']:.3f} mm")
        for each in attempts
    )


def _brace(operations: Iterable[int], _: Any = None) -> str:
    """`{5,4,3}`, as the paper writes sets of operations."""
    return "{" + ",".join(map(str, operations)) + "}"


def _list_adjustments(adjustments: Iterable[Mapping[str, Any]], _: TrialRecord) -> str:
    moved = ", ".join(f"operation {each['operation']} by {each['mm']:.1f} mm" for each in adjustments)
    return f"{moved}, so that the plan fits"


def _describe_prediction(predicted: Mapping[str, Any], _: TrialRecord) -> str:
    size = "" if predicted.get("size_mm") is None else f", {predicted['size_mm']:.2f} mm"
    return (
        f"operation {predicted['operation']} fails: {predicted['code']}{size}" if predicted["fails"] else f"none{size}"
    )


def _describe_test(p: float, record: TrialRecord) -> str:
    """`chi-square 31.2 of 13, p 0.003: not explained by the stated noise; one of R2, R4 may be wrong`."""
    suspects = ", ".join(record["suspects"] or ())
    return (
        f"chi-square {record['chi_square'] or 0.0:.1f} of {record['chi_square_dof']}, "
        f"{f'p {p:.2g}' if p else 'p < 1e-300'}: {'' if record['test_passes'] else 'not '}explained by the stated noise"
        + f"; one of {suspects} may be wrong"
        * bool(suspects)
    )


def _describe_slip(slips: Iterable[Mapping[str, Any]], record: TrialRecord) -> str:
    """Of the operation that failed, else of the part that turned most."""
    most = max(slips, key=lambda part: (part["operation"] == record["failure_operation"], part["deg"]))
    return (
        f"operation {most['operation']}: {most['carried_mm']:.2f} mm and {most['carried_deg']:.2f} degrees before the "
        f"part was placed, {most['mm']:.2f} and {most['deg']:.2f} in all"
    )


_DETAILS: tuple[tuple[str, str, str | Callable[[Any, TrialRecord], str]], ...] = (
    ("grasp", "scene", "{grasp} grasp, {clearance_mm:g} mm clearance, arm {arm}"),
    ("tried_corrections", "attempts", _list_attempts),
    ("corrected_operations", "corrected operations", _brace),
    ("extra_operations", "extra operations", "{extra_operations} beyond each operation once"),
    ("fit_adjustments", "fit adjustments", _list_adjustments),
    ("failure_prediction", "predicted failure", _describe_prediction),
    ("p_value", "consistency test", _describe_test),
    ("dropped", "dropped", lambda names, _: ", ".join(names)),
    ("least_overlap", "least overlap", "{least_overlap:.2f}"),
    (
        "loose_success",
        "loose verdict",
        lambda loose, _: "every contact is made" if loose else "not every contact is made",
    ),
    (
        "pose_error_fixed_mm",
        "pose error",
        "{pose_error_fixed_mm:.3f} mm fixed by contacts, {pose_error_free_mm:.3f} mm free",
    ),
    (
        "planned_error_fixed_mm",
        "planned error",
        "{planned_error_fixed_mm:.3f} mm fixed by contacts, {planned_error_free_mm:.3f} mm free",
    ),
    ("sim_time_s", "peak force", "{peak_force_n:.1f} N in {sim_time_s:.1f} simulated seconds"),
    (
        "probe_contacts",
        "probing",
        "base error {base_error_estimate_mm:.2f} mm and {base_error_estimate_deg:.2f} degrees (standard deviations "
        "{base_error_std_mm:.2f} and {base_error_std_deg:.2f}) from {probe_contacts} contacts; "
        "{probe_contacts_rejected} more were rejected",
    ),
    ("grasp_slip", "grasp slip", _describe_slip),
)
"""Column -> name and text of a line, if the column has a value."""
