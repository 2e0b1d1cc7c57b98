"""The command line: `apo-bench scenario list | graph | explain | correct | scene | replay | sweep | report | ..`.

Exit codes: 0 a result was produced, also that of a replay that failed physically; 1 none was produced; 2 the
request was wrong, with one sentence on stderr; 128 and the number of the signal that ended it. Lengths in mm, angles in
degrees.
"""

import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Annotated

import typer

from apo_bench import __version__
from apo_bench.cli import noise, part, recording, scenario, score, sweep
from apo_bench.cli.arguments import NO_RESULT
from apo_bench.cli.correct_command import correct_command
from apo_bench.cli.detect_command import detect_contacts_command
from apo_bench.cli.help import Grouped, GroupedOptions, group
from apo_bench.cli.inspect_depth import depth_command
from apo_bench.cli.inspect_dof import dof_command
from apo_bench.cli.inspect_graph import graph_command
from apo_bench.cli.inspect_plan import plan_command
from apo_bench.cli.inspect_poses import poses_command
from apo_bench.cli.inspect_scene import scene_command
from apo_bench.cli.run_command import run_command
from apo_bench.cli.view import view_command
from apo_bench.errors import InputError
from apo_bench.io import brief, clean, streams
from apo_bench.names import own_modules_in

app = typer.Typer(
    cls=Grouped,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Does a robot's replay of an observed assembly fit, with and without correction by face contacts?",
)

WRONG_REQUEST = 2
_INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code. What `module:name` names may lie in the current folder."""
    try:
        here = streams.prepare()
        words = list(sys.argv[1:] if arguments is None else arguments)
        with own_modules_in(here):
            code = app(args=words or ["--help"], prog_name="apo-bench", standalone_mode=False)
        streams.finish()
    except InputError as error:
        return _complain(str(error), WRONG_REQUEST)
    except (sweep.Interrupted, KeyboardInterrupt) as error:
        return _complain(str(error) or "interrupted.", getattr(error, "code", _INTERRUPTED))
    except (RuntimeError, streams.Unusable) as error:
        return _complain(str(error), NO_RESULT)
    except MemoryError:
        return _complain("there is not enough memory.", NO_RESULT)
    except OSError as error:
        return _complain(streams.unexpected(error), NO_RESULT)
    except SystemExit as error:
        # what the command line library makes of a pipe that nobody reads
        if not isinstance(error.__context__, OSError):
            raise
        streams.give_up_output()
        return 0
    except Exception as error:
        if not hasattr(error, "format_message"):
            raise
        return _complain(" ".join(error.format_message().split()), WRONG_REQUEST)
    if code == _INTERRUPTED:  # what the command line library makes of Ctrl-C
        return _complain("interrupted.", _INTERRUPTED)
    return int(code or 0)


def _complain(sentence: str, code: int) -> int:
    with suppress(OSError):
        typer.echo(f"apo-bench: {brief(clean(sentence))}", err=True)
    return code


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"apo-bench {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Options of every command."""


_LONG = ("run", "sweep")
"""Commands whose options are listed in groups."""
_COMMANDS: dict[str, Callable[..., None]] = {
    "run": run_command,
    "view": view_command,
    "correct": correct_command,
    "detect-contacts": detect_contacts_command,
    "sweep": sweep.sweep_command,
    "report": score.report_command,
    "compare": score.compare_command,
    "score": score.score_command,
    "leaderboard": score.leaderboard_command,
}
_INSPECT: dict[str, Callable[..., None]] = {
    "dof": dof_command,
    "plan": plan_command,
    "graph": graph_command,
    "scene": scene_command,
    "poses": poses_command,
    "depth": depth_command,
}
inspect = group("inspect", "Look into one plan: free directions, motions, relation graph, scene, poses, depth images.")
for _name, _command in _COMMANDS.items():
    app.command(_name, cls=GroupedOptions if _name in _LONG else None)(_command)
for _name, _command in _INSPECT.items():
    inspect.command(_name)(_command)
for _group in (inspect, sweep.dataset, noise.noise, part.arm, part.part, scenario.scenario, recording.recording):
    app.add_typer(_group)

if __name__ == "__main__":
    sys.exit(main())
