"""How the gripper holds the part of a transfer, as poses of the tip."""

from collections.abc import Iterable
from dataclasses import replace

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import Array, shrink_pieces
from apo_bench.planning.insertion.surroundings import later_walls, own_walls
from apo_bench.scenario.scenario import Grasp
from apo_bench.simulation.execution.grasping import (
    Grips,
    RestingPart,
    Stroke,
    clear_across,
    grasp_at,
    grips_along,
    half_width,
    list_obstacles,
    make_tip_frame,
)
from apo_bench.simulation.execution.transfer import ApproachLine, Grip, Motion
from apo_bench.simulation.robot import measure_turn
from apo_bench.simulation.scene import Scene

_WRIST_ENDS = 2.5
"""A hand that looks down is turned by no more than this from its rest where there is another way, [rad]."""


def transfer_grips(
    scene: Scene, part: str, preferred: Grasp, out: ApproachLine, into: ApproachLine, estimated: Poses, after: Poses
) -> tuple[tuple[Grip, ...], ApproachLine, ApproachLine]:
    """Where to hold the part, and both lines, out and into, with the place where the grip changes.

    Args:
        estimated: Where all parts are before the transfer.
        after: Where all parts are after it.
    """
    start = RestingPart(estimated[part], list_obstacles(scene.scenario.assembly.solids, estimated, (part,)))
    goal = RestingPart(after[part], list_obstacles(scene.scenario.assembly.solids, after, (part,)))
    if into.level:
        stroke = Stroke(goal.T, into.direction, into.travel, goal.around)
        grips = grips_along(scene, part, preferred, (start,), stroke)
        into = ApproachLine(into.direction, into.travel, grips.left)
    elif out.level:
        stroke = Stroke(start.T, out.direction, out.travel, start.around)
        backwards = grips_along(scene, part, preferred, (goal,), stroke)
        grips = backwards if backwards.second is None else Grips(backwards.second, backwards.left, backwards.first)
        out = ApproachLine(out.direction, out.travel, backwards.left)
    else:
        grips = Grips(grasp_at(scene, part, preferred, (start, goal)))
    grasps = (grips.first,) if grips.second is None else (grips.first, grips.second)
    return tuple(_grip(scene, part, grasp, start.T, goal.T) for grasp in grasps), out, into


def _grip(scene: Scene, part: str, grasp: Grasp, start: Array, goal: Array) -> Grip:
    """The grasp as a pose of the tip; of the two ways round, the one that turns the wrist less."""
    other = replace(grasp, across=-grasp.across)
    rest = scene.kinematics.forward(scene.arm.home)
    tips = [make_tip_frame(each, start) for each in (grasp, other)]
    tip = min(tips, key=lambda T: max(abs(measure_turn(rest, start @ T)), abs(measure_turn(rest, goal @ T))))
    pieces = shrink_pieces(scene.scenario.assembly.solids[part], scene.clearance_mm * 1e-3)
    return Grip(tip, half_width(pieces, grasp, start))


def centring_grips(
    assembly: Assembly, scene: Scene, k: int, grip: Grip, macros: tuple[Motion, ...], after: Poses
) -> tuple[Grip, ...]:
    """Grips across the level directions in which the part's place will matter and nothing has settled it.

    Closing fingers centre a part in their own direction only; along them it has drifted in the hand. What fits into
    or onto the part later needs it in its place across the walls of that fit.
    """
    part = assembly.operations[k].main
    sides = [macro.direction for macro in macros if macro.name == "slide-to-contact"]
    place = RestingPart(after[part], list_obstacles(assembly.solids, after, (part,)))
    grasps = _across_walls(scene, part, grip, later_walls(assembly, k, part), place, sides)
    return tuple(_grip(scene, part, grasp, place.T, place.T) for grasp in grasps)


def squaring_grips(assembly: Assembly, scene: Scene, k: int, grip: Grip, estimated: Poses) -> tuple[Grip, ...]:
    """Grips across the level directions in which the part will have to be known and the grip itself does not settle it.

    All are turned from it the same way, by a quarter, unless the wrist ends there: a tip that is off on the hand then
    shifts every part by the same.
    """
    part = assembly.operations[k].main
    T = estimated[part]
    place = RestingPart(T, list_obstacles(assembly.solids, estimated, (part,)))
    walls = [*own_walls(assembly, k, part), *later_walls(assembly, k, part)]
    pieces = shrink_pieces(assembly.solids[part], scene.clearance_mm * 1e-3)
    rest = scene.kinematics.forward(scene.arm.home)
    turned = []
    for grasp in _across_walls(scene, part, grip, walls, place, ()):
        ahead = make_tip_frame(grasp, T)[:3, 0] @ grip.T_part_tip[:3, 1] > 0.0
        other = replace(grasp, across=-grasp.across)
        tip, back = (make_tip_frame(each, T) for each in ((grasp, other) if ahead else (other, grasp)))
        turned.append(
            Grip(back if abs(measure_turn(rest, T @ tip)) > _WRIST_ENDS else tip, half_width(pieces, grasp, T))
        )
    return tuple(turned)


def _across_walls(
    scene: Scene, part: str, grip: Grip, walls: Iterable[Array], place: RestingPart, sides: Iterable[Array]
) -> list[Grasp]:
    """A clear grasp across each level wall of the part at its place that neither the grip nor sides settle."""
    R = place.T[:3, :3]
    settled = [R @ grip.T_part_tip[:3, 0], *sides]
    grasps = []
    for wall in walls:
        if abs((R @ wall)[2]) < 0.5 and all(abs(R @ wall @ direction) < 0.5 for direction in settled):
            settled.append(R @ wall)
            grasp = clear_across(scene, part, wall, place)
            grasps += [] if grasp is None else [grasp]
    return grasps
