"""The headline in a few sentences and one figure, the same on the start page and on the page of the headline.

Rates are pooled over the scenarios of the sweep: observed poses (`uncorrected`), a spiral search (`spiral-search`),
corrected poses (`contact-robust`), and the limits of these: outliers, and errors of the robot itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from apo_bench.benchmark.analysis import ConditionResult, Rate
from apo_bench.records import TrialConfig

NOISE = 1.0  # mm and degrees, of the sentence and of both limits
ROBOT_ERROR = "hand_eye:0.5/0.1"  # of the sentence
MEASURED = "megapose-tless"
NOISES = {"outliers": "10 % of the errors ten times as large", MEASURED: "a measured pose estimator (MegaPose)"}


class Summary(NamedTuple):
    """The conditions of a headline."""

    cells: Sequence[ConditionResult]
    corrected: str
    """`contact-robust`, or `contact` of a sweep without it."""


def summarise(cells: Sequence[ConditionResult]) -> Summary:
    """Choose the method that stands for corrected poses."""
    methods = {cell.method for cell in cells}
    return Summary(cells, "contact-robust" if "contact-robust" in methods else "contact")


def pool(
    cells: Iterable[ConditionResult],
    method: str,
    noise_mm: float,
    noise: str = TrialConfig.noise,
    robot_error: str = TrialConfig.robot_error,
    scenarios: Iterable[str] | None = None,
) -> Rate | None:
    """Return the success of a method over scenarios, without human error; None where it did not run."""
    wanted = None if scenarios is None else set(scenarios)
    own = [
        cell
        for cell in cells
        if (cell.method, cell.noise_mm, cell.human_error_scale) == (method, noise_mm, 0.0)
        and (cell.noise, cell.robot_error) == (noise, robot_error)
        and (wanted is None or cell.scenario in wanted)
    ]
    rate = Rate(sum(cell.successes for cell in own), sum(cell.trials for cell in own))
    return rate if rate.trials else None


def robot_rate(summary: Summary, method: str, error: str) -> Rate | None:
    """Return the success in the scenarios with errors of the robot; the oracle meets no noise."""
    noise_mm = 0.0 if method == "oracle" else NOISE
    return pool(summary.cells, method, noise_mm, robot_error=error, scenarios=robot_scenarios(summary.cells))


def robot_scenarios(cells: Iterable[ConditionResult]) -> list[str]:
    """Return the scenarios that ran with errors of the robot."""
    return sorted({cell.scenario for cell in cells if cell.robot_error != TrialConfig.robot_error})


def sentence(summary: Summary) -> str:
    """Return the result and its limits; what did not run is left out."""
    observed, searched, corrected = (
        _percent(pool(summary.cells, method, NOISE)) for method in ("uncorrected", "spiral-search", summary.corrected)
    )
    result = (
        f"With pose noise of {NOISE:g} mm, {NOISE:g} degree (1 sigma per axis) the replay of the observed poses "
        f"succeeds in **{observed}** of the trials, with a spiral search in **{searched}**. Corrected by face contacts "
        f"it succeeds in **{corrected}**."
    )
    limits = []
    measured = pool(summary.cells, summary.corrected, NOISE, noise=MEASURED)
    if measured:
        limits.append(
            f"**{_percent(measured)}** with a pose estimator that misses a quarter of the parts and has gross errors "
            "in a quarter of the others"
        )
    robot, both = (robot_rate(summary, f"{summary.corrected}{more}", ROBOT_ERROR) for more in ("", "+spiral"))
    if robot:
        also = f" (**{_percent(both)}** with a search)" if both else ""
        limits.append(f"**{_percent(robot)}**{also} with a robot error of 0.5 mm")
    return f"{result} The limits: {', and '.join(limits)}." if limits else result


def _percent(rate: Rate | None) -> str:
    return "" if rate is None else f"{100 * rate.successes / rate.trials:.0f} %"


def caption(summary: Summary) -> str:
    """Return what the figure shows."""
    plain = [
        cell
        for cell in summary.cells
        if (cell.method, cell.noise_mm, cell.human_error_scale) == ("uncorrected", NOISE, 0.0)
        and cell.noise == TrialConfig.noise
    ]
    seeds = max(cell.trials + cell.excluded for cell in plain)
    return (
        f"*Success in {len(plain)} tasks of the paper, {seeds} seeds each, with 95 % intervals. Noise is a standard "
        "deviation per axis (1 mm and 1 degree in both panels of limits); clearance of 0.25 mm per side; no human "
        "error except in the table. Where lines coincide, the thinner one is above the wider one.*"
    )


def block(summary: Summary, pictures: str, page: str | None) -> list[str]:
    """Return sentence, figure and caption in Markdown.

    Args:
        pictures: Folder of the figure.
        page: Page with all numbers, if another one.
    """
    more = f" [All numbers]({page})." if page else ""
    return [
        sentence(summary),
        "",
        f"![Success over the error of the poses, and its limits]({pictures}/headline.svg)",
        "",
        caption(summary) + more,
    ]
