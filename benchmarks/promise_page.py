"""The page of `promise.py`: what promises are worth on trials that the table never saw, in numbers and a picture."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from pathlib import Path

import numpy as np

from apo_bench.geometry import Array
from apo_bench.trial.predicted_success_table import RATES, SCORES
from benchmarks.promise_trials import CALIBRATION, HELD_OUT, Line

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "results" / "promise.md"
PICTURE = ROOT / "docs" / "pictures" / "promise.png"
FIRST = "<!-- promise -->"
LAST = "<!-- end of promise -->"
"""Around what is written into the page."""
BINS = 10
LEAST = (0.5, 0.8, 0.9, 0.95)
"""Of `--min-predicted-success`."""


def write_page(lines: Sequence[Line], scores: Sequence[float] = SCORES, rates: Sequence[float] = RATES) -> None:
    """Numbers and picture of the held-out trials.

    Args:
        scores, rates: The table.
    """
    held = [line for line in lines if line["set"] == HELD_OUT]
    planned = [line for line in held if line["score"]]
    predicted_success = np.interp([float(line["score"]) for line in planned], scores, rates)
    right = np.array([float(line["success"]) for line in planned])
    calibration = [line for line in lines if line["set"] == CALIBRATION and line["score"]]
    made, scenes = (len({line["scenario"] for line in some}) for some in (calibration, planned))
    said = [
        f"Calibrated on {len(calibration):,} plans of {made} generated assemblies; "
        f"held out: {len(planned):,} plans of {scenes} scenarios of the benchmark "
        f"({len(held) - len(planned)} further trials had no plan), of which {int(right.sum()):,} succeeded.",
        "",
        *numbers(planned, predicted_success, right),
        "",
        *abstaining(predicted_success, right),
        "",
        *conditions(planned, predicted_success, right),
    ]
    before, rest = PAGE.read_text(encoding="utf-8").split(FIRST)
    PAGE.write_text(f"{before}{FIRST}\n\n{chr(10).join(said)}\n\n{LAST}{rest.split(LAST)[1]}", encoding="utf-8")
    draw(predicted_success, right)
    print("\n".join(said))
    print(f"Wrote {PAGE} and {PICTURE}")


def condition_of(line: Line) -> Hashable:
    return line["method"], line["noise"], line["noise_mm"], line["robot_error"]


def cell_of(line: Line) -> Hashable:
    return line["scenario"], condition_of(line)


def numbers(planned: Sequence[Line], predicted_success: Array, right: Array) -> list[str]:
    """One line for each number that is asked for."""
    order = np.argsort(predicted_success, kind="stable")
    failures = int((1.0 - right).sum())
    caught = float((1.0 - right)[order[:failures]].sum()) / max(1, failures)
    cells: Mapping[str, Callable[[Line], Hashable]] = {
        "condition": condition_of,
        "scenario and condition": cell_of,
    }
    made = [
        "| | measured | asked |",
        "|---|---|---|",
        f"| calibration error (ECE) in ten bins | {calibration_error(predicted_success, right):.3f} | 0.05 at most |",
        f"| Brier score | {np.mean((predicted_success - right) ** 2):.3f} | |",
    ]
    for what, cell in cells.items():
        keys = [cell(line) for line in planned]
        made.append(
            f"| Brier, better than the base rate of {what} by | {100 * skill(keys, predicted_success, right):.0f} % | 20 % |"
        )
        made.append(f"| AUC within {what} | {within(keys, predicted_success, right):.2f} | 0.75 |")
    return [
        *made,
        f"| AUC over all | {within([0] * len(planned), predicted_success, right):.2f} | |",
        f"| of {failures} failures, among the {failures} least promised | {100 * caught:.0f} % | 60 % |",
    ]


def abstaining(predicted_success: Array, right: Array) -> list[str]:
    """What is executed, wrong and left out at some values of `--min-predicted-success`."""
    made = [
        "| `--min-predicted-success` | executed | wrong when executed | right plans that are left out |",
        "|---|---|---|---|",
    ]
    for least in (0.0, *LEAST):
        done = predicted_success >= least
        wrong = 1.0 - right[done].mean() if done.any() else 0.0
        left = right[~done].sum() / max(1.0, right.sum())
        made.append(f"| {least:g} | {int(done.sum()):,} | {100 * wrong:.1f} % | {100 * left:.1f} % |")
    return made


def conditions(planned: Sequence[Line], predicted_success: Array, right: Array) -> list[str]:
    """Rate and mean promise of every condition."""
    made = [
        "| method | noise | level | robot error | plans | succeeded | promised | AUC |",
        "|---|---|---|---|---|---|---|---|",
    ]
    keys = [condition_of(line) for line in planned]
    for key in dict.fromkeys(keys):
        own = np.array([each == key for each in keys])
        method, noise, noise_mm, error = key
        auc = within([0] * int(own.sum()), predicted_success[own], right[own])
        noise = noise.split(":")[-1].removeprefix("benchmarks/")
        made.append(
            f"| `{method}` | {noise} | {noise_mm} | {error} | {own.sum()} | {100 * right[own].mean():.0f} % | "
            f"{100 * predicted_success[own].mean():.0f} % | {'–' if np.isnan(auc) else f'{auc:.2f}'} |"
        )
    return made


def bins_of(predicted_success: Array) -> list[Array]:
    """Which plans stand in each tenth of probability, (n,) each."""
    number = np.minimum((predicted_success * BINS).astype(int), BINS - 1)
    return [number == k for k in range(BINS)]


def calibration_error(predicted_success: Array, right: Array) -> float:
    """Mean distance of rate and mean promise over ten bins, by how many stand there."""
    return float(
        sum(abs(right[own].sum() - predicted_success[own].sum()) for own in bins_of(predicted_success)) / len(right)
    )


def skill(keys: Sequence[Hashable], predicted_success: Array, right: Array) -> float:
    """By what share the Brier score is smaller than that of the rate of the other trials of the cell."""
    base = np.empty(len(right))
    for key in set(keys):
        own = np.array([each == key for each in keys])
        others = own.sum() - 1
        # of a trial alone in its cell nothing is known
        base[own] = (right[own].sum() - right[own]) / others if others else 0.5
    return 1.0 - float(np.mean((predicted_success - right) ** 2) / np.mean((base - right) ** 2))


def within(keys: Sequence[Hashable], predicted_success: Array, right: Array) -> float:
    """How often, of a success and a failure of one cell, the success was promised more; half where both are equal."""
    better = pairs = 0.0
    for key in set(keys):
        own = np.array([each == key for each in keys])
        good = predicted_success[own & (right > 0.0)]
        bad = predicted_success[own & (right == 0.0)]
        better += float((good[:, None] > bad).sum() + 0.5 * (good[:, None] == bad).sum())
        pairs += len(good) * len(bad)
    return better / pairs if pairs else float("nan")


def draw(predicted_success: Array, right: Array) -> None:
    """A reliability diagram, and failures over what is executed."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4), layout="constrained")
    reliability, risk = figure.subplots(1, 2)
    counted = [own for own in bins_of(predicted_success) if own.any()]
    x = [predicted_success[own].mean() for own in counted]
    y = [right[own].mean() for own in counted]
    reliability.plot([0, 1], [0, 1], color="0.7", linewidth=1)
    reliability.plot(x, y, "o-", color="#1f5a8a")
    for a, b, own in zip(x, y, counted, strict=True):
        reliability.annotate(f"{own.sum():,}", (a, b), xytext=(6, -12), textcoords="offset points", fontsize=8)
    reliability.set(
        xlabel="predicted_success",
        ylabel="succeeded",
        xlim=(0, 1.05),
        ylim=(0, 1.05),
        title="Reliability, plans per tenth",
    )
    order = np.argsort(-predicted_success, kind="stable")
    covered = np.arange(1, len(right) + 1) / len(right)
    risk.plot(
        covered, np.cumsum(1.0 - right[order]) / np.arange(1, len(right) + 1), color="#1f5a8a", label="by promise"
    )
    best = np.cumsum(1.0 - np.sort(right)[::-1]) / np.arange(1, len(right) + 1)
    risk.plot(covered, best, color="0.5", linestyle="--", label="by the truth")
    risk.axhline(1.0 - right.mean(), color="0.7", linewidth=1, label="by chance")
    risk.set(xlabel="share of plans executed", ylabel="wrong when executed", xlim=(0, 1), title="Risk over coverage")
    risk.set_ylim(bottom=0.0)
    risk.legend(frameon=False)
    PICTURE.parent.mkdir(exist_ok=True)
    figure.savefig(PICTURE, dpi=110, metadata={"Software": None})
