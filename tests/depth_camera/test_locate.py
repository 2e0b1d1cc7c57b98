"""The pure half of the range finder: distances, symmetries, regions, fits and what they say of themselves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench import Assembly
from apo_bench.assembly import Operation
from apo_bench.depth_camera.distance import Shape, join_shapes, shape_of, signed_distance, strike_distances
from apo_bench.depth_camera.fit import PRIOR, Points, covariance, distinct, refine, starts
from apo_bench.depth_camera.follow import Expected, follow_demonstration
from apo_bench.depth_camera.range_finder import (
    PinholeView,
    RangeFinder,
    RangeImage,
    look_at,
    median_filtered,
    regions,
    share_explained,
    without_small,
)
from apo_bench.geometry import Array, nearest_symmetric_pose, pose, quarter_turns, symmetries
from tests.scenes import block, castle, cube, mm, stick

SEEDS = st.integers(0, 2**32 - 1)
SOLIDS = {"castle": castle(), "cube": cube(), "stick": stick(), "block": block()}
SHAPES = {name: shape_of(solid.pieces) for name, solid in SOLIDS.items()}
STANDING = pose.at((0.05, 0.02, 0.0), (0.0, 0.0, 25.0))


def range_of(shape: Shape, view: PinholeView) -> Array:
    """True distances of a shape in the world, and of a table, (height, width)."""
    table = Shape(np.array([[0.0, 0.0, -0.01]]), np.array([[0.6, 0.6, 0.01]]), np.eye(3)[None])
    distance, _ = strike_distances(join_shapes([shape, table]), view.origin, view.rays)
    return np.minimum(distance, 3.0).reshape(view.height, view.width)


def posed(shape: Shape, T: Array) -> Shape:
    return Shape(shape.center @ T[:3, :3].T + T[:3, 3], shape.half, T[:3, :3] @ shape.turn)


def points_on(shape: Shape, T: Array, views: tuple[PinholeView, ...] | None = None) -> Points:
    """What the views of the range finder see of a shape at T, without any error."""
    at = []
    rays = []
    number = []
    for v, view in enumerate(views or RangeFinder().views):
        distance, _ = strike_distances(posed(shape, T), view.origin, view.rays)
        hit = np.isfinite(distance)
        at.append(view.origin + distance[hit, None] * view.rays[hit])
        rays.append(view.rays[hit])
        number.append(np.full(int(hit.sum()), v))
    return Points(np.concatenate(at), np.concatenate(rays), np.concatenate(number))


@settings(max_examples=50, deadline=None)
@given(seed=SEEDS, name=st.sampled_from(sorted(SHAPES)))
def test_rays_end_on_the_surface_and_meet_nothing_before(seed: int, name: str) -> None:
    rng = np.random.default_rng(seed)
    shape = SHAPES[name]
    origin = rng.standard_normal(3)
    origin *= 0.6 / np.linalg.norm(origin)
    rays = -origin + 0.08 * rng.standard_normal((40, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    distance, box = strike_distances(shape, origin, rays)
    hit = np.isfinite(distance)
    assert (hit == (box >= 0)).all()
    ends = origin + distance[hit, None] * rays[hit]
    on_surface = np.abs(signed_distance(shape, ends)[0])
    assert on_surface.max(initial=0.0) < 1e-9
    for part in (0.2, 0.6, 0.95, 0.999):
        assert signed_distance(shape, origin + part * distance[hit, None] * rays[hit])[0].min(initial=1.0) > -1e-12
    missed = origin + np.linspace(0.0, 1.2, 200)[:, None, None] * rays[~hit]
    assert signed_distance(shape, missed)[0].min(initial=1.0) > -1e-9


@settings(max_examples=50, deadline=None)
@given(seed=SEEDS, name=st.sampled_from(sorted(SHAPES)))
def test_distance_outside_is_that_of_the_nearest_point_of_a_box(seed: int, name: str) -> None:
    rng = np.random.default_rng(seed)
    shape = SHAPES[name]
    points = rng.uniform(-0.2, 0.2, (60, 3))
    each = [points - np.clip(points, c - h, c + h) for c, h in zip(shape.center, shape.half, strict=True)]
    away = np.linalg.norm(each, axis=2).min(axis=0)
    d, gradient = signed_distance(shape, points)
    outside = away > 0.0
    assert (d[~outside] <= 0.0).all()
    assert d[outside] == pytest.approx(away[outside], abs=1e-12)
    assert np.linalg.norm(gradient, axis=1) == pytest.approx(1.0, abs=1e-9)
    back = points[outside] - d[outside, None] * gradient[outside]
    assert np.abs(signed_distance(shape, back)[0]).max(initial=0.0) < 1e-9


@pytest.mark.parametrize(("name", "ways"), [("castle", 2), ("stick", 8), ("cube", 8), ("block", 24)])
def test_parts_have_the_symmetries_of_their_shape(name: str, ways: int) -> None:
    same = symmetries(SOLIDS[name])
    assert len(same) == ways
    assert np.array_equal(same[0], np.eye(4))
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.12, 0.12, (300, 3))
    there = signed_distance(SHAPES[name], points)[0]
    for S in same:
        assert signed_distance(SHAPES[name], pose.apply(S, points))[0] == pytest.approx(there, abs=1e-9)
    assert len(distinct(quarter_turns(), same)) == 24 // ways


def test_of_poses_that_look_the_same_the_expected_turn_is_reported() -> None:
    expected = pose.at((0.0, 0.0, 0.0), (3.0, -2.0, 40.0))[:3, :3]
    same = symmetries(SOLIDS["stick"])
    T = pose.at((0.1, 0.2, 0.3), (180.0, 0.0, 0.0)) @ pose.at((0, 0, 0), (0, 0, 143.0))
    T[:3, :3] = expected @ same[5][:3, :3]
    nearest = nearest_symmetric_pose(T, same, expected)
    assert np.allclose(nearest[:3, :3], expected)
    assert np.allclose(nearest[:3, 3], T[:3, 3])


def test_noise_alone_is_no_change() -> None:
    view = RangeFinder().views[0]
    rng = np.random.default_rng(1)
    before = range_of(posed(SHAPES["castle"], STANDING), view)
    for level in (0.0, 1e-3, 4e-3):
        noisy = [before + level * rng.standard_normal(before.shape) for _ in range(2)]
        changed = regions(*noisy, level)
        assert not changed.appeared.any()
        assert not changed.vanished.any()


@pytest.mark.parametrize("moved_twice", [False, True])
def test_of_two_moves_of_a_part_in_a_row_only_the_end_is_known(moved_twice: bool) -> None:
    """The first is not seen, instead of being where the second ended; a hand that pauses alone does no harm."""
    turned = pose.at((0.0, 0.0, 0.0), (0.0, 0.0, 20.0))
    start = {"castle": STANDING, "block": mm(0, -180, 25)}
    halfway = mm(100, 100, 0) @ turned
    goal = mm(-60, 120, 0) @ turned
    last = mm(120, -90, 25)
    operations = [Operation("castle")] * (1 + moved_twice) + [Operation("block")]
    assembly = Assembly({name: SOLIDS[name] for name in start}, tuple(operations), frozenset())
    after = [start, start | {"castle": halfway}, start | {"castle": goal}, {"castle": goal, "block": last}]
    finder = RangeFinder()
    rng = np.random.default_rng(0)
    images = []
    for poses in after:
        scene = join_shapes(posed(SHAPES[name], T) for name, T in poses.items())
        true = np.stack([range_of(scene, view) for view in finder.views])
        images.append(finder.sense(RangeImage(true, np.ones_like(true)), 0.5e-3, rng))
    turns = np.array([T[:3, :3] for T in [halfway] * moved_twice + [goal, last]])
    events = follow_demonstration(images, finder, 0.5e-3, Expected(assembly, start, turns))
    assert [event.operation for event in events] == [int(moved_twice), 1 + moved_twice]
    for event, T in zip(events, (goal, last), strict=True):
        assert event.found is not None
        assert np.linalg.norm(event.found.T[:3, 3] - T[:3, 3]) < 0.5e-3


@pytest.mark.parametrize("yaw", range(0, 180, 15))
def test_a_nudge_goes_unnoticed(yaw: int) -> None:
    T = pose.at((0.1, 0.03, 0.0), (0.0, 0.0, yaw))
    for view in RangeFinder().views:
        before = range_of(posed(SHAPES["castle"], T), view)
        nudged = range_of(posed(SHAPES["castle"], T @ pose.at((0.0, 0.004, 0.0))), view)
        assert (np.abs(nudged - before) > 0.01).any()
        changed = regions(before, nudged, 1e-3)
        assert not changed.appeared.any()
        assert not changed.vanished.any()


def test_a_part_that_is_carried_away_appears_and_vanishes() -> None:
    view = RangeFinder().views[0]
    before = range_of(posed(SHAPES["castle"], STANDING), view)
    after = range_of(posed(SHAPES["castle"], pose.at((0.0, 0.2, 0.0)) @ STANDING), view)
    changed = regions(before, after, 0.0)
    assert ((after < before - 0.02) & ~changed.appeared).sum() < 40
    assert ((after > before + 0.02) & ~changed.vanished).sum() < 40
    assert not (changed.appeared & changed.vanished).any()


def test_small_regions_are_dropped_and_smoothing_keeps_edges() -> None:
    mask = np.zeros((30, 30), dtype=np.bool_)
    mask[2:4, 2:4] = mask[10:20, 10:20] = mask[24:28, 2:28] = True
    assert without_small(mask).sum() == 100
    step = np.repeat([[0.0, 1.0]], 20, axis=0).repeat(10, axis=1)
    assert np.array_equal(median_filtered(step), step)
    noise = np.random.default_rng(2).standard_normal((200, 200))
    assert 0.40 < median_filtered(noise).std() < 0.48


@pytest.mark.parametrize("name", sorted(SHAPES))
def test_exact_points_are_fitted_exactly_from_some_start(name: str) -> None:
    T = pose.at((0.07, -0.04, 0.06), (0.0, 0.0, 33.0))
    points = points_on(SHAPES[name], T)
    same = symmetries(SOLIDS[name])
    begun = starts(SHAPES[name], points.at, same)
    fits = refine(SHAPES[name], points.thinned(600), begun, 0.012, 15)
    fits = refine(SHAPES[name], points.thinned(600), fits.T, 0.0015, 40)
    best = fits.T[fits.cost.argmin()]
    off = [pose.log(pose.inverse(T) @ best @ S) for S in same]
    assert min(np.abs(xi).max() for xi in off) < 1e-6


def test_the_stated_covariance_is_that_of_the_fits() -> None:
    rng = np.random.default_rng(3)
    shape = SHAPES["castle"]
    T = STANDING
    exact = points_on(shape, T).thinned(900)
    noise = 1e-3
    bias = 1e-4
    trials = 120
    xi = np.zeros((trials, 6))
    z = np.zeros(trials)
    for i in range(trials):
        common = bias * rng.standard_normal(2)[exact.view]
        error = noise * rng.standard_normal(len(exact)) + common
        seen = Points(exact.at + error[:, None] * exact.ray, exact.ray, exact.view)
        fitted = refine(shape, seen, T[None], 3e-3, 15).T[0]
        xi[i] = pose.log(pose.inverse(T) @ fitted)
        z[i] = xi[i] @ np.linalg.solve(covariance(shape, seen, fitted, 3e-3, noise, bias), xi[i])
    assert np.abs(xi[:, :3].mean(axis=0)).max() < 1e-4
    assert 0.7 < z.mean() / 6.0 < 1.4


def test_what_no_point_says_is_stated_to_be_unknown() -> None:
    shape = SHAPES["stick"]
    T = STANDING
    points = points_on(shape, T)
    along = (points.at - T[:3, 3]) @ T[:3, 0]
    middle = points.only(np.abs(along) < 0.05)
    C = covariance(shape, middle, T, 3e-3, 1e-3, 1e-4)
    deviation = np.sqrt(np.diag(C))
    assert deviation[0] > 0.9 * PRIOR[0]
    assert deviation[1:3].max() < 1e-3
    whole = np.sqrt(np.diag(covariance(shape, points, T, 3e-3, 1e-3, 1e-4)))
    assert whole[0] < 1e-3
    assert np.linalg.eigvalsh(C)[0] > 0.0


def test_wrong_models_and_wrong_poses_explain_less() -> None:
    finder = RangeFinder()
    scene = posed(SHAPES["castle"], STANDING)
    images = np.array([range_of(scene, view) for view in finder.views])
    masks = [
        np.isfinite(strike_distances(scene, view.origin, view.rays)[0]).reshape(view.height, view.width)
        for view in finder.views
    ]

    def share(name: str, T: Array) -> float:
        return share_explained(SHAPES[name], T, finder.views, images, masks, 1e-3)

    right = share("castle", STANDING)
    assert right > 0.99
    assert share("stick", STANDING) < 0.4
    assert share("cube", STANDING @ pose.at((0, 0, 0.02))) < 0.8
    assert share("castle", STANDING @ pose.at((0.01, 0, 0))) < 0.95
    assert share("castle", STANDING @ pose.at((0, 0, 0), (0, 0, 90.0))) < right - 0.02


def test_levels_scale_one_draw_and_level_zero_is_exact() -> None:
    finder = RangeFinder()
    rng = np.random.default_rng
    distance = rng(0).uniform(0.7, 1.0, (2, 30, 40))
    cosine = rng(1).uniform(0.3, 1.0, (2, 30, 40))
    image = RangeImage(distance, cosine)
    clean, one, two = (finder.sense(image, level, rng(5)) for level in (0.0, 1e-3, 2e-3))
    seen = np.isfinite(clean)
    assert (np.isfinite(one) == seen).all()
    assert np.array_equal(clean[seen], distance[seen])
    assert (two - clean)[seen] == pytest.approx(2.0 * (one - clean)[seen], abs=1e-12)
    assert 0.97 < seen.mean() < 1.0
    grazing = finder.sense(RangeImage(distance, np.full_like(cosine, 0.05)), 0.0, rng(5))
    assert np.isnan(grazing).all()


def test_views_look_where_they_say() -> None:
    view = PinholeView(look_at((1.0, 0.5, 0.8), (0.1, 0.0, 0.0)), 41, 31, 40.0)
    to = np.array([0.1, 0.0, 0.0]) - view.origin
    assert view.rays[15 * 41 + 20] == pytest.approx(to / np.linalg.norm(to))
    assert view.rays[0] @ view.T_world_view[:3, 0] < 0.0
    assert view.rays[0][2] > view.rays[-1][2]
    R = view.T_world_view[:3, :3]
    assert pytest.approx(np.eye(3), abs=1e-12) == R.T @ R
    assert np.linalg.det(R) == pytest.approx(1.0)
