"""The command `apo-bench leaderboard`: a table of entries."""

from pathlib import Path
from typing import Annotated

import typer

from apo_bench.cli.shared import check_output, make_path_argument, make_path_option
from apo_bench.io import clean, shorten_text


def leaderboard_command(
    folder: Annotated[Path, make_path_argument("FOLDER", "Folder of entries: .json files.")],
    out: Annotated[Path, make_path_option("Write the page: .md; its figure is next to it.")],
    secret_seed_hash: Annotated[
        list[str] | None,
        typer.Option(help="Hash of a secret seed of yours: mark its entries as verified; may be repeated."),
    ] = None,
) -> None:
    """Write a table of entries, and one figure of all tracks; files that are no entries are named.

    Examples:
      apo-bench leaderboard entries --out leaderboard.md
      apo-bench leaderboard verified --secret-seed-hash 0123456789abcdef --out leaderboard.md
    """
    from apo_bench.benchmark.scoring.leaderboard import read_entries, write_leaderboard

    check_output(out, "--out", ".md")
    entries, left_out = read_entries(folder)
    write_leaderboard(entries, out, frozenset(secret_seed_hash or ()))
    for sentence in left_out:
        typer.echo(f"left out: {shorten_text(clean(sentence))}", err=True)
    typer.echo(f"{len(entries)} entries in {out}")
