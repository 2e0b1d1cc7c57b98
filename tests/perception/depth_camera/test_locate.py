"""The pure half of the range finder: rays, regions, fits and what they say of themselves."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from apo_bench import Assembly
from apo_bench.assembly import Operation
from apo_bench.geometry import Array, find_symmetries, pose
from apo_bench.perception.depth_camera.icp import Points, compute_fit_covariance, refine_fit
from apo_bench.perception.depth_camera.icp_starts import guess_poses
from apo_bench.perception.depth_camera.operation_detection import SensorPriors, follow_demonstration
from apo_bench.perception.depth_camera.range_finder import VIEWS, PinholeView, RangeImage, simulate_range_image
from apo_bench.perception.depth_camera.surface import join_surfaces, sample_surface
from apo_bench.simulation.sensor.rays import ModelRays
from tests.scenes import block, castle, cube, mm, stick, table

SOLIDS = {"castle": castle(), "cube": cube(), "stick": stick(), "block": block()}
TABLE = table()
MODELS = ModelRays({**SOLIDS, "table": TABLE}, 0.0)
SURFACES = {name: sample_surface(solid.pieces) for name, solid in SOLIDS.items()}
STANDING = pose.at((0.05, 0.02, 0.0), (0.0, 0.0, 25.0))


def range_of(poses: Mapping[str, Array], view: PinholeView) -> Array:
    """True distances of parts, and of a table, (height, width)."""
    distance, _ = MODELS({**poses, "table": np.eye(4)}, view.origin, view.rays)
    return np.minimum(distance, 3.0).reshape(view.height, view.width)


def points_on(name: str, T: Array) -> Points:
    """What the views of the range finder see of a part at T, without any error."""
    each = []
    for v, view in enumerate(VIEWS):
        distance, _ = MODELS({name: T}, view.origin, view.rays)
        hit = np.isfinite(distance)
        at = view.origin + distance[hit, None] * view.rays[hit]
        each.append((at, view.rays[hit], np.full(int(hit.sum()), v)))
    return Points(*map(np.concatenate, zip(*each, strict=True)))


def test_rays_end_where_boxes_begin() -> None:
    """Slabs: a ray is in a box from its last entry to its first exit."""
    rng = np.random.default_rng(0)
    origin = np.array([0.3, -0.4, 0.35])
    rays = rng.uniform(-0.08, 0.08, (2000, 3)) - origin
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    for name, solid in SOLIDS.items():
        best = np.full(len(rays), np.inf)
        for box in solid.pieces:
            a, b = ((box.center + side * box.half - origin) / rays for side in (-1.0, 1.0))
            enter, leave = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
            best = np.where((enter <= leave) & (enter < best), enter, best)
        distance, number = MODELS({"table": mm(0, 0, -900), name: np.eye(4)}, origin, rays)
        hit = np.isfinite(best)
        assert hit.sum() > 100
        assert distance[hit] == pytest.approx(best[hit], abs=1e-9)
        assert (number[hit] == 1).all()
        assert (number[~hit] <= 0).all()


def test_points_of_a_surface_are_on_it_and_their_normals_across_it() -> None:
    surface = SURFACES["stick"]
    half = np.abs(surface.corners).max(axis=0)
    beyond = np.abs(surface.points) - half
    assert beyond.max(axis=1) == pytest.approx(0.0, abs=1e-9)
    out = np.sign(surface.points) * (beyond == beyond.max(axis=1, keepdims=True))
    assert surface.normals == pytest.approx(out, abs=1e-9)
    assert sample_surface(SOLIDS["stick"].pieces) is surface
    assert not surface.looks_like(SURFACES["block"])
    T = pose.at((0.3, 0.1, 0.0), (0.0, 0.0, 90.0))
    both = join_surfaces([(SURFACES["block"], np.eye(4)), (surface, T)])
    number, distance = both.find_nearest(pose.apply(T, surface.points[:50]))
    assert distance == pytest.approx(0.0, abs=1e-9)
    assert (number >= len(SURFACES["block"].points)).all()


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
    rng = np.random.default_rng(0)
    images = []
    for poses in after:
        true = np.stack([range_of(poses, view) for view in VIEWS])
        images.append(simulate_range_image(RangeImage(true, np.ones_like(true)), 0.5e-3, rng))
    turns = np.array([T[:3, :3] for T in [halfway] * moved_twice + [goal, last]])
    events = follow_demonstration(images, 0.5e-3, SensorPriors(assembly, start, turns), MODELS)
    assert [event.operation for event in events] == [int(moved_twice), 1 + moved_twice]
    for event, T in zip(events, (goal, last), strict=True):
        assert event.found is not None
        assert np.linalg.norm(event.found.T[:3, 3] - T[:3, 3]) < 0.5e-3


@pytest.mark.parametrize("name", sorted(SOLIDS))
def test_exact_points_are_fitted_to_a_tenth_of_a_millimetre_from_some_start(name: str) -> None:
    T = pose.at((0.07, -0.04, 0.06), (0.0, 0.0, 33.0))
    points = points_on(name, T)
    same = find_symmetries(SOLIDS[name])
    surface = SURFACES[name]
    begun = guess_poses(surface.corners, points.at, same)
    fits = refine_fit(surface, points.thin_out(600), begun, 0.012, 15)
    fits = refine_fit(surface, points.thin_out(600), fits.T, 0.0015, 40)
    best = fits.T[fits.cost.argmin()]
    off = [np.abs(pose.log(pose.inverse(T) @ best @ S)) for S in same]
    assert min(max(xi[:3].max() / 1e-4, xi[3:].max() / np.radians(0.1)) for xi in off) < 1.0


def test_the_stated_covariance_is_that_of_the_fits() -> None:
    rng = np.random.default_rng(3)
    surface = SURFACES["castle"]
    T = STANDING
    exact = points_on("castle", T).thin_out(900)
    noise = 1e-3
    bias = 1e-4
    trials = 120
    xi = np.zeros((trials, 6))
    z = np.zeros(trials)
    for i in range(trials):
        common = bias * rng.standard_normal(2)[exact.view]
        error = noise * rng.standard_normal(len(exact)) + common
        seen = Points(exact.at + error[:, None] * exact.ray, exact.ray, exact.view)
        fitted = refine_fit(surface, seen, T[None], 3e-3, 15).T[0]
        xi[i] = pose.log(pose.inverse(T) @ fitted)
        z[i] = xi[i] @ np.linalg.solve(compute_fit_covariance(surface, seen, fitted, 3e-3, noise, bias), xi[i])
    assert np.abs(xi[:, :3].mean(axis=0)).max() < 1e-4
    assert 0.7 < z.mean() / 6.0 < 1.4
