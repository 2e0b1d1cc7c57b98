"""The command `apo-bench score`: a method over tracks of fixed trials."""

import json
import shlex
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.shared import (
    Address,
    AsJson,
    Backend,
    DeviationDeg,
    DeviationMm,
    MethodArgument,
    Workers,
    check_output,
    count_cores,
    make_path_option,
    print_json,
    print_table,
    print_text,
)
from apo_bench.errors import InputError, require

_OF_ESTIMATORS = "measured"
"""Track of a pose estimator where none is named."""
_COLUMNS = {
    "track": "",
    **dict.fromkeys(("score", "low", "high"), ".1f"),
    **dict.fromkeys(("trials", "executed"), "d"),
    **dict.fromkeys(("brier", "reliability"), ".3f"),
}
"""Columns of the scores, with their formats."""


_POSE_COLUMNS = {
    **dict.fromkeys(("scenario", "method"), ""),
    "trials": "d",
    **dict.fromkeys(("success", "low", "high", "vsd", "mssd", "mspd", "add"), ".1f"),
}
"""Columns of the scores of a pose estimator, with their formats."""


def score_command(
    method: MethodArgument = None,
    *,
    track: Annotated[
        list[str] | None,
        typer.Option(help="Track by name or file; may be repeated; default: those of the overall score."),
    ] = None,
    out: Annotated[
        Path | None, make_path_option("Write the entry: .json; its records are in a folder next to it.")
    ] = None,
    command: Annotated[
        str | None,
        typer.Option(metavar="PROGRAM", help="Program that reads a request, one line of JSON, and answers."),
    ] = None,
    estimator: Annotated[
        Path | None,
        make_path_option(
            "Noise file of `noise fit`: score this pose estimator, by default in the track `measured`; with --poses, "
            "the errors that observations state."
        ),
    ] = None,
    poses: Annotated[
        Path | None,
        make_path_option(
            "Results file (BOP format) of a pose estimator, in a folder of `dataset make --format bop`: replay its "
            "poses as they are, and corrected by METHOD."
        ),
    ] = None,
    deviation_mm: DeviationMm = None,
    deviation_deg: DeviationDeg = None,
    results: Annotated[
        Path | None,
        make_path_option("Form of `part export`, filled in: trials of a real robot; nothing is simulated."),
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of the entry in tables; default: the method.")] = None,
    trials: Annotated[
        int | None, typer.Option(min=1, help="The first so many trials of each condition; default: all of the track.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="One trial of each condition, as a test.")] = False,
    secret_seed_file: Annotated[
        Path | None, make_path_option("Draw trials that nobody can draw without this file.")
    ] = None,
    workers: Workers = None,
    backend: Backend = "local",
    address: Address = None,
    as_json: AsJson = False,
) -> None:
    """Score a method over tracks of fixed trials: one number for each track, and one over all.

    The same command continues an interrupted run.

    Examples:
      apo-bench score contact --out entries/contact.json
      apo-bench score contact --poses images/results.csv --out poses.json
    """
    from apo_bench.benchmark.scoring.entry import check_name, read_entry, write_entry
    from apo_bench.benchmark.scoring.program import program_method
    from apo_bench.benchmark.scoring.real_form import read_real_entry
    from apo_bench.benchmark.scoring.score import score
    from apo_bench.benchmark.scoring.track import read_tracks, seen_by

    require((method is None) != (command is None), "name either METHOD or --command.")
    require(trials is None or not quick, "give either --trials or --quick.")
    tracks = read_tracks(track or ([] if estimator is None else [_OF_ESTIMATORS]))
    if estimator is not None and poses is None:
        tracks = tuple(seen_by(each, str(estimator)) for each in tracks)
    how: dict[str, Any] = {
        "workers": count_cores() if workers is None and backend == "local" else workers,
        "backend": backend,
        "address": address,
        "secret_seed_file": secret_seed_file,
    }
    if poses is not None:
        given = {"--track": track, "--command": command, "--results": results, "--name": name, "--trials": trials}
        named = next((option for option, value in (given | {"--quick": quick}).items() if value), None)
        require(named is None, f"{named} and --poses exclude each other; leave one of them out.")
    else:
        require((deviation_mm, deviation_deg) == (None, None), "--deviation-mm and --deviation-deg need --poses.")
    if out is None:
        raise InputError("--out is missing; name the file of the entry, such as entry.json.")
    out.parent.mkdir(parents=True, exist_ok=True)
    check_output(out, "--out", ".json")
    if poses is not None:
        deviation = tuple(1.0 if value is None else value for value in (deviation_mm, deviation_deg))
        _score_poses(str(method), poses, out, as_json, deviation=deviation, estimator=estimator, **how)
        return
    if out.exists():
        lost = set(read_entry(out).tracks) - {each.name for each in tracks}
        require(
            not lost,
            f"'{out}' has scores of other tracks, which this command would delete: {', '.join(sorted(lost))}; add them "
            "with --track, or give another file with --out.",
        )
    name = name or command
    check_name("entry", name or method or "")
    records = out.with_suffix("")
    line = shlex.join(["apo-bench", *sys.argv[1:]])
    if results is not None:
        require(method is not None, "--results needs METHOD, as the form names it.")
        entry = read_real_entry(results, str(method), name, line)
    else:
        with program_method(command, records) if command else nullcontext(str(method)) as found:
            entry = score(
                found,
                tracks,
                records,
                name=name,
                trials=1 if quick else trials,
                command=line,
                said=lambda each: print_text(f"{each.name}: {each.title}", as_json),
                **how,
            )
    write_entry(entry, out)
    _print_entry(entry, out, as_json)


def _score_poses(method: str, poses: Path, out: Path, as_json: bool, **how: Any) -> None:
    """Score the poses of a pose estimator, and print and write the table."""
    from apo_bench.benchmark.scoring.images import score_poses
    from apo_bench.io import write_file
    from apo_bench.viz.form_text import make_table

    form: dict[str, Any] = {"results": str(poses), "rows": score_poses((method,), poses, out.with_suffix(""), **how)}
    write_file(out, json.dumps(form, indent=1))
    if as_json:
        print_json(form)
        return
    print_table(make_table(form["rows"], _POSE_COLUMNS))
    typer.echo("Success and recall in percent; low and high are the ends of Wilson's 95 % interval.")
    typer.echo(f"Score: {out}")


def _print_entry(entry: Any, out: Path, as_json: bool) -> None:
    from apo_bench.benchmark.scoring.entry import LEAST_TRIALS, form_of
    from apo_bench.viz.form_text import make_table

    if as_json:
        print_json(form_of(entry))
        return
    print_table(make_table([form | {"track": track} for track, form in form_of(entry)["tracks"].items()], _COLUMNS))
    if entry.overall is not None:
        few = f"; too few trials for a score, which needs {LEAST_TRIALS} per condition" if entry.has_few_trials else ""
        typer.echo("all {:.1f} ({:.1f} to {:.1f})".format(*entry.overall) + few)
    typer.echo(f"Entry: {out}")
