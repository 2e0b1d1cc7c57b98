"""Poses of a results file as an observation: folded, assigned, missing, and with the covariance that is stated."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from apo_bench import Demonstration, InputError, Observation, load_scenario
from apo_bench.formats.bop import EstimatedPose, write_results
from apo_bench.geometry import Array, find_symmetries, pose
from apo_bench.perception.observation.models import Camera, NoiseLevel, PoseResults, TrialKey
from apo_bench.perception.observation.models.fitted import FittedNoise
from apo_bench.perception.observation.noise import make_noise
from apo_bench.perception.observation.noise_file import list_noise_files, list_presets, read_noise
from apo_bench.scenario import place_layout
from apo_bench.trial.request import Request, requested_settings
from apo_bench.trial.run import noise_of
from apo_bench.trial.trial_stages import demonstration_of, plan_rotations, scene_of
from tests.image_sets import SMALL, list_truth, make, write_truth

KEY = TrialKey("stick_in_tower", 0, 0.25, None)
RNG = np.random.default_rng(0)
Where = tuple[int, int, int]


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make(tmp_path_factory.mktemp("results") / "set", config=replace(SMALL, cameras=2))


@pytest.fixture(scope="module")
def shown(images: Path) -> tuple[Demonstration, Array]:
    """The demonstration of the images, and the planned rotations."""
    config = requested_settings(Request("stick_in_tower", {"seed": 0, "human_error_scale": 0.0}), 0.25)
    scene = scene_of(config)
    return demonstration_of(config, scene).demonstration, plan_rotations(scene)


def observe(
    path: Path, shown: tuple[Demonstration, Array], level: tuple[float, float] = (1.0, 1.0), fitted: str = ""
) -> Observation:
    results = make_noise(f"poses:{path}" + f"::{fitted}" * bool(fitted), NoiseLevel(*level))
    assert isinstance(results, PoseResults)
    demonstration, turns = shown
    return results.of_trial(KEY, turns)(demonstration.assembly, demonstration, RNG)


def test_true_poses_come_back(images: Path, shown: tuple[Demonstration, Array]) -> None:
    seen = observe(write_truth(images), shown, (2.0, 0.5))
    assert seen.observed.all()
    assert np.allclose(seen.poses, shown[0].poses, atol=1e-9)
    deviations = np.repeat([2e-3, np.radians(0.5)], 3)
    assert np.allclose(seen.covariance, np.diag(deviations**2))  # the human of these images is ideal


def test_poses_that_look_the_same_are_folded(images: Path, shown: tuple[Demonstration, Array]) -> None:
    """Whichever of the symmetric poses is estimated, the one nearest to the plan is observed."""
    solids = shown[0].assembly.solids
    results = make_noise(f"poses:{write_truth(images)}", NoiseLevel(1.0, 1.0))
    assert isinstance(results, PoseResults)
    parts = {number: part for part, number in results.description.scenes["1"].parts.items()}
    for k in range(4):

        def turn(where: Where, T: Array, k: int = k) -> Array:
            offset = results.description.offset(where[2])
            symmetries = find_symmetries(solids[parts[where[2]]])
            return T @ pose.inverse(offset) @ symmetries[k % len(symmetries)] @ offset

        seen = observe(write_truth(images, f"turned{k}.csv", turn), shown)
        assert np.allclose(seen.poses, shown[0].poses, atol=1e-9)


def test_parts_without_an_estimate_were_not_observed(images: Path, shown: tuple[Demonstration, Array]) -> None:
    path = write_truth(images, "missing.csv", lambda where, T: None if where[1] % 1000 == 2 else T)
    seen = observe(path, shown)
    assert seen.observed.tolist() == [True, False, True]
    assert np.array_equal(seen.poses[1], shown[0].start["castle2"])
    assert seen.covariance[1, 0, 0] == pytest.approx(0.25)  # half a metre


def test_the_camera_with_the_better_score_counts(images: Path, shown: tuple[Demonstration, Array]) -> None:
    def rows(second: float) -> list[EstimatedPose]:
        """Estimates of the second camera are 10 mm too far."""
        far = pose.at((0.0, 0.0, 0.01))
        return [
            EstimatedPose(where, second if where[1] > 1000 else 0.5, far @ T if where[1] > 1000 else T, -1.0)
            for where, T in list_truth(images)
        ]

    for second, error_m in ((0.4, 0.0), (0.6, 0.01)):
        write_results(images / "two.csv", rows(second))
        seen = observe(images / "two.csv", shown)
        far = np.linalg.norm(seen.poses[:, :3, 3] - shown[0].poses[:, :3, 3], axis=1)
        assert far == pytest.approx(error_m, abs=1e-9)


def test_a_fitted_noise_is_stated_about_the_origin_of_the_model(
    images: Path, shown: tuple[Demonstration, Array]
) -> None:
    """Its covariance is that which the noise model draws with, carried from the model to the part."""
    preset = "megapose-tless"
    path = write_truth(images, "first.csv", lambda where, T: T if where[1] < 1000 else None)
    seen = observe(path, shown, fitted=preset)
    results = make_noise(f"poses:{path}::{preset}", NoiseLevel(1.0, 1.0))
    assert isinstance(results, PoseResults)
    measured, _ = read_noise(list_presets()[preset])
    trial = results.of_trial(KEY, shown[1])
    camera = Camera(trial.cameras[1].T_world_camera)
    ray = FittedNoise(measured, NoiseLevel(1.0, 1.0)).covariance
    for k, operation in enumerate(shown[0].assembly.operations):
        offset = results.description.offset(trial.scene.parts[operation.main])
        stated = camera.covariance((seen.poses[k] @ offset)[None], ray)[0]
        Ad = pose.adjoint(offset)
        assert np.allclose(seen.covariance[k], Ad @ stated @ Ad.T, rtol=1e-6, atol=1e-12)
    assert seen.outliers is not None


def test_parts_that_are_alike_are_told_apart_by_their_places(tmp_path: Path) -> None:
    """Three equal discs: their estimates, in any order and with errors, become observations of the right ones."""
    name, operations = "gearbox", ("disc1", "disc2", "disc3")
    scenario = load_scenario(name)
    layout = place_layout(scenario, *scenario.site.center_m, 0.0, clearance_mm=scenario.clearance_mm)
    assembly = scenario.assembly
    discs = [operation.main for operation in assembly.operations if operation.main in operations]
    assert sorted(discs) == sorted(operations)
    chosen = follow(tmp_path, name, layout.start, layout.poses)
    right = chosen["truth"]
    for k, operation in enumerate(assembly.operations):
        if operation.main in operations:
            assert np.linalg.norm(chosen["seen"].poses[k, :3, 3] - right[k, :3, 3]) < 5e-3, operation.main
    assert chosen["seen"].observed.all()


def follow(folder: Path, name: str, start: Mapping[str, Array], poses: Array, twice: str = "") -> dict[str, Any]:
    """Observe shuffled estimates with errors of 2 mm, without images: from a description and cameras alone.

    Args:
        twice: A part that has another estimate of the best score, while `disc3` has none.
    """
    import msgspec

    from apo_bench import TrialConfig
    from apo_bench.benchmark.datasets.images.make import describe_images, list_objects
    from apo_bench.benchmark.datasets.images.views import draw_views, number_images
    from apo_bench.formats.bop_images import PublishedCamera
    from apo_bench.perception.observation.models.pose_results import TrialResults, read_pose_results

    scenario = load_scenario(name)
    trial = TrialConfig(name, clearance_mm=scenario.clearance_mm, human_error_scale=0.0)
    description = describe_images([trial], {name: scenario}, list_objects([trial], {name: scenario}), SMALL, "test")
    (folder / "apo_trials.json").write_bytes(msgspec.json.encode(description))
    view = draw_views(SMALL, np.random.default_rng(0))[0].published
    T_view = pose.inverse(view.T_world_view)
    camera = PublishedCamera(tuple(view.K.ravel()), tuple(T_view[:3, :3].ravel()), tuple(1e3 * T_view[:3, 3]))
    rng = np.random.default_rng(4)
    now, rows = dict(start), []
    for image, operation, _ in number_images(len(scenario.assembly), 1):
        done = scenario.assembly.operations[operation - 1]
        step = poses[operation - 1] @ pose.inverse(now[done.main])
        now |= {part: step @ now[part] for part in done.moves}
        for part in rng.permutation([each for each in description.scenes["1"].parts if not twice or each != "disc3"]):
            number = description.scenes["1"].parts[part]
            T = now[part].copy()
            T[:3, 3] += 2e-3 * rng.uniform(-1.0, 1.0, 3)
            T_camera = pose.inverse(camera.T_world_camera) @ T @ description.offset(number)
            rows.append(EstimatedPose((1, image, number), float(rng.random()), T_camera, -1.0))
            if part == twice:
                rows.append(EstimatedPose((1, image, number), 2.0, pose.at((0.0, 0.0, 0.001)) @ T_camera, -1.0))
    write_results(folder / "results.csv", rows)
    results = read_pose_results(folder / "results.csv", NoiseLevel(1.0, 1.0))
    n = len(scenario.assembly)
    cameras = {image: camera for image, _, _ in number_images(n, 1)}
    scene = description.scenes["1"]
    noise = TrialResults(results, 1, scene, cameras, scenario.nominal_poses[:, :3, :3])
    demonstration = Demonstration(scenario.assembly, start, poses, now, np.zeros((n, 6, 6)))
    return {"seen": noise(scenario.assembly, demonstration, rng), "truth": poses}


def test_a_second_estimate_of_a_part_that_stays_is_not_taken_for_the_moved_one(tmp_path: Path) -> None:
    """Each disc that lies already has two estimates, of better scores than that of the disc that was moved."""
    name = "gearbox"
    scenario = load_scenario(name)
    layout = place_layout(scenario, *scenario.site.center_m, 0.0, clearance_mm=scenario.clearance_mm)
    chosen = follow(tmp_path, name, layout.start, layout.poses, twice="disc1")
    k = [operation.main for operation in scenario.assembly.operations].index("disc2")
    assert np.linalg.norm(chosen["seen"].poses[k, :3, 3] - layout.poses[k, :3, 3]) < 5e-3


def test_trials_without_images_are_refused(images: Path, shown: tuple[Demonstration, Array]) -> None:
    path = write_truth(images)
    config = requested_settings(
        Request("stick_in_tower", {"seed": 5, "human_error_scale": 0.0, "noise": f"poses:{path}"}), 0.25
    )
    scene = scene_of(config)
    with pytest.raises(InputError, match="no scene is of stick_in_tower, seed 5"):
        noise_of(config, scene, demonstration_of(config, scene))
    human = dataclasses.replace(config, seed=0, human_error_scale=1.0)
    with pytest.raises(InputError, match="human error scale 1 was given, and the images in"):
        noise_of(human, scene, demonstration_of(human, scene))


def test_files_that_do_not_belong_together_are_refused(images: Path, tmp_path: Path) -> None:
    level = NoiseLevel(1.0, 1.0)
    with pytest.raises(InputError, match="there is no results file"):
        make_noise(f"poses:{tmp_path / 'none.csv'}", level)
    lone = tmp_path / "lone.csv"
    lone.write_text(write_truth(images).read_text(encoding="utf-8"), encoding="utf-8")
    with pytest.raises(InputError, match="lies in no data set of images"):
        make_noise(f"poses:{lone}", level)
    write_results(images / "other.csv", [EstimatedPose((7, 1, 1), 1.0, pose.at((0.0, 0.0, 1.0)), -1.0)])
    with pytest.raises(InputError, match="have no scene 7 with image 1"):
        make_noise(f"poses:{images / 'other.csv'}", level)


def test_the_files_of_a_name_are_hashed() -> None:
    assert list_noise_files("poses:a/b.csv") == (Path("a/b.csv"),)
    assert list_noise_files("poses:a/b.csv::c.toml") == (Path("a/b.csv"), Path("c.toml"))
    assert list_noise_files("poses:b.csv::megapose-lmo") == (Path("b.csv"), list_presets()["megapose-lmo"])
    assert list_noise_files("isotropic") == ()
