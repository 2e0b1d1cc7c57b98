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
    """List the tracks that come with the package; those in brackets do not count in the overall score.

    Examples:
      apo-bench track list
      apo-bench score contact --track given --quick --out entry.json
    """
    from apo_bench.benchmark.scoring.track import read_track, track_names

    tracks = sorted(map(read_track, track_names()), key=lambda track: not track.overall)
    print_columns([(track.name if track.overall else f"({track.name})", track.title) for track in tracks])
    typer.echo("\nOthers: FILE.toml")
