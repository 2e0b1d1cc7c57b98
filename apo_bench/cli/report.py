"""The command `apo-bench report`: the page, tables and figures of a sweep."""

from pathlib import Path
from typing import Annotated

import typer

from apo_bench.cli.shared import make_path_argument
from apo_bench.io import clean, has_parquet


def report_command(
    folder: Annotated[Path, make_path_argument("FOLDER", "Folder that `sweep --out` wrote.")],
    max_pictures: Annotated[int, typer.Option(min=0, max=100, help="Largest number of failures to draw.")] = 6,
) -> None:
    """Write report.html, which opens offline, with tables (CSV, Parquet) and figures (SVG, PNG).

    Examples:
      apo-bench report runs/mine
      apo-bench report runs/mine --max-pictures 0
    """
    from apo_bench.benchmark.report.report import write_report
    from apo_bench.benchmark.report.tables.methods import summarise_predictions
    from apo_bench.cli.rates import print_rates
    from apo_bench.viz.failure_pictures import draw_failures

    made = write_report(folder, max_pictures, draw_failures)
    print_rates(made.conditions)
    endings = ".csv and .parquet" if has_parquet() else ".csv (.parquet needs the package pyarrow)"
    lines = [
        summarise_predictions(made.confusions[-1]),
        *([f"Failures that were not drawn: {'; '.join(made.no_pictures)}."] if made.no_pictures else []),
        f"Answer:  {made.answer.replace('`', '')}",
        f"Tables:  {made.tables['conditions']} and {len(made.tables) - 1} more, as {endings}",
        *(f"Figures: {figure} and {len(made.figures) - 1} more" for figure in made.figures[:1]),
        f"Report:  {made.page}",
    ]
    typer.echo("\n".join(map(clean, lines)))
