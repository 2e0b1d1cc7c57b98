"""The headline: for every setting a matrix of methods over levels, with a button for each cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from apo_bench.records.method import knows_truth
from apo_bench.report.page.markup import Html, joined, tag
from apo_bench.statistics.rate_text import interval, percent
from apo_bench.statistics.rates import Cell, Place
from apo_bench.statistics.settings import Setting, at, level_of, level_unit, level_words, levels_of

MANY = 12
"""With more settings than this, those of a scenario are folded."""


def matrices(grouped: Mapping[Setting, Sequence[Cell]], numbers: Mapping[Place, int]) -> Html:
    """One table per setting.

    Args:
        grouped: From `members`.
        numbers: Cell's place -> its number among all cells.
    """
    opened: set[int] = set()
    made = {s: joined([tag("h3", s.title()), _matrix(s, cells, numbers, opened)]) for s, cells in grouped.items()}
    return joined(made.values()) if len(made) <= MANY else folded(made)


def folded(made: Mapping[Setting, Html]) -> Html:
    """What there is of each setting, by scenario: one of them unfolded."""
    by_scenario: dict[str, list[Html]] = {}
    for setting, piece in made.items():
        by_scenario.setdefault(setting.scenario, []).append(piece)
    return joined(
        tag("details", tag("summary", f"{name}: {len(own)} settings"), *own, **({"open": ""} if i == 0 else {}))
        for i, (name, own) in enumerate(by_scenario.items())
    )


def _matrix(setting: Setting, cells: Sequence[Cell], numbers: Mapping[Place, int], opened: set[int]) -> Html:
    levels = levels_of(cells)
    spread = max(1, len(levels))
    words = [level_words(level, setting.noise) for level in levels] or ["any"]
    corner = tag("th", f"method, {level_unit(setting.noise)}" if levels else "method", scope="col")
    head = tag("tr", corner, *(tag("th", word, scope="col", class_="number") for word in words))
    lines = []
    for method in dict.fromkeys(c.method for c in cells):
        own = {level_of(c): c for c in cells if c.method == method}
        if knows_truth(method):
            (ceiling,) = own.values()
            boxes = [tag("td", _button(ceiling, setting, numbers, opened), colspan=spread)]
        else:
            boxes = [
                tag("td", _button(own[level], setting, numbers, opened))
                if level in own
                else tag("td", "not run", class_="gone")
                for level in levels
            ]
        lines.append(tag("tr", tag("th", method, scope="row"), *boxes))
    table = tag("table", tag("thead", head), tag("tbody", *lines), class_="matrix")
    return tag("div", table, class_="scroll", tabindex=0, role="region", aria_label=setting.title())


def _button(cell: Cell, setting: Setting, numbers: Mapping[Place, int], opened: set[int]) -> Html:
    """What a cell says; a cell that stands in several matrices has its anchor in the first."""
    number = numbers[at(cell)]
    level = "" if knows_truth(cell.method) else f", level {level_words(level_of(cell), cell.noise)}"
    said = f"{cell.method}{level}: {percent(cell.rate)}, {cell.successes} of {cell.trials}"
    anchor = None if number in opened else f"cell-{number}"
    opened.add(number)
    tip = f"{setting.title()}; {said}; 95 %: {interval(cell)}; excluded {cell.excluded}"
    small = [tag("small", interval(cell)), tag("small", f"n {cell.trials}")]
    if cell.demonstrated != cell.successes:
        small.append(tag("small", f"as demonstrated: {percent(cell.demonstrated_rate)}"))
    if cell.not_executed:
        done = cell.executed
        small.append(
            tag("small", f"executed: {percent(done.rate)}, n {done.trials}" if done.trials else "none executed")
        )
    return tag(
        "button",
        *(tag("b", percent(cell.rate)), *small),
        type="button",
        class_="cell",
        id=anchor,
        data_cell=number,
        data_title=f"{setting.title()}: {said}",
        title=tip,
        aria_expanded="false",
        style=f"--share:{cell.rate or 0.0:.3f}",
    )
