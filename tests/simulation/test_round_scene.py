"""Scenes of convex pieces: their geoms are where the part has them, and round parts come to rest."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from apo_bench import Scene, build_scene
from apo_bench.assembly import Operation
from apo_bench.geometry import SAGITTA_M, Hull, Piece, pose, shrink_pieces
from apo_bench.scenario.parts.making import build_solid, make_shaft
from apo_bench.scenario.scenario import Grasp
from apo_bench.simulation.scene.walls import simulated_pieces
from apo_bench.simulation.scene.world import World, get_part_pose, make_initial_state, set_part_pose
from tests.round_scenes import PLATE, contacts, peg_in_hole, scenario


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return build_scene(peg_in_hole(tmp_path_factory.mktemp("parts")))


def corners_in(world: World, data: mujoco.MjData, geom: str) -> np.ndarray:
    """The corners of a mesh as it collides, (k, 3), world."""
    geom_of_model = world.model.geom(geom)
    k = int(geom_of_model.dataid[0])
    first = int(world.model.mesh_vertadr[k])
    count = int(world.model.mesh_vertnum[k])
    R = data.geom_xmat[geom_of_model.id].reshape(3, 3)
    p = data.geom_xpos[geom_of_model.id]
    return np.asarray(world.model.mesh_vert[first : first + count] @ R.T + p)


def made_of(scene: Scene, part: str) -> list[Piece]:
    c = 1e-3 * scene.clearance_mm
    solid = scene.scenario.assembly.solids[part]
    return [p for several in simulated_pieces(solid, c).values() for p in several]


def test_meshes_collide_where_the_part_has_its_corners(scene: Scene):
    T = pose.at((0.2, -0.1, 0.3), (20.0, -50.0, 130.0))
    data = make_initial_state(scene.work, scene.scenario.start)
    set_part_pose(scene.work, data, "plate", T)
    mujoco.mj_kinematics(scene.work.model, data)
    for piece in made_of(scene, "plate"):
        assert isinstance(piece, Hull)
        apart = np.linalg.norm(
            corners_in(scene.work, data, f"plate/{piece.name}")[:, None] - pose.apply(T, piece.corners)[None], axis=2
        )
        assert apart.min(axis=0).max() < 1e-8  # meshes are kept in single precision
        assert apart.min(axis=1).max() < 1e-8


def test_a_piece_that_vanished_behind_a_fit_face_is_not_simulated(tmp_path: Path):
    given = peg_in_hole(tmp_path)
    solids = given.assembly.solids
    gone, *left = solids["plate"].pieces
    fewer = replace(given.assembly, solids={**solids, "plate": replace(solids["plate"], pieces=tuple(left))})
    model = build_scene(replace(given, assembly=fewer)).work.model
    names = [model.geom(i).name for i in range(model.ngeom)]
    assert f"plate/{gone.name}" not in names
    assert f"plate/{left[0].name}" in names


@pytest.mark.parametrize("part", ["peg", "plate"])
def test_mass_and_inertia_are_those_of_the_exact_solid(scene: Scene, part: str):
    model = scene.work.model
    solid = scene.scenario.assembly.solids[part]
    body = model.body(f"{part}/{part}")
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, body.iquat)
    J = R.reshape(3, 3) @ np.diag(body.inertia) @ R.reshape(3, 3).T
    assert solid.inertia is not None
    assert float(body.mass[0]) == pytest.approx(1000.0 * solid.volume)
    assert body.ipos == pytest.approx(solid.centroid, abs=1e-12)
    assert pytest.approx(1000.0 * solid.inertia, rel=1e-6, abs=1e-15) == J


@pytest.mark.parametrize("clearance_m", [0.0, 0.00025])
def test_walls_and_what_is_behind_them_are_the_same_part(clearance_m: float):
    solid = build_solid("plate", PLATE)
    whole = shrink_pieces(solid, clearance_m)
    cut = [p for several in simulated_pieces(solid, clearance_m).values() for p in several]
    corners = [
        p.corners if isinstance(p, Hull) else p.center + p.half * np.array([[1, 1, 1], [-1, -1, -1]]) for p in cut
    ]
    volume = sum(ConvexHull(p.corners).volume for p in cut if isinstance(p, Hull))
    wanted = sum(ConvexHull(p.corners).volume for p in whole if isinstance(p, Hull))
    assert volume == pytest.approx(wanted, rel=1e-3)
    assert volume < wanted
    inner = min(float((p.planes[:, :3] @ [0.0, 0.0, 0.01] - p.planes[:, 3]).max()) for p in cut if isinstance(p, Hull))
    assert inner == pytest.approx(0.005 + clearance_m, abs=1e-9)
    tops = {round(1e6 * float(c[:, 2].max())) for c in corners}
    assert tops == {20000, 20000 - round(1e6 * SAGITTA_M)}


def test_flat_ends_that_graze_a_round_part_are_not_found_deep_inside_of_it(tmp_path: Path):
    """With MuJoCo's own tolerance a wall of a hole is at times found millimetres inside of a cylinder it stands on."""
    operations = [
        Operation("stub", contacts("stub", "bottom-table.top")),
        Operation("plate", contacts("plate", "bottom-stub.top")),
    ]
    start = {"plate": pose.at((0, -0.27, 0)), "stub": pose.at((0, 0.27, 0))}
    grasps = [Grasp(np.array([0.0, 0.0, 0.02]), np.array([1.0, 0.0, 0.0]))] * 2
    bodies = {"plate": PLATE, "stub": make_shaft(11, 0, 40, "wall", bottom="bottom", top="top")}
    its = build_scene(scenario(tmp_path, bodies, operations, [np.eye(4), pose.at((0, 0, 0.04))], start, grasps)).shown
    data = make_initial_state(its, start | {"table": np.eye(4)})
    rng = np.random.default_rng(0)
    stub = pose.at((0.3, 0.2, 0.3))
    set_part_pose(its, data, "stub", stub)
    for _ in range(200):
        at = (*rng.normal(scale=1e-6, size=2), 0.04 - SAGITTA_M + rng.normal(scale=1e-8))
        turn = (*rng.normal(size=2) * 10.0 ** rng.uniform(-7, -4), rng.uniform(-20, 20))
        set_part_pose(its, data, "plate", stub @ pose.at(at, turn))
        mujoco.mj_fwdPosition(its.model, data)
        assert data.contact.dist.min() > -1e-5


def test_a_peg_stands_on_its_end_and_one_that_lies_stays(scene: Scene):
    for turn in ((0.0, 0.0, 0.0), (90.0, 0.0, 0.0), (0.0, 90.0, 30.0)):
        data = make_initial_state(scene.shown, scene.scenario.start)
        T = pose.at((0.1, 0.1, 0.025 if turn == (0.0, 0.0, 0.0) else 0.005), turn)
        set_part_pose(scene.shown, data, "peg", T)
        mujoco.mj_step(scene.shown.model, data, 1500)
        off = pose.inverse(T) @ get_part_pose(scene.shown, data, "peg")
        assert np.abs(off[:3, 3]).max() < 2e-5  # without friction of rolling one that lies is centimetres away
        assert np.abs(off[:3, :3] - np.eye(3)).max() < 2e-3
        v = scene.shown.dof["peg"]
        assert np.abs(data.qvel[v : v + 3]).max() < 1e-4
