"""The commands `apo-bench noise list | show | fit | still`: noise models, cards, noise that is measured."""

from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.arguments import AsJson
from apo_bench.cli.help import group
from apo_bench.cli.outputs import check_outputs
from apo_bench.cli.printing import print_answer
from apo_bench.io import write_file
from apo_bench.records import check

_HELP = "Noise models: list, cards, fits to measured poses and to parts at rest."
_NAME = "A name out of `apo-bench noise list`, FILE.toml, empirical:FILE.csv, or package.module:name."


def noise_list() -> None:
    """List the noise models that have a name."""
    from apo_bench.viz.noise_card import list_models

    models = list_models()
    width = max(map(len, models))
    for name, title in models.items():
        typer.echo(f"{name:{width}}  {title}")
    typer.echo("\nThe card of one: apo-bench noise show NAME")


noise = group("noise", _HELP, noise_list)
noise.command("list")(noise_list)

_Picture = Annotated[Path | None, typer.Option(help="Draw seen and fitted into this file: .png.")]
_Source = Annotated[str | None, typer.Option(help="What the noise file says it is of; default: the files.")]


@noise.command("show")
def print_noise_card(
    name: Annotated[str, typer.Argument(help=_NAME)],
    noise_level: Annotated[
        float, typer.Option(help="Of the table: mm and degrees, standard deviation; of measured noise, a factor.")
    ] = 1.0,
) -> None:
    """Print the card of a noise model: formula, frame, parameters, and a table of its errors."""
    from apo_bench.perception.observation.noise import NoiseLevel
    from apo_bench.viz.noise_card import draw_errors, write_card

    check("noise_mm", noise_level, called="noise_level")
    both = NoiseLevel(noise_level, noise_level)
    typer.echo(write_card(name, both, draw_errors(name, both)), nl=False)


@noise.command("fit")
def noise_fit(
    estimates: Annotated[Path, typer.Option(help="Poses of an estimator, a results file of the BOP format (.csv).")],
    truth: Annotated[
        Path, typer.Option(help="Where the parts were: .csv of that format, a scene_gt.json, or a folder of scenes.")
    ],
    scene_id: Annotated[int | None, typer.Option(help="Only this scene; a scene_gt.json does not say its own.")] = None,
    out: Annotated[Path | None, typer.Option(help="Write the noise file for --noise: .toml.")] = None,
    residuals: Annotated[
        Path | None, typer.Option(help="Write the residuals for --noise empirical:FILE: .csv.")
    ] = None,
    picture: _Picture = None,
    source: _Source = None,
    as_json: AsJson = False,
) -> None:
    """Measure a pose estimator: fit tails along and across the ray, outliers and misses, to its published results."""
    from apo_bench.formats.bop import read_results
    from apo_bench.formats.bop_truth import read_truth
    from apo_bench.perception.observation.fitting import fit
    from apo_bench.perception.observation.models.empirical import residuals_text
    from apo_bench.perception.observation.models.residuals import match_residuals
    from apo_bench.viz.fit_text import fit_form, fit_lines, fit_notes

    outputs = [(out, "--out", (".toml",)), (residuals, "--residuals", (".csv",)), (picture, "--picture", (".png",))]
    check_outputs(outputs, (estimates, truth))
    seen = read_results(estimates)
    matched = match_residuals(seen, read_truth(truth, seen, scene_id))
    measured = fit.fit_noise(matched, _printable(source or f"{estimates.name} against {truth.name}"))
    found = fit_form(matched, measured, fit.goodness_of_fit(matched, measured))
    command = f"apo-bench noise fit --estimates {estimates.name} --truth {truth.name}"
    _write_fit(matched, measured, (out, picture), (_printable(command), *fit_notes(found)))
    if residuals is not None:
        write_file(residuals, residuals_text(matched))
    print_answer(found, fit_lines(found), as_json)
    for path in (out, residuals, picture):
        if path is not None and not as_json:
            typer.echo(f"Wrote {path}")


@noise.command("still")
def noise_still(
    log: Annotated[Path, typer.Argument(help="A tracker's log in which parts rest, or a folder of logs.")],
    form: Annotated[str, typer.Option("--format", help="csv, bop, tum, ros-csv or ros-json.")],
    camera: Annotated[Path, typer.Option(help="How the log is written, and where its camera stands if known: .toml.")],
    out: Annotated[Path | None, typer.Option(help="The noise file for --noise and --camera-noise: .toml.")] = None,
    picture: _Picture = None,
) -> None:
    """Measure a camera on parts that rest: how its frames scatter, how many are missing, how many are wrong."""
    from apo_bench.importers.recording.camera_file import read_camera
    from apo_bench.importers.recording.formats import read_log
    from apo_bench.importers.recording.still import still_residuals
    from apo_bench.perception.observation.fitting import fit
    from apo_bench.viz.fit_text import fit_form, fit_lines

    check_outputs([(out, "--out", (".toml",)), (picture, "--picture", (".png",))], (camera,))
    stated = read_camera(camera)
    scatter = still_residuals(read_log(log, form, stated.conventions))
    measured = fit.fit_noise(scatter, _printable(f"parts at rest in {log.name}"))
    found = fit_form(scatter, measured, fit.goodness_of_fit(scatter, measured))
    notes = (_printable(f"apo-bench noise still {log.name} --format {form}"), "without errors that stay")
    _write_fit(scatter, measured, (out, picture), notes, stated.T_world_camera)
    typer.echo("\n".join(fit_lines(found)))
    typer.echo("\nAn error that stays while a part rests is not in these numbers: no log of still parts can show it.")
    for path in (out, picture):
        if path is not None:
            typer.echo(f"Wrote {path}")


def _write_fit(
    residuals: Any, measured: Any, files: tuple[Path | None, Path | None], notes: tuple[str, ...], *camera: Any
) -> None:
    """Write the noise file and the picture of a fit, where they are asked for."""
    from apo_bench.perception.observation.noise_file import noise_text
    from apo_bench.viz.fit_picture import draw_fit

    out, picture = files
    if out is not None:
        write_file(out, noise_text(measured, notes, *camera))
    if picture is not None:
        draw_fit(residuals, measured, picture)


def _printable(text: str) -> str:
    """On one line, whatever a file name may hold."""
    return "".join(c if c.isprintable() else " " for c in text)
