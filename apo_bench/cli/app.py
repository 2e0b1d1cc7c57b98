"""The command line: `apo-bench scenarios | graph | explain | correct | scene | replay | sweep | report | ..`.

Exit codes: 0 a result was produced, also that of a replay that failed physically; 1 none was produced; 2 the
request was wrong, with one sentence on stderr; 128 and the number of the signal that ended it. Lengths in mm, angles in
degrees.
"""

import json
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench import __version__
from apo_bench.cli import arm as cli_arm
from apo_bench.cli import correction as cli_correction
from apo_bench.cli import eye as cli_eye
from apo_bench.cli import noise as cli_noise
from apo_bench.cli import part as cli_part
from apo_bench.cli import plan as cli_plan
from apo_bench.cli import power as cli_power
from apo_bench.cli import recognition as cli_recognition
from apo_bench.cli import recording as cli_recording
from apo_bench.cli import replay_command as cli_replay
from apo_bench.cli import report as cli_report
from apo_bench.cli import scenario as cli_scenario
from apo_bench.cli import show as cli_show
from apo_bench.cli import sweep_command as cli_sweep
from apo_bench.cli import view as cli_view
from apo_bench.cli.arguments import NO_RESULT, check_writable
from apo_bench.cli.help_groups import Grouped
from apo_bench.cli.setting_options import ScenarioArgument, takes, trial_options
from apo_bench.cli.sweep_command import Interrupted
from apo_bench.errors import InputError
from apo_bench.io import streams
from apo_bench.io.plain_text import brief, clean
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
        given = list(sys.argv[1:] if arguments is None else arguments)
        with own_modules_in(here):
            code = app(args=given or ["--help"], prog_name="apo-bench", standalone_mode=False)
        streams.finish()
    except InputError as error:
        return _complain(str(error), WRONG_REQUEST)
    except (Interrupted, KeyboardInterrupt) as error:
        return _complain(str(error) or "interrupted.", getattr(error, "code", _INTERRUPTED))
    except (RuntimeError, streams.Unusable) as error:
        return _complain(str(error), NO_RESULT)
    except MemoryError:
        return _complain("there is not enough memory.", NO_RESULT)
    except OSError as error:
        return _complain(streams.give_up(error), NO_RESULT)
    except SystemExit as error:
        if (broken := streams.broken_pipe(error)) is None:
            raise
        return _complain(streams.give_up(broken), NO_RESULT)
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


@app.command()
def graph(
    scenario: ScenarioArgument,
    step: Annotated[int | None, typer.Option(help="After this operation, from 1; default: the last.")] = None,
    observation: Annotated[Path | None, typer.Option(help="Show the residuals of this observation file.")] = None,
    out: Annotated[Path | None, typer.Option(help="Draw it into this file: .svg or .png.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object, and nothing else.")] = False,
) -> None:
    """Print the relation graph: parts at their placements with their ODLs, contacts made and lost."""
    from apo_bench.assembly.graph import observed_residuals, relation_graph
    from apo_bench.files.observation import read_observation
    from apo_bench.scenario.file import load_scenario
    from apo_bench.show.graph.drawing import draw_graph
    from apo_bench.show.graph.text import graph_form, graph_lines, graph_title

    if out is not None:
        check_writable(out, "--out", (".svg", ".png"))
    loaded = load_scenario(scenario)
    found = relation_graph(loaded.assembly, step)
    seen = None if observation is None else read_observation(observation, loaded)
    residuals = None if seen is None else observed_residuals(seen, found)
    gap_m = loaded.gap_mm * 1e-3 if seen is None else seen.gap_m
    if as_json:
        typer.echo(json.dumps(graph_form(loaded.name, found, residuals), allow_nan=False))
    else:
        typer.echo("\n".join(graph_lines(loaded.name, found, residuals, gap_m)))
    if out is not None:
        title = graph_title(loaded.name, found)
        try:
            draw_graph(found, out, title=title, residuals=residuals, gap_m=gap_m, colors=loaded.colors)
        except OSError as error:
            raise InputError(f"--out {out} cannot be written ({error.strerror}); choose another place.") from error
        if not as_json:
            typer.echo(f"\nWrote {out}")


for commands in (
    *(
        cli_correction,
        cli_eye,
        cli_noise,
        cli_arm,
        cli_part,
        cli_plan,
        cli_power,
        cli_recognition,
        cli_scenario,
        cli_recording,
        cli_show,
        cli_sweep,
        cli_report,
        cli_view,
    ),
):
    commands.register(app)


@app.command()
@takes(trial_options("clearance_mm", "grasp", "arm", "timestep_s"))
def scene(
    scenario: ScenarioArgument, out: Annotated[Path, typer.Option(help="The MJCF file to write.")], **asked: Any
) -> None:
    """Write the scene of a scenario as one MJCF file that opens in MuJoCo's viewer."""
    from apo_bench.records.setting_columns import in_python
    from apo_bench.records.settings import check
    from apo_bench.scenario.file import load_scenario
    from apo_bench.simulation.scene.scene import scene_xml

    given = in_python({name: value for name, value in asked.items() if value is not None})
    for name, value in given.items():
        check(name, value)
    loaded = load_scenario(scenario)
    check_writable(out, "--out", (".xml",))
    xml = scene_xml(loaded, **given)
    out.write_text(xml, encoding="utf-8")
    typer.echo(f"Wrote {out}; open it with: python -m mujoco.viewer --mjcf={out}")


cli_replay.register(app)

if __name__ == "__main__":
    sys.exit(main())
