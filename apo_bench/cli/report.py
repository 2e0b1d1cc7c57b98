"""The commands `apo-bench report` and `apo-bench compare`: what a sweep says, and how two differ."""

from pathlib import Path
from typing import Annotated

import typer

from apo_bench.cli.arguments import path_given
from apo_bench.cli.printing import print_json
from apo_bench.cli.setting_options import AsJson
from apo_bench.errors import require

_MOST_PICTURES = 100


def report_command(
    folder: Annotated[
        Path, typer.Argument(parser=path_given, metavar="FOLDER", help="The folder that `sweep --out` wrote.")
    ],
    pictures: Annotated[int, typer.Option(help="Failures that are drawn at most; each is run again for it.")] = 6,
    salt_file: Annotated[
        Path | None,
        typer.Option(parser=path_given, metavar="<path>", help="Of a salted sweep, to run its failures again."),
    ] = None,
    trust_code: Annotated[
        bool, typer.Option("--trust-code", help="For pictures, import and run code of others that the rows name.")
    ] = False,
) -> None:
    """Write report.html, which opens anywhere, with tables (CSV, Parquet) and figures (SVG, PNG) beside it."""
    from apo_bench.cli.terminal import print_cells, print_report
    from apo_bench.report.report import report
    from apo_bench.show.failure_pictures import failure_pictures

    require(
        0 <= pictures <= _MOST_PICTURES,
        f"--pictures {pictures} was given; a whole number from 0 to {_MOST_PICTURES} is allowed.",
    )
    written = report(folder, pictures, salt_file, trust_code=trust_code, draw=failure_pictures)
    print_cells(written.cells)
    print_report(written)


def compare_command(
    first: Annotated[Path, typer.Argument(parser=path_given, metavar="FIRST", help="The folder of a sweep.")],
    second: Annotated[
        Path, typer.Argument(parser=path_given, metavar="SECOND", help="Another one, of the same seeds.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            parser=path_given, metavar="<path>", help="Folder of the page and its tables; default: comparison."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Compare two sweeps trial by trial: two versions, machines or fidelities; write compare.html."""
    from apo_bench.cli.terminal import print_comparison
    from apo_bench.report.comparison.compare import compare
    from apo_bench.report.comparison.text import comparison_form, write_comparison

    comparison = compare(first, second)
    if out is None and not as_json:
        out = Path("comparison")
    page = None if out is None else write_comparison(comparison, out)
    if as_json:
        print_json(comparison_form(comparison))
    else:
        print_comparison(comparison)
        if page is not None:
            typer.echo(f"Page: {page}")
