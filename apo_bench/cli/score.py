"""Two commands: `apo-bench score`, one number for a method, and `apo-bench leaderboard`, a table of such numbers.

The commands `apo-bench report` and `apo-bench compare`: what a sweep says, and how two differ.
"""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.arguments import AsJson
from apo_bench.cli.completion import completion
from apo_bench.cli.cores import cores
from apo_bench.cli.outputs import check_writable
from apo_bench.cli.printing import print_answer, print_json
from apo_bench.cli.sweep import interrupted
from apo_bench.cli.values import path_given
from apo_bench.errors import InputError, require
from apo_bench.io import brief, clean

_OF_ESTIMATORS = "measured"
"""The track that a pose estimator is scored in where none is named."""


def score_command(
    method: Annotated[
        str | None,
        typer.Argument(
            help="A method, or package.module:name; none with --command, --answers or --export.",
            autocompletion=completion("method"),
        ),
    ] = None,
    *,
    track: Annotated[
        list[str] | None, typer.Option(help="A track, by name or file; may be said again; default: all.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(parser=path_given, metavar="<path>", help="The entry: .json; rows lie in a folder beside it."),
    ] = None,
    command: Annotated[
        str | None, typer.Option(metavar="PROGRAM", help="A program that reads a request, a line of JSON, and answers.")
    ] = None,
    answers: Annotated[
        Path | None,
        typer.Option(
            parser=path_given, metavar="<path>", help="Goals made elsewhere, one answer for each request of --export."
        ),
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option(parser=path_given, metavar="<path>", help="Write all requests into this file, .jsonl; no score."),
    ] = None,
    estimator: Annotated[
        Path | None,
        typer.Option(
            parser=path_given,
            metavar="<path>",
            help="A noise file of `noise fit`: poses err as this pose estimator's; default track: measured.",
        ),
    ] = None,
    name: Annotated[str | None, typer.Option(help="What tables call the entry; default: its method.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A few seeds of each cell: whether it works.")] = False,
    secret_seed_file: Annotated[
        Path | None,
        typer.Option(parser=path_given, metavar="<path>", help="Draw trials that nobody can draw without this file."),
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Processes; default: the cores there are.")] = None,
    backend: Annotated[str, typer.Option(help="local, or ray for a cluster.")] = "local",
    address: Annotated[str | None, typer.Option(help="Of the Ray cluster, host:port.")] = None,
    as_json: AsJson = False,
) -> None:
    """Run a method over tracks of fixed trials, resumed where they were left: one number for each, and one over all."""
    from apo_bench.benchmark.scoring.entrants import entrant, exported
    from apo_bench.benchmark.scoring.entry import check_name, form_of, read_entry, write_entry
    from apo_bench.benchmark.scoring.score import score
    from apo_bench.benchmark.scoring.track import Track, read_tracks, seen_by
    from apo_bench.viz.score_text import entry_lines

    given = [x for x in (method, command, answers, export) if x is not None]
    require(
        len(given) == 1,
        f"{len(given)} entrants were given; give one: a method, --command, --answers, or --export for none.",
    )
    tracks = read_tracks(track or ([] if estimator is None else [_OF_ESTIMATORS]))
    if estimator is not None:
        tracks = tuple(seen_by(each, str(estimator)) for each in tracks)
    how: dict[str, Any] = {
        "quick": quick,
        "workers": cores() if workers is None and backend == "local" else workers,
        "backend": backend,
        "address": address,
        "secret_seed_file": secret_seed_file,
    }
    if export is not None:
        check_writable(export, "--export", (".jsonl",))
        count = exported(tracks, export, **how)
        typer.echo(f"{count} requests in {export}; answer each, and give the answers to --answers.")
        return
    if out is None:
        raise InputError("no --out was given; name the file of the entry, such as entry.json.")
    out.parent.mkdir(parents=True, exist_ok=True)
    check_writable(out, "--out", (".json",))
    if out.exists():
        read_entry(out)  # an entry is made anew; what is none is kept
    rows = out.with_suffix("")

    name = name or command or (None if answers is None else answers.name)
    check_name("entry", name or method or "")

    def said(track: Track) -> None:
        if not as_json:
            typer.echo(f"{track.name}: {track.title}", err=True)

    try:
        with entrant(method, command, answers, rows, tracks, **how) as found:
            entry = score(
                found,
                tracks,
                rows,
                name=name,
                command=shlex.join(["apo-bench", *sys.argv[1:]]),
                said=said,
                **how,
            )
    except KeyboardInterrupt as error:
        raise interrupted(error, "; what had ended is kept, and the same command continues") from error
    write_entry(entry, out)
    print_answer(form_of(entry), [*entry_lines(entry), f"Entry: {out}"], as_json)


def leaderboard_command(
    folder: Annotated[Path, typer.Argument(parser=path_given, metavar="FOLDER", help="Entries, .json files.")],
    out: Annotated[
        Path,
        typer.Option(parser=path_given, metavar="<path>", help="The page, .md; its figure lies beside it."),
    ],
    secret_seed: Annotated[
        list[str] | None,
        typer.Option(help="Hash of a salt that you drew trials with: entries of it are verified; may be said again."),
    ] = None,
) -> None:
    """Write a table of entries, and one figure of all tracks; a file that is not an entry is named and left out."""
    from apo_bench.benchmark.scoring.leaderboard import read_entries, write_leaderboard

    check_writable(out, "--out", (".md",))
    entries, left_out = read_entries(folder)
    write_leaderboard(entries, out, frozenset(secret_seed or ()))
    for sentence in left_out:
        typer.echo(f"left out: {brief(clean(sentence))}", err=True)
    typer.echo(f"{len(entries)} entries in {out}")


_MOST_PICTURES = 100


def report_command(
    folder: Annotated[
        Path, typer.Argument(parser=path_given, metavar="FOLDER", help="The folder that `sweep --out` wrote.")
    ],
    pictures: Annotated[int, typer.Option(help="Failures that are drawn at most; each is run again for it.")] = 6,
    secret_seed_file: Annotated[
        Path | None,
        typer.Option(parser=path_given, metavar="<path>", help="Of a salted sweep, to run its failures again."),
    ] = None,
    trust_code: Annotated[
        bool, typer.Option("--trust-code", help="For pictures, import and run code of others that the rows name.")
    ] = False,
) -> None:
    """Write report.html, which opens anywhere, with tables (CSV, Parquet) and figures (SVG, PNG) beside it."""
    from apo_bench.benchmark.report.report import report
    from apo_bench.cli.terminal import print_cells, print_report
    from apo_bench.viz.failure_pictures import failure_pictures

    require(
        0 <= pictures <= _MOST_PICTURES,
        f"--pictures {pictures} was given; a whole number from 0 to {_MOST_PICTURES} is allowed.",
    )
    written = report(folder, pictures, secret_seed_file, trust_code=trust_code, draw=failure_pictures)
    print_cells(written.conditions)
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
    from apo_bench.benchmark.report.comparison.compare import compare
    from apo_bench.benchmark.report.comparison.text import comparison_form, write_comparison
    from apo_bench.cli.terminal import print_comparison

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
