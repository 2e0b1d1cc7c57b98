"""One command: `apo-bench plan`, operations as macros with their motion parameters; only `--arm` needs a simulator."""

import json
from pathlib import Path
from typing import Annotated

import typer

from apo_bench.assembly.goals import Plan
from apo_bench.cli.arguments import check_writable
from apo_bench.cli.setting_options import ScenarioArgument
from apo_bench.errors import InputError
from apo_bench.files.deviations import assumed_deviations
from apo_bench.io.output import redirect_output
from apo_bench.records.short_names import CORRECTOR
from apo_bench.scenario.scenario import Scenario


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(plan)


def plan(
    scenario: ScenarioArgument,
    observation: Annotated[
        Path | None, typer.Option(help="At the goals of this .json or .csv; default: the nominal ones.")
    ] = None,
    method: Annotated[
        str | None, typer.Option(help="Who corrects them: none, a corrector, or package.module:name; default: contact.")
    ] = None,
    deviation_mm: Annotated[float | None, typer.Option(help="Its standard deviation where it states none, mm.")] = None,
    deviation_deg: Annotated[float | None, typer.Option(help="The same in degrees.")] = None,
    robot: Annotated[
        Path | None, typer.Option(help="Write tip poses, grasps and guarded motions for a robot into this file: .json.")
    ] = None,
    frames: Annotated[
        Path | None,
        typer.Option(help="Base, flange, order of quaternions of --robot: .toml; default: world, tip, xyzw."),
    ] = None,
    arm: Annotated[
        str | None, typer.Option(help="Say whether this arm would carry it out; compiles its scene.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object, and nothing else.")] = False,
) -> None:
    """Say how every operation is done: contact states, macros, from where until where, what is guarded, the grasp."""
    from apo_bench.files.json_forms import write_form
    from apo_bench.files.robot_frames import RobotFrames, read_robot_frames
    from apo_bench.scenario.file import load_scenario
    from apo_bench.show.plan_text import plan_lines, plan_lines_form, plan_text
    from apo_bench.show.robot_form import robot_form

    if robot is not None:
        check_writable(robot, "--robot", (".json",))
    if frames is not None and robot is None:
        raise InputError(f"--frames {frames} was given without --robot, whose frames they would be; give both.")
    stated = RobotFrames() if frames is None else read_robot_frames(frames)
    if observation is None:
        if method is not None:
            raise InputError(f"--method {method} was given without --observation; give both, or neither.")
        if (deviation_mm, deviation_deg) != (None, None):
            raise InputError("a standard deviation was given without --observation, whose it would be; leave it out.")
        if robot is not None:
            raise InputError("--robot was given without --observation, which says where things are; give both.")
        loaded = load_scenario(scenario)
        notes = list[str]()
        asked = Plan(loaded.assembly, loaded.start, loaded.goals)
        where = "at the nominal goals"
        axes = "directions and until in the frame of the assembly"
    else:
        method = CORRECTOR if method is None else method
        with redirect_output(as_json):
            loaded, asked, notes = _planned(scenario, observation, method, (deviation_mm, deviation_deg))
        where = f"at the goals of {observation}, {_by(method)}"
        axes = "directions in the frame of the assembly, until in the world"
    if arm is not None:
        from apo_bench.trial.plan_warning import arm_sentence

        notes.append(arm_sentence(loaded, None if observation is None else asked, arm))
    lines = plan_lines(asked, loaded)
    if robot is not None:
        write_form(robot_form(lines, asked, loaded, stated, notes), robot)
    if as_json:
        typer.echo(json.dumps(plan_lines_form(lines, loaded, notes), allow_nan=False))
        return
    typer.echo(f"{loaded.name} {where}; {axes}: mm and degrees\n")
    typer.echo("\n".join([*plan_text(lines), *([""] if notes else []), *notes]))
    if robot is not None:
        typer.echo(f"\nWrote {robot}")


def _planned(
    scenario: str, observation: Path, method: str, deviations: tuple[float | None, float | None]
) -> tuple[Scenario, Plan, list[str]]:
    """The scenario, the plan that a method makes of an observation of it, and what is to be said with it."""
    from apo_bench.files.observation import read_observation_file
    from apo_bench.trial.plan_warning import plan_warning
    from apo_bench.trial.planning import apply_method

    stated = zip(("deviation_mm", "deviation_deg"), deviations, strict=True)
    seen, loaded, assumed = read_observation_file(
        observation, scenario, **{name: x for name, x in stated if x is not None}
    )
    if method == "oracle":
        raise InputError("--method oracle was given; it knows the truth, which an observation does not tell.")
    found = apply_method(method, seen, None, where=loaded)
    if found.plan is None:
        why = found.failure.sentence if found.failure is not None else "no plan was made"
        raise RuntimeError(f"{observation} gives no plan: {why.rstrip('.')}.")
    wrong = plan_warning(loaded, found.plan, found.correction)
    notes = [assumed_deviations(*deviations)] if assumed and found.correction is not None else []
    moved = "" if found.fitting is None else found.fitting.sentence
    return loaded, found.plan, [*notes, *filter(None, (moved, wrong))]


def _by(method: str) -> str:
    return {"none": "as seen", "by-heart": "by heart"}.get(method, f"corrected by {method}")
