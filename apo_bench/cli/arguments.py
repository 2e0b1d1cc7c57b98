"""Arguments and options that several commands have, and the exit code of a command without a result."""

from typing import Annotated

import typer

from apo_bench.cli.completion import completion

NO_RESULT = 1
"""The exit code of a command that ended without the result it was asked for."""
ScenarioArgument = Annotated[
    str,
    typer.Argument(
        help="A name out of `apo-bench scenario list`, generated:SEED, or a scenario file.",
        autocompletion=completion("scenario"),
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object, and nothing else.")]
StatedMm = Annotated[float | None, typer.Option(help="Its standard deviation where it states none, mm.")]
StatedDeg = Annotated[float | None, typer.Option(help="The same in degrees.")]
DeviationMm = Annotated[float, typer.Option(help="Standard deviation of what was seen, mm, where none is stated.")]
DeviationDeg = Annotated[float, typer.Option(help="The same in degrees.")]
Port = Annotated[
    int | None,
    typer.Option(help="Show it in a browser, at this port of 127.0.0.1; default: a window, or 8080 without a display."),
]
