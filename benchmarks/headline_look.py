"""The first look at the headline: one sentence and one figure, the same on README, Start and the page of the headline.

Rates are pooled over the scenarios of the sweep: as seen (`none`), searched (`search`), corrected (`contact-robust`),
and where that breaks: noise with outliers, and errors of the robot itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from apo_bench.benchmark.analysis import Cell, Rate
from apo_bench.records import TrialConfig

TOLD_LEVEL = 1.0
"""Of the sentence, and of where it breaks: mm and degrees."""
ERROR = "hand_eye:0.5/0.1"
"""The robot error of the sentence."""
MEASURED = "megapose-tless"
NOISES = {
    "outliers": "10 % of the poses ten times as wrong",
    MEASURED: "poses as a pose estimator sees them (MegaPose)",
}
WORDS = {
    "oracle": "the truth, replayed",
    "uncorrected": "as seen",
    "spiral-search": "searched",
    "snap": "snapped",
    "nominal": "by heart",
    "paper": "paper",
    "contact": "corrected",
    "contact-robust": "corrected",
    "contact-robust+spiral": "corrected and searched",
}


class Look(NamedTuple):
    """What the sentence and the figure are made of."""

    cells: Sequence[Cell]
    corrected: str
    """`contact-robust`, or `contact` of rows that lack it."""


def look_at(cells: Sequence[Cell]) -> Look:
    methods = {cell.method for cell in cells}
    return Look(cells, "contact-robust" if "contact-robust" in methods else "contact")


def pooled(
    cells: Iterable[Cell],
    method: str,
    noise_mm: float,
    noise: str = TrialConfig.noise,
    robot_error: str = TrialConfig.robot_error,
    scenarios: Iterable[str] | None = None,
) -> Rate | None:
    """Success of a method over scenarios, careful humans; None where it did not run."""
    wanted = None if scenarios is None else set(scenarios)
    here = [
        cell
        for cell in cells
        if (cell.method, cell.noise_mm, cell.human_error_scale) == (method, noise_mm, 0.0)
        and (cell.noise, cell.robot_error) == (noise, robot_error)
        and (wanted is None or cell.scenario in wanted)
    ]
    rate = Rate(sum(cell.successes for cell in here), sum(cell.trials for cell in here))
    return rate if rate.trials else None


def robot_rate(look: Look, method: str, error: str) -> Rate | None:
    """Success in the scenarios that were run with errors of the robot; the oracle meets no noise."""
    noise_mm = 0.0 if method == "oracle" else TOLD_LEVEL
    return pooled(look.cells, method, noise_mm, robot_error=error, scenarios=robot_scenarios(look.cells))


def robot_scenarios(cells: Iterable[Cell]) -> list[str]:
    return sorted({cell.scenario for cell in cells if cell.robot_error != TrialConfig.robot_error})


def percent(rate: Rate | None) -> str | None:
    return None if rate is None or rate.rate is None else f"{100 * rate.rate:.0f} %"


def sentence(look: Look) -> str:
    """What came out and where it breaks; what was not run is not said."""
    seen, searched, corrected = (
        percent(pooled(look.cells, method, TOLD_LEVEL)) for method in ("uncorrected", "spiral-search", look.corrected)
    )
    told = (
        f"When poses are seen {TOLD_LEVEL:g} mm and {TOLD_LEVEL:g} degree wrong, a robot finishes **{seen}** of the "
        f"assemblies as seen, **{searched}** when it also searches for the holes, and **{corrected}** when face "
        "contacts correct the poses first"
    )
    breaks = []
    measured = percent(pooled(look.cells, look.corrected, TOLD_LEVEL, noise=MEASURED))
    if measured:
        breaks.append(
            "with a pose estimator that misses a quarter of the parts and is far off in a quarter of the others "
            f"(**{measured}**)"
        )
    robot, both = (percent(robot_rate(look, f"{look.corrected}{more}", ERROR)) for more in ("", "+spiral"))
    if robot:
        also = f", with a search as well **{both}**" if both else ""
        breaks.append(f"with a robot that is half a millimetre off itself (**{robot}**{also})")
    return f"{told}; this breaks {', and '.join(breaks)}." if breaks else f"{told}."


def caption(look: Look) -> str:
    """What the figure shows, and of how many seeds."""
    plain = [
        cell
        for cell in look.cells
        if (cell.method, cell.noise_mm, cell.human_error_scale) == ("uncorrected", TOLD_LEVEL, 0.0)
    ]
    plain = [cell for cell in plain if cell.noise == TrialConfig.noise]
    seeds = max(cell.trials + cell.excluded for cell in plain)
    methods = {cell.method for cell in look.cells}
    names = ("uncorrected", "spiral-search", "snap", "nominal", look.corrected, "oracle")
    named = "; ".join(f"{WORDS[method]}: `{method}`" for method in names if method in methods)
    return (
        f"*Success in {len(plain)} tasks of the paper, {seeds} seeds each, with 95 % intervals. Errors are standard "
        "deviations per axis (1 mm and 1 degree where it breaks); 0.25 mm of play per side; a careful person. "
        f"{named[0].upper()}{named[1:]}.*"
    )


def block(look: Look, pictures: str, page: str | None) -> list[str]:
    """Sentence, figure and caption as Markdown; `pictures` is the folder, `page` where all numbers are."""
    more = f" [All numbers]({page})." if page else ""
    return [
        sentence(look),
        "",
        f"![Success over the error of the poses, and where the correction breaks]({pictures}/headline.png)",
        "",
        caption(look) + more,
    ]
