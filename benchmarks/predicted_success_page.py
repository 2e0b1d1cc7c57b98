"""The page of predicted success: numbers and a picture of trials that the calibration never saw."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from apo_bench.geometry import Array
from benchmarks.held_out import CONTACTS
from benchmarks.predicted_success_trials import CALIBRATION, HELD_OUT, Line
from benchmarks.rates_by_condition import table

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "results" / "predicted-success.md"
PICTURE = ROOT / "docs" / "pictures" / "predicted_success.svg"
FIRST = "<!-- predicted success -->"
LAST = "<!-- end of predicted success -->"
BINS = 10
WRONG = ("false-", *CONTACTS)  # in the names of conditions with wrong contacts
LEAST = (0.0, 0.5, 0.8, 0.9, 0.95)  # of `--min-predicted-success`


def write_page(lines: Sequence[Line]) -> None:
    """Write numbers and picture of the held-out trials.

    Args:
        lines: All trials.
    """
    held = [line for line in lines if line["set"] == HELD_OUT]
    planned = [line for line in held if line["predicted"]]
    predicted = np.array([float(line["predicted"]) for line in planned])
    right = np.array([float(line["success"]) for line in planned])
    generated = [line for line in lines if line["set"] == CALIBRATION and line["predicted"]]
    beside = np.array([float(line["predicted"]) for line in generated])
    error = calibration_error(beside, np.array([float(line["success"]) for line in generated]))
    text = "\n".join(
        [
            FIRST,
            "",
            f"The test has {len(planned):,} plans of {len({line['scenario'] for line in planned})} scenarios in "
            f"{len({line['condition'] for line in planned})} conditions. {int(right.sum()):,} of them succeeded. "
            f"{len(held) - len(planned)} further trials had no plan. Over {len(generated):,} plans of generated "
            f"assemblies the calibration error is {error:.3f}.",
            "",
            *table(("measure", "value"), measures(planned, predicted, right)),
            "",
            *table(
                ("`--min-predicted-success`", "executed", "wrong when executed", "right plans left out"),
                [abstain(least, predicted, right) for least in LEAST],
            ),
            "",
            *table(
                ("condition", "plans", "succeeded", "predicted", "ECE", "AUC", "Brier", "of the base rate"),
                conditions(planned, predicted, right),
            ),
            "",
            LAST,
        ]
    )
    before, rest = PAGE.read_text(encoding="utf-8").split(FIRST)
    PAGE.write_text(before + text + rest.split(LAST)[1], encoding="utf-8")
    draw(predicted, right)
    print(f"Wrote {PAGE} and {PICTURE}")


def measures(planned: Sequence[Line], predicted: Array, right: Array) -> list[tuple[str, str]]:
    """Return each measure of the prediction, and its value."""
    wrong = np.array([any(kind in line["condition"] for kind in WRONG) for line in planned])
    whole = [line["condition"] for line in planned]
    return [
        ("calibration error (ECE) in ten bins", f"{calibration_error(predicted, right):.3f}"),
        ("Brier score", f"{np.mean((predicted - right) ** 2):.3f}"),
        ("AUC over all", f"{auc_within([''] * len(planned), predicted, right):.2f}"),
        ("AUC under wrong contacts", f"{auc_within([''] * int(wrong.sum()), predicted[wrong], right[wrong]):.2f}"),
        ("Brier skill over the base rate of condition", f"{100 * skill(whole, predicted, right):.0f} %"),
    ]


def abstain(least: float, predicted: Array, right: Array) -> tuple[str, ...]:
    """Return how many plans are executed, wrong and left out at a value of `--min-predicted-success`."""
    done = predicted >= least
    wrong = 1.0 - right[done].mean() if done.any() else 0.0
    left = right[~done].sum() / max(1.0, right.sum())
    return f"{least:g}", f"{int(done.sum()):,}", f"{100 * wrong:.1f} %", f"{100 * left:.1f} %"


def conditions(planned: Sequence[Line], predicted: Array, right: Array) -> list[tuple[object, ...]]:
    """Return the measures of every condition."""
    names = [line["condition"] for line in planned]
    lines = list[tuple[object, ...]]()
    for name in dict.fromkeys(names):
        own = np.array([each == name for each in names])
        p, y = predicted[own], right[own]
        auc = auc_within([""] * len(p), p, y)
        rates = (f"{100 * y.mean():.0f} %", f"{100 * p.mean():.0f} %", f"{calibration_error(p, y):.3f}")
        base = y.mean() * (1.0 - y.mean())
        brier = (f"{np.mean((p - y) ** 2):.3f}", f"{base:.3f}")
        lines.append((name, own.sum(), *rates, "" if np.isnan(auc) else f"{auc:.2f}", *brier))
    return lines


def bins_of(predicted: Array) -> list[Array]:
    """Return which plans stand in each tenth of probability, (n,) each."""
    number = np.minimum((predicted * BINS).astype(int), BINS - 1)
    return [number == k for k in range(BINS)]


def calibration_error(predicted: Array, right: Array) -> float:
    """Return the distance of success rate and mean prediction over ten bins, weighted by their counts."""
    return float(sum(abs(right[own].sum() - predicted[own].sum()) for own in bins_of(predicted)) / len(right))


def skill(groups: Sequence[str], predicted: Array, right: Array) -> float:
    """Return by what share the Brier score is smaller than that of the rate of the other trials of the group."""
    base = np.empty(len(right))
    for key in set(groups):
        own = np.array([each == key for each in groups])
        others = own.sum() - 1
        # A trial that is alone in its group has no base rate: one half.
        base[own] = (right[own].sum() - right[own]) / others if others else 0.5
    return 1.0 - float(np.mean((predicted - right) ** 2) / np.mean((base - right) ** 2))


def auc_within(groups: Sequence[str], predicted: Array, right: Array) -> float:
    """Return how often a success has a higher prediction than a failure of the same group; half where equal."""
    better = pairs = 0.0
    for key in set(groups):
        own = np.array([each == key for each in groups])
        good = predicted[own & (right > 0.0)]
        bad = predicted[own & (right == 0.0)]
        better += float((good[:, None] > bad).sum() + 0.5 * (good[:, None] == bad).sum())
        pairs += len(good) * len(bad)
    return better / pairs if pairs else float("nan")


def draw(predicted: Array, right: Array) -> None:
    """Draw a reliability diagram, and failures over the share of plans that are executed."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    mpl.rcParams["svg.hashsalt"] = "predicted success"

    figure = Figure(figsize=(9, 4), layout="constrained")
    reliability, risk = figure.subplots(1, 2)
    counted = [own for own in bins_of(predicted) if own.any()]
    x = [predicted[own].mean() for own in counted]
    y = [right[own].mean() for own in counted]
    reliability.plot([0, 1], [0, 1], color="0.7", linewidth=1)
    reliability.plot(x, y, "o-", color="#1f5a8a")
    for a, b, own in zip(x, y, counted, strict=True):
        reliability.annotate(f"{own.sum():,}", (a, b), xytext=(6, -12), textcoords="offset points", fontsize=8)
    reliability.set(
        xlabel="predicted success",
        ylabel="succeeded",
        xlim=(0, 1.1),
        ylim=(-0.05, 1.05),
        title="Reliability, plans per tenth",
    )
    order = np.argsort(-predicted, kind="stable")
    covered = np.arange(1, len(right) + 1) / len(right)
    risk.plot(
        covered, np.cumsum(1.0 - right[order]) / np.arange(1, len(right) + 1), color="#1f5a8a", label="by prediction"
    )
    best = np.cumsum(1.0 - np.sort(right)[::-1]) / np.arange(1, len(right) + 1)
    risk.plot(covered, best, color="0.5", linestyle="--", label="by outcome")
    risk.axhline(1.0 - right.mean(), color="0.7", linewidth=1, label="by chance")
    risk.set(xlabel="share of plans executed", ylabel="wrong when executed", xlim=(0, 1), title="Risk over coverage")
    risk.set_ylim(bottom=0.0)
    risk.legend(frameon=False)
    figure.savefig(PICTURE, metadata={"Date": None, "Creator": None})
