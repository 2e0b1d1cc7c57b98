"""Pairs of pieces that are surely apart are left out: what remains is what MuJoCo finds without that, bit for bit."""

import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import mujoco
import numpy as np
import pytest

from apo_bench import Scene, build_scene, demonstrate, draw_layout, load_scenario
from apo_bench.geometry import pose
from apo_bench.simulation.scene import apart
from apo_bench.simulation.scene.bounds import NO_BOUNDS
from apo_bench.simulation.scene.world import World, initial_state, place

ROUND = ("peg_in_hole", "nested_bushings", "shaft_through_brackets", "l_bracket_on_plate")
SIZES = ((0.0, 0.0), (1e-5, 1e-4), (3e-4, 3e-3), (3e-3, 3e-2))


@pytest.fixture(scope="module", params=ROUND)
def scene(request: pytest.FixtureRequest) -> Scene:
    return build_scene(load_scenario(request.param))


@pytest.fixture
def compiled() -> None:
    pytest.importorskip("numba")


@pytest.fixture
def without_numba(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    apart._asked.cache_clear()
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "numba", None)
        yield
    apart._asked.cache_clear()


def states(scene: Scene, world: World, count: int) -> Iterator[mujoco.MjData]:
    """Assembled parts, moved a little, up to where they are in each other."""
    rng = np.random.default_rng(0)
    layout = draw_layout(scene.scenario, rng)
    stands = dict(layout.start)
    for operation, goal in zip(scene.scenario.assembly.operations, layout.goals, strict=True):
        stands[operation.main] = goal
    for i in range(count):
        shift, turn = SIZES[i % len(SIZES)]
        data = initial_state(world, layout.start)
        for part in world.free:
            twist = np.concatenate([rng.normal(scale=shift, size=3), rng.normal(scale=turn, size=3)])
            place(world, data, part, stands[part] @ pose.exp(twist))
        mujoco.mj_kinematics(world.model, data)
        mujoco.mj_comPos(world.model, data)
        yield data


def contacts(world: World, data: mujoco.MjData) -> tuple[bytes, ...]:
    mujoco.mj_collision(world.model, data)
    found = data.contact
    return tuple(np.array(x).tobytes() for x in (found.geom, found.dist, found.pos, found.frame, found.friction))


@pytest.mark.usefixtures("compiled")
def test_no_contact_is_lost_or_changed(scene: Scene) -> None:
    for world in (scene.work, scene.shown):
        touching = 0
        for data in states(scene, world, 40):
            wanted = contacts(world, data)
            touching += data.ncon > 0
            with apart.left_out(world):
                assert contacts(world, data) == wanted
        assert touching > 10


@pytest.mark.usefixtures("compiled")
def test_more_than_half_of_the_pairs_of_a_shaft_and_a_wall_are_left_out(scene: Scene) -> None:
    world = scene.shown
    model = world.model
    data = next(states(scene, world, 1))
    walls = np.flatnonzero(world.bounds[:, :3].any(axis=1))
    shafts = np.flatnonzero(world.bounds[:, 10] > 0.0)
    with apart.left_out(world):
        asked = mujoco.get_mjcb_contactfilter()
        pairs = [(a, b) for a in walls for b in shafts if model.geom_bodyid[a] != model.geom_bodyid[b]]
        out = [asked(model._address, data._address, int(a), int(b)) for a, b in pairs]
    assert np.mean(out) > 0.5


def test_bounds_hold_every_corner_of_their_pieces(scene: Scene) -> None:
    model = scene.work.model
    bounds = scene.work.bounds
    assert len(bounds) == model.ngeom
    tight = 0
    for geom in np.flatnonzero(model.geom_type == int(mujoco.mjtGeom.mjGEOM_MESH)):
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        corners = np.float64(model.mesh_vert[first : first + model.mesh_vertnum[mesh]])
        n, d, c, a, r, h = np.split(bounds[geom], [3, 4, 7, 10, 11])
        room = (corners @ n - d).min() if n.any() else 0.0
        assert room >= 0.0
        tight += int(n.any() and room < 1e-7)
        along = (corners - c) @ a
        if r > 0.0:
            assert np.abs(along).max() <= h
            assert np.linalg.norm(corners - c - along[:, None] * a, axis=1).max() <= r
    assert tight > 10


@pytest.mark.usefixtures("compiled")
def test_other_models_meet_as_they_always_do(scene: Scene) -> None:
    boxes = build_scene(load_scenario("block_on_block"))
    assert boxes.work.bounds is NO_BOUNDS
    for data in states(boxes, boxes.work, 8):
        wanted = contacts(boxes.work, data)
        with apart.left_out(boxes.work):
            assert mujoco.get_mjcb_contactfilter() is None
        with apart.left_out(scene.work):
            assert contacts(boxes.work, data) == wanted


@pytest.mark.usefixtures("compiled")
def test_nothing_is_left_behind_also_after_an_error(scene: Scene) -> None:
    def fails() -> None:
        with apart.left_out(scene.work):
            with apart.left_out(scene.shown):
                assert np.count_nonzero(apart._models()[:, 0]) == 2
            assert mujoco.get_mjcb_contactfilter() is not None
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fails()
    assert mujoco.get_mjcb_contactfilter() is None
    assert not apart._models()[:, 0].any()


@pytest.mark.usefixtures("compiled")
def test_a_filter_of_somebody_else_stays(scene: Scene) -> None:
    def theirs(model: mujoco.MjModel, data: mujoco.MjData, a: int, b: int) -> int:
        return 0

    mujoco.set_mjcb_contactfilter(theirs)
    try:
        with apart.left_out(scene.work):
            assert mujoco.get_mjcb_contactfilter() is theirs
        assert mujoco.get_mjcb_contactfilter() is theirs
    finally:
        mujoco.set_mjcb_contactfilter(None)


@pytest.mark.usefixtures("without_numba")
def test_without_numba_nothing_is_left_out(scene: Scene) -> None:
    with apart.left_out(scene.work):
        assert mujoco.get_mjcb_contactfilter() is None


@pytest.mark.usefixtures("compiled")
def test_a_demonstration_is_the_same_to_the_last_bit(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    layout = draw_layout(scene.scenario, np.random.default_rng(3))
    seen = []
    for known in (apart._asked, lambda: None):
        monkeypatch.setattr(apart, "_asked", known)
        shown = demonstrate(scene, layout, 1.0, np.random.default_rng(4))
        seen.append((shown.code, shown.goals.tobytes(), [T.tobytes() for T in shown.final.values()]))
    assert seen[0] == seen[1]


@pytest.mark.usefixtures("compiled")
def test_scenes_that_run_at_the_same_time_keep_to_their_own_bounds(scene: Scene) -> None:
    other = build_scene(load_scenario("peg_in_hole"))
    wanted = [[contacts(world, data) for data in states(each, world, 8)] for each, world in both(scene, other)]

    def run(at: int) -> list[tuple[bytes, ...]]:
        each, world = both(scene, other)[at % 2]
        found = []
        for data in states(each, world, 8):
            with apart.left_out(world):
                found.append(contacts(world, data))
        return found

    with ThreadPoolExecutor(4) as pool:
        assert all(found == wanted[i % 2] for i, found in enumerate(pool.map(run, range(8))))
    assert mujoco.get_mjcb_contactfilter() is None


def both(first: Scene, second: Scene) -> list[tuple[Scene, World]]:
    return [(first, first.work), (second, second.shown)]


def test_an_array_that_is_kept_elsewhere_is_not_looked_for_beyond_the_structure() -> None:
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    assert apart._offset(model, np.zeros(3), apart._MODEL_BYTES) is None
