"""One trial, as a person reads it: from what was asked to how it ended."""

from collections.abc import Iterable, Iterator, Sequence

from rich.table import Table

from apo_bench.benchmark.analysis import noise_label
from apo_bench.cli.printing import console
from apo_bench.io import clean
from apo_bench.records import SETTINGS, FreedSet, MovedInHand, Predicted, TrialRecord, look_up, probes
from apo_bench.trial.predicted_success import predicted_success_sentence

_SAID = (
    "pose_source",
    "noise",
    "contact_source",
    "max_reobservations",
    "robot_error",
    "min_predicted_success",
    "ft_sensor",
    "assumed_robot_error",
)
"""Settings that are said if they are not as usual; the last two only of robots that feel."""

_MEASURED = (
    ("gap_before_mm", "contact gap", "{gap_before_mm:.3f} mm as seen"),
    ("gap_after_mm", "planned gap", "{gap_after_mm:.3f} mm"),
    ("worst_gap_mm", "reached", "least overlap {least_overlap:.2f}, worst gap {worst_gap_mm:.3f} mm"),
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
        "touches",
        "felt",
        "its base is off by {felt_mm:.2f} mm and {felt_deg:.2f} degrees (deviations {felt_sure_mm:.2f} and "
        "{felt_sure_deg:.2f}): {touches} touches, {touches_refused} more refused",
    ),
)
"""Column -> name and text of a line, if the column has a value."""


def print_row(row: TrialRecord) -> None:
    """Print a line for everything that is known of a trial."""
    table = Table(show_header=False, box=None, pad_edge=False)
    for name, text in _lines(row):
        table.add_row(clean(name), clean(text))
    console().print(table)


def _lines(row: TrialRecord) -> Iterator[tuple[str, str]]:
    yield "scenario", f"{row['scenario']}, {row['grasp']} grasp, {row['clearance_mm']:g} mm clearance"
    yield "trial", "measured observation" if row["noise_mm"] is None else ", ".join(_settings(row))
    yield "method", row["method"]
    yield "result", _result(row)
    yield "ended", row["sentence"] or ""
    for attempt in row["tried_corrections"] or ():
        yield f"after step {attempt['step']}", _attempt(attempt)
    if row["corrected_operations"]:
        yield "corrected operations", _braced(row["corrected_operations"])
    if row["extra_operations"]:
        yield "schedule", f"{row['extra_operations']} operations beyond doing each once"
    if row["fit_adjustments"]:
        moved = ", ".join(f"operation {move['operation']} by {move['mm']:.1f} mm" for move in row["fit_adjustments"])
        yield "free directions", f"{moved}, so that the plan fits"
    if row["failure_prediction"] is not None:
        yield "failure prediction", _predicted(row["failure_prediction"])
    if (predicted_success := row.get("predicted_success")) is not None:
        yield "predicted success", predicted_success_sentence(predicted_success)
    if row["loose_success"] is False and row["worst_gap_mm"] is not None:
        yield "contacts", "not every contact was made, even loosely"
    if row["p_value"] is not None:
        yield "consistency test", _test(row)
    for column, name, template in _MEASURED:
        if row.get(column) is not None:
            yield name, template.format_map(row)
    if row["grasp_slip"]:
        yield "grasp slip", _in_hand(row["grasp_slip"], row["failure_operation"])


def _settings(row: TrialRecord) -> Iterator[str]:
    """`noise level 2`, `human error scale 1`, `seed 5`, then settings that are not the default."""
    yield f"noise level {noise_label(row['noise_mm'] or 0.0, row['noise_deg'] or 0.0, row['noise'])}"
    yield f"human error scale {row['human_error_scale']:g}"
    yield f"seed {row['seed']}"
    for name in _SAID if probes(row["method"]) else _SAID[:-2]:
        value = look_up(row, name) or SETTINGS[name].default
        if value != SETTINGS[name].default:
            yield f"{name.replace('_', ' ')} {value}"


def _in_hand(moved: Sequence[MovedInHand], failed: int | None) -> str:
    """Of the operation that failed, where its part was held, else of the part that turned most."""
    most = max(moved, key=lambda part: (part["operation"] == failed, part["deg"]))
    before = f"{most['carried_mm']:.2f} mm and {most['carried_deg']:.2f} degrees before it was put to its place"
    return f"the part of operation {most['operation']} moved {before}, {most['mm']:.2f} and {most['deg']:.2f} in all"


def _attempt(attempt: FreedSet) -> str:
    left = "did not come to rest" if attempt["gap_mm"] is None else f"leaves {attempt['gap_mm']:.3f} mm"
    return f"{_braced(attempt['free'])} {left}"


def _braced(operations: Iterable[int]) -> str:
    """`{5,4,3}`, as the paper writes sets of operations."""
    return "{" + ",".join(map(str, operations)) + "}"


def _predicted(outcome: Predicted) -> str:
    if not outcome["fails"]:
        return f"it fits, {outcome['size_mm']:.2f} mm off at most"
    size = "" if outcome["size_mm"] is None else f", {outcome['size_mm']:.2f} mm"
    return f"operation {outcome['operation']} fails: {outcome['code']}{size}"


def _test(row: TrialRecord) -> str:
    """`chi-square 31.2 of 13, p 0.003: not explained by the stated noise; one of R2, R4 may be wrong; left out: R2`."""
    explained = f"{'' if row['test_passes'] else 'not '}explained by the stated noise"
    p = f"p {row['p_value']:.2g}" if row["p_value"] else "p < 1e-300"
    parts = [f"chi-square {row['chi_square'] or 0.0:.1f} of {row['chi_square_dof']}, {p}: {explained}"]
    if row["suspects"]:
        parts.append(f"{'one of ' * (len(row['suspects']) > 1)}{', '.join(row['suspects'])} may be wrong")
    if row["dropped"]:
        parts.append(f"left out: {', '.join(row['dropped'])}")
    return "; ".join(parts)


def _result(row: TrialRecord) -> str:
    if row["success"] is None:
        return "none: the demonstration failed"
    if row["success"]:
        return "success" if row["as_demonstrated"] else f"success, not as demonstrated: {row['as_demonstrated_code']}"
    loosely = ", loosely right" if row["loose_success"] else ""
    where = "" if row["failure_operation"] is None else f", operation {row['failure_operation']}"
    return f"failure at stage {row['failure_stage']}: {row['failure_code']}{where}{loosely}"
