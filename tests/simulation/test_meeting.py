"""Walls of holes are met by what could come in, and by nothing that is too wide for that."""

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from apo_bench import Scene, build_scene, load_scenario
from apo_bench.geometry import Hull, pose
from apo_bench.simulation.scene.contact_bits import Bits, is_lining, meetings, widest_disc
from apo_bench.simulation.scene.hulls import clip_hull, join_convex, volume
from apo_bench.simulation.scene.walls import COARSE_M, linings, simulated_pieces
from apo_bench.simulation.scene.world import World, make_initial_state, set_part_pose

CLEARANCE_M = 0.25e-3
ROUND = ("nested_bushings", "l_bracket_on_plate")


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(load_scenario("peg_in_hole"))


def meet(a: Bits, b: Bits) -> bool:
    return bool(a.contype & b.conaffinity or b.contype & a.conaffinity)


@pytest.mark.parametrize("seed", range(20))
def test_what_goes_through_a_hole_has_no_wider_disc(seed: int) -> None:
    rng = np.random.default_rng(seed)
    inside = rng.normal(size=(12, 2))
    inside *= rng.uniform(0.2, 1.0, size=(12, 1)) / np.linalg.norm(inside, axis=1)[:, None]
    points = np.column_stack([inside, rng.uniform(-3.0, 3.0, size=12)])
    hull = Hull("any", points[ConvexHull(points).vertices])
    assert widest_disc(hull) <= 1.0


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


def test_a_box_that_was_cut_is_put_together_again() -> None:
    box = Hull("box", np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]))
    cut = np.array([0.6, 0.8, 0.0, 0.7])
    halves = [clip_hull(box, cut), clip_hull(box, -cut)]
    quarters = [clip_hull(half, by * np.array([0.0, 0.0, 1.0, 0.5])) for half in halves for by in (1.0, -1.0)]
    (whole,) = join_convex(quarters)
    assert volume(whole) == pytest.approx(1.0)
    assert len(join_convex([quarters[0], quarters[3]])) == 2
