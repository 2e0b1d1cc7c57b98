"""The command `apo-bench track list`: the fixed trials that methods are scored on."""

import typer

from apo_bench.cli.shared import Command, make_group, print_columns

_HELP = """
Tracks: fixed trials that methods are scored on.

Examples:
  apo-bench track list
  apo-bench score contact --track given --out entry.json
"""
commands = make_group("track", _HELP)


@commands.command("list", cls=Command)
def track_list() -> None:
    """List the tracks that come with the package.

    Examples:
      apo-bench track list
      apo-bench score contact --track given --quick --out entry.json
    """
    from apo_bench.benchmark.scoring.track import read_tracks

    print_columns([(track.name, track.title) for track in read_tracks([])])
    typer.echo("\nOthers: FILE.toml")
