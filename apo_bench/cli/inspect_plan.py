"""The command `apo-bench inspect plan`: how every operation is done. Only `--arm` and `--acts` need a simulator."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from apo_bench.assembly import Plan
from apo_bench.cli.arguments import AsJson, ScenarioArgument, StatedDeg, StatedMm
from apo_bench.cli.outputs import check_outputs
from apo_bench.cli.printing import print_json
from apo_bench.errors import require
from apo_bench.formats.deviations import assumed_deviations
from apo_bench.formats.observation import read_observation_file
from apo_bench.formats.robot_frames import RobotFrames, read_robot_frames
from apo_bench.geometry import Array, pose
from apo_bench.io import redirect_output
from apo_bench.records import CORRECTOR, SETTINGS
from apo_bench.scenario.file import load_scenario
from apo_bench.scenario.scenario import Scenario


def plan_command(
    scenario: ScenarioArgument,
    observation: Annotated[
        Path | None, typer.Option(help="At the goals of this .json or .csv; default: the nominal ones.")
    ] = None,
    method: Annotated[
        str | None,
        typer.Option(help=f"Who corrects them: none, a corrector, or package.module:name; default: {CORRECTOR}."),
    ] = None,
    deviation_mm: StatedMm = None,
    deviation_deg: StatedDeg = None,
    robot: Annotated[
        Path | None, typer.Option(help="Write tip poses, grasps and guarded motions for a robot into this file: .json.")
    ] = None,
    frames: Annotated[
        Path | None,
        typer.Option(
            help="Base, flange, order of quaternions of --robot: .toml; default: world or the base of --arm, tip, xyzw."
        ),
    ] = None,
    acts: Annotated[
        str | None,
        typer.Option(help="Write into --robot too what a robot that feels does, with this sensor at its wrist."),
    ] = None,
    arm: Annotated[
        str | None, typer.Option(help="Say whether this arm would carry it out; compiles its scene.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Say how every operation is done: contact states, macros, from where until where, what is guarded, the grasp."""
    from apo_bench.formats.json_forms import write_form
    from apo_bench.viz.plan_text import plan_lines, plan_lines_form, plan_text
    from apo_bench.viz.robot_form import robot_form

    check_outputs([(robot, "--robot", (".json",))])
    require(
        frames is None or robot is not None,
        f"--frames {frames} was given without --robot, whose frames they would be; give both.",
    )
    require(
        acts is None or robot is not None, f"--acts {acts} was given without --robot, the file for them; give both."
    )
    robot_frames = RobotFrames() if frames is None else read_robot_frames(frames)
    if observation is None:
        require(method is None, f"--method {method} was given without --observation; give both, or neither.")
        require(
            (deviation_mm, deviation_deg) == (None, None),
            "a standard deviation was given without --observation, whose it would be; leave it out.",
        )
        require(robot is None, "--robot was given without --observation, which says where things are; give both.")
        loaded = load_scenario(scenario)
        notes = list[str]()
        predicted_success = None
        plan = Plan(loaded.assembly, loaded.start, loaded.goals)
        where = "at the nominal goals"
        axes = "directions and until in the frame of the assembly"
    else:
        method = CORRECTOR if method is None else method
        with redirect_output(as_json):
            loaded, plan, predicted_success, notes = _planned(
                scenario, observation, method, (deviation_mm, deviation_deg)
            )
        where = f"at the goals of {observation}, {_by(method)}"
        axes = "directions in the frame of the assembly, until in the world"
    if arm is not None:
        from apo_bench.trial.plan_warnings import arm_sentence

        notes.append(arm_sentence(loaded, None if observation is None else plan, arm))
        if frames is None:
            robot_frames = RobotFrames(_base_of(arm))
    lines = plan_lines(plan, loaded)
    if robot is not None:
        form = robot_form(lines, plan, loaded, robot_frames, notes)
        more = {} if acts is None else {"acts": _acts_form(loaded, plan, robot_frames, acts, arm)}
        write_form(form | more, robot)
    if as_json:
        print_json(plan_lines_form(lines, loaded, notes) | {"predicted_success": predicted_success})
        return
    typer.echo(f"{loaded.name} {where}; {axes}: mm and degrees\n")
    if predicted_success is not None:
        from apo_bench.trial.predicted_success import predicted_success_sentence

        notes.insert(0, f"promised: {predicted_success_sentence(predicted_success)}")
    typer.echo("\n".join([*plan_text(lines), *([""] if notes else []), *notes]))
    if robot is not None:
        typer.echo(f"\nWrote {robot}")


def _base_of(arm: str) -> Array:
    """Where an arm stands, (4, 4), world, [m]."""
    from apo_bench.simulation.arms.finding import find_arm

    found = find_arm(arm)
    return pose.unpack(np.array([*found.base, *found.turn]))


def _acts_form(scenario: Scenario, plan: Plan, frames: RobotFrames, sensor: str, arm: str | None) -> dict[str, Any]:
    from apo_bench.simulation.scene.scene import build_scene
    from apo_bench.viz.acts_form import acts_form

    return acts_form(plan, build_scene(scenario, arm=arm or SETTINGS["arm"].default), frames, sensor)


def _planned(
    scenario: str, observation: Path, method: str, deviations: tuple[float | None, float | None]
) -> tuple[Scenario, Plan, float, list[str]]:
    """The scenario, the plan that a method makes of an observation of it, what it promises, and what is to be said."""
    from apo_bench.trial.plan_warnings import plan_warning
    from apo_bench.trial.planning import apply_method
    from apo_bench.trial.predicted_success import predict_success

    seen, loaded, assumed = read_observation_file(
        observation, scenario, deviation_mm=deviations[0], deviation_deg=deviations[1]
    )
    require(method != "oracle", "--method oracle was given; it knows the truth, which an observation does not tell.")
    result = apply_method(method, seen, None, where=loaded)
    if result.plan is None:
        why = result.failure.sentence if result.failure is not None else "no plan was made"
        raise RuntimeError(f"{observation} gives no plan: {why.rstrip('.')}.")
    warning = plan_warning(loaded, result.plan, result.correction)
    notes = [assumed_deviations(*deviations)] if assumed and result.correction is not None else []
    moved = "" if result.fitting is None else result.fitting.sentence
    predicted_success = predict_success(result.plan, seen, result.correction, loaded)
    notes += filter(None, (moved, warning))
    return loaded, result.plan, predicted_success, notes


def _by(method: str) -> str:
    return {"uncorrected": "as seen", "nominal": "by heart"}.get(method, f"corrected by {method}")
