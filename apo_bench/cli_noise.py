"""The commands `apo-bench noise list | card`: which noise models there are, and what they do, without a simulator."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from apo_bench.arguments import check_writable
from apo_bench.errors import InputError

noise = typer.Typer(add_completion=False, rich_markup_mode=None, help="Noise models: list them, read their cards.")


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.add_typer(noise, name="noise")


@noise.callback(invoke_without_command=True)
def _without_command(context: typer.Context) -> None:
    """List the noise models, or read the card of one."""
    if context.invoked_subcommand is None:
        list_models()


@noise.command("list")
def list_models() -> None:
    """List the noise models that have a name."""
    from apo_bench.benchmark.noise_card import listed

    models = listed()
    width = max(map(len, models))
    for name, title in models.items():
        typer.echo(f"{name:{width}}  {title}")
    typer.echo("\nThe card of one: apo-bench noise card NAME")


@noise.command()
def card(
    name: Annotated[str, typer.Argument(help="A name out of `apo-bench noise list`, or package.module:name.")],
    level: Annotated[float, typer.Option(help="Of the histogram: mm and degrees, standard deviation.")] = 1.0,
    out: Annotated[Path | None, typer.Option(help="Draw the histogram into this file: .png.")] = None,
) -> None:
    """Print the card of a noise model: formula, frame, parameters, and a histogram of its errors."""
    from apo_bench.benchmark.noise_card import noise_card
    from apo_bench.benchmark.noise_picture import draw_histogram
    from apo_bench.observation.noise import Level

    if out is not None:
        check_writable(out, "--out", (".png",))
    typer.echo(noise_card(name, Level(level, level)), nl=False)
    if out is None:
        return
    try:
        draw_histogram(name, Level(level, level), out)
    except OSError as error:
        raise InputError(f"--out {out} cannot be written ({error.strerror}); choose another place.") from error
    typer.echo(f"\nWrote {out}")
