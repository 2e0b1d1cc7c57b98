"""The page of the headline: the summary, all rates, the limits, and what ran."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from apo_bench.benchmark.analysis import ConditionResult, PairedComparison, Rate, compute_wilson_interval
from apo_bench.benchmark.report.comparison.compare import compare
from apo_bench.benchmark.sweeps.grid import describe_grids, load_all
from apo_bench.benchmark.sweeps.sweep_file import read_sweep
from apo_bench.records import SETTINGS, TrialConfig, is_uncorrected
from benchmarks.headline_summary import NOISE, Summary, block, robot_scenarios
from benchmarks.rates_by_condition import counted, table

GRID = Path(__file__).with_name("headline.toml")
METHODS = ("uncorrected", "spiral-search", "snap", "nominal", "paper", "contact", "contact-robust")
COMPARED = ("contact", "contact-robust")  # with `paper`, seed by seed
ROBOT_METHODS = {"oracle": 0.0, "contact-robust": NOISE, "contact-robust+spiral": NOISE}
"""Methods that ran with errors of the robot, and their noise in mm and degrees."""
OUTLIERS = (
    f"Noise of {NOISE:g} mm and degree, no human error. `outliers` makes 10 % of the errors ten times as large and "
    "misses 2 % of the operations. `megapose-tless` was measured on a pose estimator: it misses 26 % of the parts and "
    "has gross errors in 24 % of the others ([noise models](../reference/noise-models.md)). Most methods do not "
    "correct if an operation was not observed."
)
ROBOT = (
    f"Noise of {NOISE:g} mm and degree, no human error. Every trial draws a [robot "
    "error](../guide/robot-error.md#errors-of-the-robot), in standard deviations, mm and degrees. Contacts correct the "
    "errors of the camera, not those of the robot: `oracle`, which has the true poses, fails as well."
)
OLDER = " **`benchmarks/headline.toml` has changed since.**"
Words = Callable[[ConditionResult], tuple[str, ...]]


def page(
    summary: Summary, pairs: Sequence[PairedComparison], ran: Mapping[str, Any], fidelity: Sequence[str]
) -> list[str]:
    """Return the lines of the page."""
    least = min(cell.trials for cell in summary.cells)
    plain = [c for c in summary.cells if c.noise == TrialConfig.noise and c.robot_error == TrialConfig.robot_error]
    main = sorted((c for c in plain if c.method in METHODS), key=_order)
    outliers = sorted((c for c in summary.cells if c.noise != TrialConfig.noise), key=_order)
    robot = sorted((c for c in summary.cells if _is_of_robot(c, robot_scenarios(summary.cells))), key=_robot_order)
    other = [c for c in plain if c.method not in (*METHODS, *ROBOT_METHODS)]
    oracle = [c for c in plain if c.method == "oracle"]
    return [
        "# The headline",
        "",
        *block(summary, "../pictures", None),
        "",
        "## All rates",
        "",
        "Success in percent ([the judge](../how/judge.md)); in brackets: also built as demonstrated, where that is "
        "less. Columns are the noise in mm and degrees (1 sigma per axis). All [methods](../reference/methods.md) have "
        f"the same seeds. {_widths(least)} `benchmarks/results/headline/table.csv` has all intervals.",
        "",
        "### Without human error",
        "",
        *rates([c for c in main if c.human_error_scale == 0.0], ("scenario", "method"), _name, lambda c: c.noise_mm),
        "",
        "### With human error",
        "",
        "The human puts parts 1.5 to 4 mm aside and adjusts them later, as in the paper. The clearance is 0.25 mm, so "
        "`uncorrected` fails. A search cannot move a part that stands aside.",
        "",
        *rates([c for c in main if c.human_error_scale == 1.0], ("scenario", "method"), _name, lambda c: c.noise_mm),
        "",
        *_section("## Limits: outliers", OUTLIERS, "noise", lambda c: (f"`{c.noise}`", f"`{c.method}`"), outliers),
        *_section(
            "## Limits: the robot's own error",
            ROBOT,
            "robot error",
            lambda c: (f"`{c.robot_error}`", f"`{c.method}`"),
            robot,
        ),
        "## Other methods at 2 mm and degrees, with human error",
        "",
        *rates(other, ("method",), lambda c: (f"`{c.method}`",), lambda c: c.scenario),
        "",
        f"Without any error `oracle`, which has the true poses, succeeds in {sum(c.successes for c in oracle)} of "
        f"{sum(c.trials for c in oracle)} trials.",
        "",
        "## Pairs",
        "",
        *_differences(pairs),
        "",
        "## Measurement",
        "",
        _describe_run(ran, least),
        "",
        *fidelity,
    ]


def rates(
    cells: Sequence[ConditionResult], heads: Sequence[str], row: Words, column: Callable[[ConditionResult], Hashable]
) -> list[str]:
    """Return a table of success in percent: a line per `row`, in the order of the cells, and a column per `column`."""
    columns = sorted({column(cell) for cell in cells}, key=lambda name: (isinstance(name, str), name))
    found: dict[tuple[str, ...], dict[Hashable, str]] = {}
    for cell in cells:
        found.setdefault(row(cell), {})[column(cell)] = _both(cell)
    names = [f"{name:g}" if isinstance(name, float) else str(name) for name in columns]
    lines = [(*words, *(own.get(name, "") for name in columns)) for words, own in found.items()]
    return table((*heads, *names), lines)


def _both(cell: ConditionResult) -> str:
    success, demonstrated = (f"{100 * (rate or 0.0):.0f}" for rate in (cell.rate, cell.demonstrated_rate))
    return success if success == demonstrated else f"{success} ({demonstrated})"


def _widths(trials: int) -> str:
    low, half, high = (compute_wilson_interval(round(share * trials), trials) for share in (0.0, 0.5, 1.0))
    return (
        f"Wilson's 95 % intervals at {trials} trials: 0 % is 0 to {100 * low.high:.0f} %, 50 % is "
        f"{100 * half.low:.0f} to {100 * half.high:.0f} %, 100 % is {100 * high.low:.0f} to 100 %."
    )


def _section(title: str, text: str, head: str, row: Words, cells: Sequence[ConditionResult]) -> list[str]:
    """Return a table with a column per scenario, and one of all with its interval."""
    lines = rates(cells, (head, "method"), row, lambda cell: cell.scenario)
    groups: dict[tuple[str, ...], list[ConditionResult]] = {}
    for cell in cells:
        groups.setdefault(row(cell), []).append(cell)
    pooled = [Rate(sum(c.successes for c in own), sum(c.trials for c in own)) for own in groups.values()]
    added = [" all |", "---|", *(f" {counted(rate)} |" for rate in pooled)]
    return [title, "", text, "", *map("".join, zip(lines, added, strict=True)), ""]


def _differences(pairs: Sequence[PairedComparison]) -> list[str]:
    compared = [
        p for p in pairs if p.condition.method in COMPARED and not is_uncorrected(p.condition.method) and p.pairs
    ]
    apart = [p for p in compared if p.only_method or p.only_reference]
    lines = []
    for p in apart:
        low, high = (100 * x for x in p.interval)
        human = f"{p.condition.human_error_scale:g}"
        difference = f"{100 * (p.difference or 0.0):+.1f} ({low:+.1f} to {high:+.1f})"
        place = (p.condition.scenario, human, f"{p.condition.noise_mm:g}", p.condition.noise, f"`{p.condition.method}`")
        lines.append((*place, p.pairs, p.only_method, p.only_reference, difference, f"{p.p_adjusted:.2g}"))
    heads = ("scenario", "human error", "noise, mm", "noise model", "method", "pairs", "it alone", "`paper` alone")
    return [
        f"Corrected poses and those of `paper` over the same seeds, in the {len(apart)} of {len(compared)} conditions "
        "in which any seed ends differently. *It alone* and *`paper` alone* count the seeds at which one method alone "
        "succeeded. The difference is in points with Tango's 95 % interval; p is McNemar's, adjusted for all (Holm).",
        "",
        *table((*heads, "difference", "p adjusted"), lines),
    ]


def _describe_run(ran: Mapping[str, Any], least: int) -> str:
    versions = ran["versions"]
    return (
        f"Written by `python benchmarks/headline.py` from the trials of `{ran['command']}`: {ran['rows']} trials, at "
        f"least {least} in each condition. Friction grasp, clearance of 0.25 mm per side, fidelity "
        f"`{ran['grids'][0]['fidelity']}`. {ran['workers']} process(es) simulated {ran['simulated_hours']} hours in "
        f"{ran['worker_hours'] / ran['workers']:.2f}. MuJoCo {versions['mujoco']}, mink {versions['mink']}, NumPy "
        f"{versions['numpy']}, Python {ran['python']}. `benchmarks/results/headline/run.json` has the rest, and "
        f"`rows.jsonl.xz` there the trials.{'' if is_up_to_date(ran) else OLDER}"
    )


def is_up_to_date(ran: Mapping[str, Any]) -> bool:
    """Return whether the trials are those of the sweep file as it is now."""
    first = ran["grids"][0]
    grids = read_sweep(GRID, {"trials": first["trials"], "fidelity": first["fidelity"]})
    # The committed sweep is older than these settings.
    usual = {name: [SETTINGS[name].default] for name in ("ft_sensor", "assumed_robot_error", "min_predicted_success")}
    return describe_grids(grids, load_all(grids)) == [{**usual, **grid} for grid in ran["grids"]]


def describe_fidelity(full: Path, near_contact: Path) -> list[str]:
    """Return how far verdicts at fidelity near-contact are those at fidelity full."""
    lines = []
    for a in compare(full, near_contact).agreements:
        low, high = a["same_verdict_low_95"], a["same_verdict_high_95"]
        verdicts = f"{a['same_verdict']} ({100 * (a['same_verdict_rate'] or 0):.1f} %)"
        alone = (a["right_in_first_alone"], a["right_in_second_alone"])
        seeds = f"{a['same_verdicts_in_all']} of {a['seeds']}"
        interval = f"{100 * low:.1f} to {100 * high:.1f} %"
        lines.append((a["scenario"], a["trials"], verdicts, interval, a["same_stage_and_code"], *alone, seeds))
    heads = ("scenario", "trials", "same verdict", "interval", "same ending")
    return [
        "## Fidelity",
        "",
        "The same trials at fidelity `full`: how many have the same verdict (with Wilson's 95 % interval), and how "
        "many the same verdict, stage and code. The last column counts the seeds with the same verdict in all trials.",
        "",
        *table((*heads, "right at `full` alone", "right at `near-contact` alone", "seeds"), lines),
    ]


def _order(cell: ConditionResult) -> tuple[Any, ...]:
    method = (*METHODS, cell.method).index(cell.method)
    return cell.human_error_scale, cell.noise, cell.scenario, method, cell.noise_mm


def _robot_order(cell: ConditionResult) -> tuple[Any, ...]:
    return cell.robot_error != TrialConfig.robot_error, cell.robot_error, [*ROBOT_METHODS].index(cell.method)


def _is_of_robot(cell: ConditionResult, scenarios: Iterable[str]) -> bool:
    """Return whether a condition has an error of the robot, or is the same without one."""
    same = cell.scenario in scenarios and cell.noise == TrialConfig.noise and cell.human_error_scale == 0.0
    return same and ROBOT_METHODS.get(cell.method) == cell.noise_mm


def _name(cell: ConditionResult) -> tuple[str, ...]:
    return cell.scenario, f"`{cell.method}`"
