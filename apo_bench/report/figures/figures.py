"""The figures of a sweep: panels with a legend, for the page and for files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from apo_bench.records.method import knows_truth
from apo_bench.report.figures import gaps as gap
from apo_bench.report.figures.chart import Entry, Panel, entries, legend
from apo_bench.report.figures.curves import difference_panels, looks_of, success_panels
from apo_bench.report.figures.shades import shade_panels
from apo_bench.report.figures.sheet import write_sheet
from apo_bench.report.figures.stacks import stack_panels, stage_entries
from apo_bench.report.figures.times import Times, time_panels
from apo_bench.report.page.markup import Html, joined, tag
from apo_bench.statistics.confusion import Confusion
from apo_bench.statistics.rates import Cell
from apo_bench.statistics.settings import Setting, members
from apo_bench.statistics.summary import Summary


class Figure(NamedTuple):
    """Panels that share a legend."""

    title: str
    panels: list[Panel]
    key: list[Entry]

    def html(self) -> Html:
        """As it stands in a page."""
        panels = tag("div", *(one.figure() for one in self.panels), class_="panels")
        return joined([legend(self.key), panels]) if self.key else panels


def figures_of(
    found: Summary,
    grouped: Mapping[Setting, Sequence[Cell]],
    gaps: Sequence[gap.Gap],
    confusions: Sequence[Confusion],
    times: Sequence[Times],
) -> dict[str, Figure]:
    """Those that have something to show, by the name of their file."""
    methods = methods_of(found.cells)
    looks = looks_of(methods)
    where = list(grouped)
    ceiling = any(cell.method == "oracle" for cell in found.cells)
    keen = {m: look for m, look in looks.items() if m != "none"}
    made = {
        "success_over_level": Figure("Success over level", success_panels(grouped, looks), entries(looks, ceiling)),
        "failure_stages": Figure("Where trials failed", stack_panels(grouped), stage_entries(found.cells)),
        "gap_before_and_after": Figure(
            "Gap of the contacts as seen and as planned",
            gap.gap_panels(members(where, gaps), looks),
            [*gap.SEEN, *entries({m: look for m, look in keen.items() if any(g.place.method == m for g in gaps)})],
        ),
        "prediction": Figure("Predicted against real failure", shade_panels(confusions), []),
        "timing": Figure("Wall time of a trial", time_panels(times), []),
    }
    pairs = members(where, found.pairs)
    for reference in dict.fromkeys(p.reference for p in found.pairs):
        shown = {m: look for m, look in looks.items() if m not in (reference, "none")}
        panels = difference_panels(pairs, reference, shown)
        title = f"Difference of success to {reference}, same seeds"
        made[f"difference_to_{reference}"] = Figure(title, panels, entries(shown))
    return {name: figure for name, figure in made.items() if figure.panels}


def methods_of(cells: Sequence[Cell]) -> list[str]:
    """Those that have a colour, as a reader looks for them."""
    return [m for m in dict.fromkeys(c.method for c in cells) if not knows_truth(m)]


def write_figures(figures: Mapping[str, Figure], methods: Sequence[str], folder: Path) -> list[Path]:
    """Every figure as an SVG file."""
    paths = []
    for name, figure in figures.items():
        path = folder / f"{name}.svg"
        write_sheet(figure.title, figure.panels, methods, figure.key, path)
        paths.append(path)
    return paths
