"""The command `apo-bench inspect plan`: motions, grasps and guards of each operation."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from apo_bench.assembly import Plan
from apo_bench.cli.shared import (
    AsJson,
    DeviationDeg,
    DeviationMm,
    ScenarioArgument,
    check_output,
    make_path_option,
    print_json,
    print_written,
)
from apo_bench.errors import require
from apo_bench.formats.deviations import note_assumed_deviations
from apo_bench.formats.observation import ObservationFile, read_observation_file
from apo_bench.formats.robot_frames import RobotFrames, read_robot_frames
from apo_bench.geometry import pose
from apo_bench.io import redirect_output
from apo_bench.records import CORRECTOR, SETTINGS, WITHOUT_CORRECTOR


def plan_command(
    scenario: ScenarioArgument,
    observation: Annotated[
        Path | None, make_path_option("Plan for the poses of this observation; default: the nominal poses.")
    ] = None,
    method: Annotated[
        str | None, typer.Option(help=f"Method that plans from the observation; default: {CORRECTOR}.")
    ] = None,
    deviation_mm: DeviationMm = None,
    deviation_deg: DeviationDeg = None,
    robot_plan: Annotated[Path | None, make_path_option("Write tip poses, grasps and guarded motions: .json.")] = None,
    frames: Annotated[
        Path | None,
        make_path_option("Base, flange and order of quaternions of --robot-plan: .toml; default: base, tip, xyzw."),
    ] = None,
    ft_sensor: Annotated[
        str | None,
        typer.Option(help="Write also the probing motions for this sensor into --robot-plan."),
    ] = None,
    arm: Annotated[str | None, typer.Option(help="Check whether this arm can execute the plan.")] = None,
    as_json: AsJson = False,
) -> None:
    """Show the plan of each operation: contact states, motions, from where to where, what is guarded, the grasp.

    Examples:
      apo-bench inspect plan pocket_table
      apo-bench inspect plan stick_in_tower --observation docs/seen.csv --robot-plan robot.json
    """
    from apo_bench import load_scenario
    from apo_bench.formats.json_forms import write_form
    from apo_bench.viz.plan_text import describe_plan, format_plan, list_plan_lines
    from apo_bench.viz.robot_form import make_robot_form

    check_output(robot_plan, "--robot-plan", ".json")
    belongs = {
        "--method": method,
        "--deviation-mm": deviation_mm,
        "--deviation-deg": deviation_deg,
        "--robot-plan": robot_plan,
    }
    _require_with("--observation", observation, belongs)
    _require_with("--robot-plan", robot_plan, {"--frames": frames, "--ft-sensor": ft_sensor})
    notes: list[str] = []
    predicted_success = None
    if observation is None:
        task = load_scenario(scenario)
        plan = Plan(task.assembly, task.start, task.nominal_poses)
        where = "at the nominal poses; directions and poses in the frame of the assembly"
    else:
        method = method or CORRECTOR
        read = read_observation_file(observation, scenario, deviation_mm=deviation_mm, deviation_deg=deviation_deg)
        task = read.scenario
        if read.assumed and method not in WITHOUT_CORRECTOR:
            notes.append(note_assumed_deviations(deviation_mm, deviation_deg))
        with redirect_output(as_json):
            plan, predicted_success = _plan_observation(read, method, notes)
        where = f"at the poses of {observation}, {method}; directions in the frame of the assembly, poses in the world"
    robot_frames = RobotFrames() if frames is None else read_robot_frames(frames)
    if arm is not None:
        from apo_bench.simulation.arms.finding import find_arm
        from apo_bench.trial.plan_warnings import describe_arm_limits

        notes.append(describe_arm_limits(task, None if observation is None else plan, arm))
        if frames is None:
            found = find_arm(arm)
            robot_frames = RobotFrames(pose.unpack(np.array([*found.base, *found.turn])))
    lines = list_plan_lines(plan, task)
    if robot_plan is not None:
        form = make_robot_form(lines, plan, task, robot_frames, notes)
        if ft_sensor is not None:
            from apo_bench import build_scene
            from apo_bench.viz.probing_form import make_probing_form

            scene = build_scene(task, arm=arm or SETTINGS["arm"].default)
            form["probing"] = make_probing_form(plan, scene, robot_frames, ft_sensor)
        write_form(form, robot_plan)
    if as_json:
        print_json(describe_plan(lines, task, notes) | {"predicted_success": predicted_success})
        return
    if predicted_success is not None:
        notes.insert(0, f"predicted success: {predicted_success:.2f}")
    typer.echo("\n".join([f"{task.name} {where}: mm and degrees", "", *format_plan(lines), "", *notes]).rstrip())
    print_written(robot_plan)


def _require_with(option: str, value: object, others: dict[str, Any]) -> None:
    """Refuse options that have no meaning without another one."""
    given = ", ".join(name for name, other in others.items() if other is not None)
    require(value is not None or not given, f"{given} needs {option}; add it, or leave {given} out.")


def _plan_observation(read: ObservationFile, method: str, notes: list[str]) -> tuple[Plan, float]:
    """The plan that a method makes from an observation, and its predicted success; adds notes."""
    from apo_bench.trial.plan_warnings import describe_plan_warnings
    from apo_bench.trial.planning import apply_method
    from apo_bench.trial.predicted_success import predict_success

    require(method != "oracle", "--method oracle needs the true poses, which an observation does not hold.")
    result = apply_method(method, read.observation, None, where=read.scenario)
    if result.plan is None:
        why = result.failure.sentence if result.failure is not None else "the method made no plan"
        raise RuntimeError(f"the observation gives no plan: {why.rstrip('.')}.")
    moved = "" if result.fitting is None else result.fitting.sentence
    notes += filter(None, (moved, describe_plan_warnings(read.scenario, result.plan, result.correction)))
    return result.plan, predict_success(result.plan, read.observation, result.correction, read.scenario)
