"""Every figure of a sweep that has something to show."""

from collections.abc import Mapping, Sequence

from apo_bench.report.figures.bars import outcome_figure, prediction_figure, time_figure
from apo_bench.report.figures.levels import (
    difference_figure,
    gap_figure,
    methods_of,
    recognition_figure,
    success_figure,
)
from apo_bench.report.figures.other_axes import looks_figure, tightness_figure
from apo_bench.report.figures.sheet import DrawnFigure, draw
from apo_bench.report.figures.styles import styles
from apo_bench.statistics import Cell, Confusion, GapSummary, Recognition, Setting, TrialTimes, members
from apo_bench.statistics.levels.summary import Summary


def figures(
    numbers: Summary,
    grouped: Mapping[Setting, Sequence[Cell]],
    gaps: Sequence[GapSummary],
    confusions: Sequence[Confusion],
    recognitions: Sequence[Recognition],
    times: Sequence[TrialTimes],
) -> dict[str, DrawnFigure]:
    """By the name of their file."""
    where = list(grouped)
    looks = styles(methods_of(numbers.cells))
    pairs = members(where, numbers.pairs)
    figures = {
        "success_over_level": success_figure(numbers.cells),
        "success_over_tightness": tightness_figure(numbers.cells),
        "success_over_looks": looks_figure(numbers.cells),
        "failure_stages": outcome_figure(grouped),
        "gap_before_and_after": gap_figure(members(where, gaps), looks),
        "prediction": prediction_figure(confusions),
        "recognised": recognition_figure(recognitions),
        "timing": time_figure(times),
    }
    for reference in dict.fromkeys(p.reference for p in numbers.pairs):
        figures[f"difference_to_{reference}"] = difference_figure(pairs, reference, looks)
    return {name: draw(figure) for name, figure in figures.items() if figure.panels}
