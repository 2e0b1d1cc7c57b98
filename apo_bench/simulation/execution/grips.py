"""The grips of a transfer as tip poses: for carrying, for centring a placed part, for squaring one before its pick."""

from collections.abc import Iterable
from dataclasses import replace

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import Array, shrink_pieces
from apo_bench.planning.insertion.insertion_geometry import list_later_walls, list_walls_of_operation
from apo_bench.scenario.scenario import Grasp
from apo_bench.simulation.execution.grasp_clearance import RestingPart, Stroke, list_obstacles
from apo_bench.simulation.execution.grasp_frame import half_width, make_tip_frame
from apo_bench.simulation.execution.grasping import Grips, clear_across, grasp_at, grips_along
from apo_bench.simulation.execution.transfer import ApproachLine, Grip, Motion
from apo_bench.simulation.robot import measure_turn
from apo_bench.simulation.scene import Scene

_WRIST_ENDS = 2.5
"""Greatest turn of a hand that looks down from its rest, [rad]; beyond it, the opposite grip is used."""


def transfer_grips(
    scene: Scene, part: str, preferred: Grasp, out: ApproachLine, into: ApproachLine, estimated: Poses, after: Poses
) -> tuple[tuple[Grip, ...], ApproachLine, ApproachLine]:
    """Choose the grips of a transfer.

    Args:
        preferred: The grasp of the scenario, used if it is clear.
        out: The line out of the start.
        into: The line to the goal.
        estimated: Estimated poses of all parts before the transfer.
        after: Their poses after it.

    Returns:
        One grip or two, in the order of use, and the lines out and into with the place where the grip changes.
    """
    start = RestingPart(estimated[part], list_obstacles(scene.scenario.assembly.solids, estimated, (part,)))
    goal = RestingPart(after[part], list_obstacles(scene.scenario.assembly.solids, after, (part,)))
    if into.level:
        stroke = Stroke(goal.T, into.direction, into.travel, goal.around)
        grips = grips_along(scene, part, preferred, (start,), stroke)
        into = ApproachLine(into.direction, into.travel, grips.left)
    elif out.level:
        stroke = Stroke(start.T, out.direction, out.travel, start.around)
        # The part is pulled out backwards, so the grips are chosen for the insertion and used in the reverse order.
        backwards = grips_along(scene, part, preferred, (goal,), stroke)
        grips = backwards if backwards.second is None else Grips(backwards.second, backwards.left, backwards.first)
        out = ApproachLine(out.direction, out.travel, backwards.left)
    else:
        grips = Grips(grasp_at(scene, part, preferred, (start, goal)))
    grasps = (grips.first,) if grips.second is None else (grips.first, grips.second)
    return tuple(_grip(scene, part, grasp, start.T, goal.T) for grasp in grasps), out, into


def _grip(scene: Scene, part: str, grasp: Grasp, start: Array, goal: Array) -> Grip:
    """Return a grasp as a tip pose; of the two opposite ones, that which turns the wrist less at start and goal.

    Args:
        start, goal: Poses of the part, (4, 4).
    """
    other = replace(grasp, across=-grasp.across)
    rest = scene.kinematics.forward(scene.arm.home)
    tips = [make_tip_frame(each, start) for each in (grasp, other)]
    tip = min(tips, key=lambda T: max(abs(measure_turn(rest, start @ T)), abs(measure_turn(rest, goal @ T))))
    pieces = shrink_pieces(scene.scenario.assembly.solids[part], scene.clearance_mm * 1e-3)
    return Grip(tip, half_width(pieces, grasp, start))


def centring_grips(
    assembly: Assembly, scene: Scene, k: int, grip: Grip, macros: tuple[Motion, ...], after: Poses
) -> tuple[Grip, ...]:
    """Return grips that centre a placed part in level directions that matter later and are still undetermined.

    Fingers centre a part along their closing direction only; across it, the part may have drifted in the hand. Later
    fits need the part in its place across their walls.

    Args:
        k: The operation that places the part.
        grip: The grip in which the part is placed.
        macros: Those of the operation; a slide determines its direction.
        after: Poses of all parts after the operation.
    """
    part = assembly.operations[k].main
    sides = [macro.direction for macro in macros if macro.name == "slide-to-contact"]
    place = RestingPart(after[part], list_obstacles(assembly.solids, after, (part,)))
    grasps = _across_walls(scene, part, grip, list_later_walls(assembly, k, part), place, sides)
    return tuple(_grip(scene, part, grasp, place.T, place.T) for grasp in grasps)


def squaring_grips(assembly: Assembly, scene: Scene, k: int, grip: Grip, estimated: Poses) -> tuple[Grip, ...]:
    """Return grips that square a part before its pick, in level directions that matter and that `grip` leaves open.

    Each is turned from `grip` by a quarter turn in the same sense, unless the wrist cannot. So the tool error shifts
    every part by the same amount.

    Args:
        k: The operation that moves the part.
        estimated: Estimated poses of all parts before the operation.
    """
    part = assembly.operations[k].main
    T = estimated[part]
    place = RestingPart(T, list_obstacles(assembly.solids, estimated, (part,)))
    walls = [*list_walls_of_operation(assembly, k, part), *list_later_walls(assembly, k, part)]
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
    """Return a clear grasp across each wall whose normal is level and not yet determined.

    Args:
        grip: Determines the position along its closing direction.
        walls: Normals in the frame of the part, (3,) each.
        sides: Further determined directions, (3,) each, world.
    """
    R = place.T[:3, :3]
    # Column 0 of a tip pose is its closing direction. Directions less than 60 degrees apart count as the same.
    settled = [R @ grip.T_part_tip[:3, 0], *sides]
    grasps = []
    for wall in walls:
        if abs((R @ wall)[2]) < 0.5 and all(abs(R @ wall @ direction) < 0.5 for direction in settled):
            settled.append(R @ wall)
            grasp = clear_across(scene, part, wall, place)
            grasps += [] if grasp is None else [grasp]
    return grasps
