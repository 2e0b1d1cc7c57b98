"""The commands `apo-bench report` and `apo-bench compare`: what a sweep says, and how two differ."""

import json
from pathlib import Path
from typing import Annotated

import typer

from apo_bench.cli.arguments import path_given
from apo_bench.errors import InputError

_MOST_PICTURES = 100
_Folder = Annotated[
    Path, typer.Argument(parser=path_given, metavar="FOLDER", help="The folder that `sweep --out` wrote.")
]


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command()(report)
    app.command()(compare)


def report(
    folder: _Folder,
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
    from apo_bench.report.report import report as write_report
    from apo_bench.show.failure_pictures import failure_pictures

    if not 0 <= pictures <= _MOST_PICTURES:
        raise InputError(f"--pictures {pictures} was given; a whole number from 0 to {_MOST_PICTURES} is allowed.")
    made = write_report(folder, pictures, salt_file, trust_code=trust_code, draw=failure_pictures)
    print_cells(made.cells)
    print_report(made)


def compare(
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
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object, and nothing else.")] = False,
) -> None:
    """Compare two sweeps trial by trial: two versions, machines or fidelities; write compare.html."""
    from apo_bench.cli.terminal import print_comparison
    from apo_bench.report.compare import compare as compared
    from apo_bench.report.compare_text import comparison_form
    from apo_bench.report.page.compare_page import write_comparison

    found = compared(first, second)
    if out is None and not as_json:
        out = Path("comparison")
    made = None if out is None else write_comparison(found, out)
    if as_json:
        typer.echo(json.dumps(comparison_form(found), allow_nan=False))
    else:
        print_comparison(found)
        if made is not None:
            typer.echo(f"Page: {made.page}")
