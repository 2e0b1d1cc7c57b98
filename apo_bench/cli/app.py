"""The program `apo-bench`: its commands, and its exit codes.

Exit codes: 0 a result was produced, also that of a replay that failed physically; 1 none was produced; 2 the request
was wrong, with one sentence on stderr; 128 and the number of a signal that ended it.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Annotated

import typer

from apo_bench import __version__
from apo_bench.cli import arm, assembly, dataset, inspection, method, noise, part, recording, scenario, track
from apo_bench.cli.compare import compare_command
from apo_bench.cli.correct_command import correct_command
from apo_bench.cli.detect_command import detect_contacts_command
from apo_bench.cli.doctor import doctor_command
from apo_bench.cli.leaderboard import leaderboard_command
from apo_bench.cli.report import report_command
from apo_bench.cli.run import run_command
from apo_bench.cli.score import score_command
from apo_bench.cli.shared import NO_RESULT, Command, Group, Interruption
from apo_bench.cli.sweep import sweep_command
from apo_bench.cli.view import view_command
from apo_bench.errors import InputError
from apo_bench.io import clean, shorten_text, streams
from apo_bench.names import own_modules_in

WRONG_REQUEST = 2
_INTERRUPTED = 130
_COMMANDS: Mapping[str, Callable[..., None]] = {
    "run": run_command,
    "view": view_command,
    "correct": correct_command,
    "detect-contacts": detect_contacts_command,
    "sweep": sweep_command,
    "report": report_command,
    "compare": compare_command,
    "score": score_command,
    "leaderboard": leaderboard_command,
    "doctor": doctor_command,
}
_HELP = """
Test whether a robot's replay of an observed assembly fits, with and without correction by face contacts.

Examples:
  apo-bench run stick_in_tower --noise-level 1 --seed 7
  apo-bench scenario list
"""
app = typer.Typer(cls=Group, pretty_exceptions_enable=False, rich_markup_mode=None, help=_HELP)
for _name, _command in _COMMANDS.items():
    app.command(_name, cls=Command)(_command)
for _group in (arm, assembly, dataset, inspection, method, noise, part, recording, scenario, track):
    app.add_typer(_group.commands)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code; `module:name` may name a module in the current folder."""
    try:
        here = streams.prepare_streams()
        words = list(sys.argv[1:] if arguments is None else arguments)
        with own_modules_in(here):
            code = app(args=words or ["--help"], prog_name="apo-bench", standalone_mode=False)
        streams.flush_and_finish()
    except InputError as error:
        return _print_error(str(error), WRONG_REQUEST)
    except (Interruption, KeyboardInterrupt) as error:
        return _print_error(str(error) or "interrupted.", getattr(error, "code", _INTERRUPTED))
    except (RuntimeError, streams.Unusable) as error:
        return _print_error(str(error), NO_RESULT)
    except MemoryError:
        return _print_error("there is not enough memory.", NO_RESULT)
    except OSError as error:
        return _print_error(streams.describe_unexpected_error(error), NO_RESULT)
    except SystemExit as error:
        # the command line library leaves like this when the reader of a pipe is gone
        if not isinstance(error.__context__, OSError):
            raise
        streams.discard_output()
        return 0
    except Exception as error:
        if not hasattr(error, "format_message"):
            raise
        return _print_error(" ".join(error.format_message().split()), WRONG_REQUEST)
    return int(code or 0)


def _print_error(sentence: str, code: int) -> int:
    with suppress(OSError):
        typer.echo(f"apo-bench: {shorten_text(clean(sentence))}", err=True)
    return code


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"apo-bench {__version__}")
        raise typer.Exit


@app.callback()
def _accept_options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Options of the program itself."""


if __name__ == "__main__":
    sys.exit(main())
