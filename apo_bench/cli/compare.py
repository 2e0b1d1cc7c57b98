"""The command `apo-bench compare`: two sweeps, trial by trial."""

from pathlib import Path
from typing import Annotated

import typer

from apo_bench.cli.shared import AsJson, make_path_argument, make_path_option, print_json
from apo_bench.io import clean

_MOST_NAMES = 8  # settings that differ, on the terminal


def compare_command(
    first: Annotated[Path, make_path_argument("FIRST", "Folder of a sweep.")],
    second: Annotated[Path, make_path_argument("SECOND", "Folder of another sweep with the same seeds.")],
    out: Annotated[Path | None, make_path_option("Folder of the page and its tables; default: comparison.")] = None,
    as_json: AsJson = False,
) -> None:
    """Compare two sweeps trial by trial (two versions, machines or fidelities), and write compare.html.

    Examples:
      apo-bench compare runs/mine runs/other
      apo-bench compare runs/full runs/near-contact --json
    """
    from apo_bench.benchmark.report.comparison.compare import compare
    from apo_bench.benchmark.report.comparison.text import (
        describe_comparison,
        make_comparison_form,
        make_comparison_tables,
        write_comparison,
    )
    from apo_bench.cli.rates import print_report_table

    comparison = compare(first, second)
    folder = Path("comparison") if out is None and not as_json else out
    page = None if folder is None else write_comparison(comparison, folder)
    if as_json:
        print_json(make_comparison_form(comparison))
        return
    typer.echo(clean(describe_comparison(comparison)))
    print_report_table(make_comparison_tables(comparison)["agreement"])
    names = [line["what"] for line in comparison.differences]
    more = f" and {len(names) - _MOST_NAMES} more" * (len(names) > _MOST_NAMES)
    typer.echo(clean(f"Not the same: {', '.join(names[:_MOST_NAMES]) or 'nothing'}{more}"))
    typer.echo(f"Page: {page}")
