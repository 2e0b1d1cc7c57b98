"""Walls of holes are met by what could come in, and by nothing that is too wide for that."""

import mujoco
import numpy as np
import pytest

from apo_bench import Scene, build_scene, load_scenario
from apo_bench.geometry import pose
from apo_bench.simulation.scene.contact_bits import Bits, is_lining, meetings, widest_disc
from apo_bench.simulation.scene.walls import COARSE_M, linings, simulated_pieces
from apo_bench.simulation.scene.world import World, make_initial_state, set_part_pose

CLEARANCE_M = 0.25e-3
ROUND = ("nested_bushings", "l_bracket_on_plate")


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(load_scenario("peg_in_hole"))


def meet(a: Bits, b: Bits) -> bool:
    return bool(a.contype & b.conaffinity or b.contype & a.conaffinity)


@pytest.mark.parametrize("name", ROUND)
def test_walls_meet_what_could_come_in_and_the_arm(name: str) -> None:
    solids = load_scenario(name).assembly.solids
    bits = meetings(solids, CLEARANCE_M)
    arm = Bits(1, 0)
    for part, solid in solids.items():
        for wall, width in linings(solid, CLEARANCE_M).items():
            if wall not in bits[part]:
                continue  # it has become one with its neighbour
            assert meet(bits[part][wall], arm)
            for other in solids:
                for pieces in simulated_pieces(solids[other], CLEARANCE_M).values():
                    for piece in pieces:
                        if other != part and not is_lining(bits[other][piece.name]) and widest_disc(piece) <= width:
                            assert meet(bits[part][wall], bits[other][piece.name])


def play(world: World, data: mujoco.MjData, angle: float, off_m: float) -> int:
    """At how many points a peg in the middle of a plate touches it that is so far off the axis."""
    plate = pose.at((0.3, 0.2, 0.3))
    set_part_pose(world, data, "plate", plate)
    set_part_pose(world, data, "peg", plate @ pose.at((off_m * np.cos(angle), off_m * np.sin(angle), -0.03)))
    mujoco.mj_kinematics(world.model, data)
    mujoco.mj_comPos(world.model, data)
    mujoco.mj_collision(world.model, data)
    parts = world.geom_part[data.contact.geom]
    pair = {world.free.index("plate"), world.free.index("peg")}
    return sum({int(a), int(b)} == pair for a, b in parts)


def test_a_peg_has_its_play_in_every_direction(scene: Scene) -> None:
    data = make_initial_state(scene.shown, scene.scenario.start)
    for angle in np.radians(np.arange(0.0, 360.0, 3.7)):
        assert play(scene.shown, data, angle, CLEARANCE_M - 1e-6) == 0
        assert play(scene.shown, data, angle, CLEARANCE_M + COARSE_M) > 0
