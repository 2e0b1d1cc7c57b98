"""The commands `apo-bench noise list | show | fit`."""

from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.shared import (
    AsJson,
    Command,
    check_output,
    make_group,
    make_path_option,
    print_columns,
    print_json,
    print_text,
    print_written,
)
from apo_bench.errors import require, require_known
from apo_bench.io import write_file
from apo_bench.records import check

_HELP = """
Noise models: how observed poses differ from true ones.

Examples:
  apo-bench noise list
  apo-bench noise show outliers
"""
commands = make_group("noise", _HELP)


@commands.command("list", cls=Command)
def noise_list() -> None:
    """List the noise models that have a name.

    Examples:
      apo-bench noise list
      apo-bench run stick_in_tower --noise megapose-lmo --noise-level 0.5
    """
    from apo_bench.viz.noise_sheet import list_models

    print_columns(list(list_models().items()))
    typer.echo("\nOthers: FILE.toml of `noise fit`, empirical:FILE.csv, poses:FILE.csv, or package.module:name")


@commands.command("show", cls=Command)
def noise_show(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME", help="A name from `noise list`, FILE.toml, empirical:FILE.csv, or package.module:name."
        ),
    ],
    noise_level: Annotated[
        float, typer.Option(help="Standard deviation in mm and degrees; of measured noise, a factor.")
    ] = 1.0,
) -> None:
    """Print the sheet of a noise model: formula, frame, parameters, and a table of its errors.

    Examples:
      apo-bench noise show outliers
      apo-bench noise show megapose-lmo --noise-level 0.5
    """
    from apo_bench.perception.observation.noise import NoiseLevel
    from apo_bench.viz.noise_sheet import draw_errors, write_noise_sheet

    check("noise_mm", noise_level, called="noise_level")
    level = NoiseLevel(noise_level, noise_level)
    typer.echo(write_noise_sheet(name, level, draw_errors(name, level)), nl=False)


@commands.command("fit", cls=Command)
def noise_fit(
    estimates: Annotated[Path, make_path_option("Poses of an estimator: a results file of the BOP format, .csv.")],
    truth: Annotated[
        Path, make_path_option("True poses: .csv of that format, a scene_gt.json, a scene, or a folder of scenes.")
    ],
    models: Annotated[
        Path | None, make_path_option("Symmetries of the objects: models_info.json; default: that of the dataset.")
    ] = None,
    scenario: Annotated[
        str | None,
        typer.Option(help="Scenario of the objects, whose symmetries count; needs --objects."),
    ] = None,
    objects: Annotated[
        Path | None, make_path_option("Part and frame of each object, as of `recording import`: .toml.")
    ] = None,
    scene_id: Annotated[int | None, typer.Option(help="Read this scene alone; scene_gt.json names none.")] = None,
    out: Annotated[Path | None, make_path_option("Write the noise file for --noise: .toml.")] = None,
    residuals: Annotated[Path | None, make_path_option("Write the residuals for --noise empirical:FILE: .csv.")] = None,
    picture: Annotated[Path | None, make_path_option("Draw observed and fitted distributions: .png.")] = None,
    source_name: Annotated[
        str | None, typer.Option(help="Source to name in the noise file; default: the files.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Fit a noise model to a pose estimator: tails across and along the ray, outliers and misses.

    Examples:
      apo-bench noise fit --estimates results.csv --truth scene_gt.json --out mine.toml
      apo-bench noise fit --estimates results.csv --truth test --residuals mine.csv --picture fit.png
    """
    from apo_bench.formats.bop import read_results
    from apo_bench.formats.bop_models import find_models_info, read_symmetries
    from apo_bench.formats.bop_truth import read_truth
    from apo_bench.perception.observation.fitting.fit import compute_goodness_of_fit, fit_noise
    from apo_bench.perception.observation.models.empirical import format_residuals
    from apo_bench.perception.observation.models.residuals import match_residuals
    from apo_bench.perception.observation.noise_file import format_noise_file
    from apo_bench.viz.fit_picture import draw_fit
    from apo_bench.viz.fit_text import format_fit, list_fit_notes, make_fit_form

    inputs = (estimates, truth, *(path for path in (models, objects) if path is not None))
    check_output(out, "--out", ".toml", inputs=inputs)
    check_output(residuals, "--residuals", ".csv", inputs=inputs)
    check_output(picture, "--picture", ".png", inputs=inputs)
    results = read_results(estimates)
    known = models or find_models_info(truth)
    symmetries = {**({} if known is None else read_symmetries(known)), **_find_own_symmetries(scenario, objects)}
    matched = match_residuals(results, read_truth(truth, results, scene_id), symmetries)
    fitted = fit_noise(matched, _clean_line(source_name or f"{estimates.name} against {truth.name}"))
    form = make_fit_form(matched, fitted, compute_goodness_of_fit(matched, fitted))
    if out is not None:
        command = f"apo-bench noise fit --estimates {estimates.name} --truth {truth.name}"
        write_file(out, format_noise_file(fitted, (_clean_line(command), *list_fit_notes(form))))
    if residuals is not None:
        write_file(residuals, format_residuals(matched))
    if picture is not None:
        draw_fit(matched, fitted, picture)
    if as_json:
        print_json(form)
    print_text("\n".join(format_fit(form)), as_json)
    print_written(out, residuals, picture, as_json=as_json)


def _find_own_symmetries(scenario: str | None, objects: Path | None) -> Any:
    """Return the symmetries of the objects that are parts of a scenario."""
    from apo_bench import load_scenario
    from apo_bench.importers.recording.object_symmetries import find_object_symmetries
    from apo_bench.importers.recording.objects_file import read_objects

    require((scenario is None) == (objects is None), "--scenario and --objects go together; add the other one.")
    if scenario is None or objects is None:
        return {}
    solids = load_scenario(scenario).assembly.solids
    named = read_objects(objects)
    for part in named.parts:
        require_known("part", part, solids, place=str(objects))
    return find_object_symmetries(named, solids)


def _clean_line(text: str) -> str:
    """A text that may hold a file name, without line ends and control characters."""
    return "".join(c if c.isprintable() else " " for c in text)
