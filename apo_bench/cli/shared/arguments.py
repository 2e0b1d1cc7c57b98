"""Arguments, options and exit codes that several commands share."""

from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.shared.completion import complete_last_word
from apo_bench.cli.shared.values import parse_path

NO_RESULT = 1
"""Exit code of a command that ends without the result it was run for."""


def make_path_option(description: str, *names: str) -> Any:
    """Return an option that takes the path of a file or a folder."""
    return typer.Option(*names, parser=parse_path, metavar="PATH", help=description)


def make_path_argument(name: str, description: str) -> Any:
    """Return an argument that takes the path of a file or a folder."""
    return typer.Argument(parser=parse_path, metavar=name, help=description)


ScenarioArgument = Annotated[
    str,
    typer.Argument(
        metavar="SCENARIO",
        help="A name from `apo-bench scenario list`, generated:SEED, or a scenario file.",
        autocompletion=complete_last_word("scenario"),
    ),
]
MethodArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="METHOD",
        help="A name from `apo-bench method list`, or package.module:name.",
        autocompletion=complete_last_word("method"),
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
DeviationMm = Annotated[
    float | None, typer.Option(help="Standard deviation per axis where the observation states none, in mm; default: 1.")
]
DeviationDeg = Annotated[
    float | None,
    typer.Option(help="Standard deviation about each axis where the observation states none, in degrees; default: 1."),
]
Port = Annotated[
    int | None,
    typer.Option(help="Show it in a browser at this port of 127.0.0.1; default: a window, or 8080 without a display."),
]
SecretSeedFile = Annotated[
    Path | None, make_path_option("File with the secret seed of the sweep, to run its trials again.")
]
Workers = Annotated[int | None, typer.Option(help="Number of processes; default: one for each core.")]
Backend = Annotated[str, typer.Option(help="Where the processes run: local, or ray for a cluster.")]
Address = Annotated[str | None, typer.Option(help="Address of the Ray cluster, host:port.")]
