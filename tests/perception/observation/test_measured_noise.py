"""Noise out of files, fitted or drawn from residuals, obeys the laws of all noise models; bad files are refused."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from apo_bench import InputError, Observation, TrialConfig, observe
from apo_bench.formats.bop import read_results
from apo_bench.formats.bop_truth import read_truth
from apo_bench.geometry import Array, pose
from apo_bench.perception.observation.models.camera import Camera
from apo_bench.perception.observation.models.displacement import COVARIANCE_FLOOR
from apo_bench.perception.observation.models.empirical import EmpiricalNoise, format_residuals
from apo_bench.perception.observation.models.fitted import FittedNoise
from apo_bench.perception.observation.models.outliers import UNOBSERVED_DEVIATION
from apo_bench.perception.observation.models.residuals import Residuals, match_residuals
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.perception.observation.noise_file import format_noise_file, list_presets, read_noise
from apo_bench.trial.fingerprint import compute_config_hash
from apo_bench.trial.input_files import hash_noise_files
from tests import bop_made as made_of
from tests import scenes
from tests.bop_made import Known

TOWER = scenes.turned(scenes.stick_in_tower(), pose.at((0.1, -0.02, 0.0), (20.0, 35.0, 23.0)))
NOISE_LEVEL = NoiseLevel(0.8, 0.6)
DRAWS = 1200
WHOLE = Known()
INLIERS = Known(missed=0.0, outliers=0.0)


def residuals_of(folder: Path, known: Known, n: int = 400) -> Residuals:
    estimates, truth = made_of.files(folder, made_of.draw(n, known, np.random.default_rng(4)))
    seen = read_results(estimates)
    return match_residuals(seen, read_truth(truth, seen))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files of residuals: `whole.csv`, and `inliers.csv` of an estimator with a bias, without outliers and misses."""
    path = tmp_path_factory.mktemp("residuals")
    for name, known in (("whole", WHOLE), ("inliers", INLIERS)):
        residuals = residuals_of(path, known)
        if known is INLIERS:
            residuals = replace(residuals, shift_mm=0.85 * residuals.shift_mm + [0.0, 2.0, 5.0])
        (path / f"{name}.csv").write_text(format_residuals(residuals), encoding="utf-8")
    return path


@pytest.fixture(params=["megapose-lmo", "empirical"])
def names(request: pytest.FixtureRequest, folder: Path) -> tuple[str, str]:
    """A noise model, and the same without outliers and misses."""
    if request.param == "empirical":
        return f"empirical:{folder / 'whole.csv'}", f"empirical:{folder / 'inliers.csv'}"
    return request.param, f"{request.param}-inliers"


def see(name: str, seed: int, noise_level: NoiseLevel = NOISE_LEVEL) -> Observation:
    return observe(scenes.shown(TOWER), make_noise(name, noise_level), np.random.default_rng(seed))


def whitened(name: str, draws: int = DRAWS) -> tuple[Array, Array]:
    """Body twists in units of what was stated, (draws, n, 6), and which were seen, (draws, n)."""
    noise = make_noise(name, NOISE_LEVEL)
    demonstration = scenes.shown(TOWER)
    seen = [observe(demonstration, noise, np.random.default_rng(seed)) for seed in range(draws)]
    xi = pose.log(pose.inverse(TOWER.nominal_poses) @ np.array([observation.poses for observation in seen]))
    L = np.linalg.cholesky(np.array([observation.covariance for observation in seen]))
    return np.linalg.solve(L, xi[..., None])[..., 0], np.array([observation.observed for observation in seen])


def test_outliers_and_misses_come_as_often_as_measured_and_are_not_stated(names: tuple[str, str]) -> None:
    unit, there = whitened(names[0], 800)
    noise = make_noise(names[0], NOISE_LEVEL)
    if isinstance(noise, FittedNoise):
        missed = noise.measured.missed
        outliers = noise.measured.outliers
    else:
        assert isinstance(noise, EmpiricalNoise)
        missed = noise.sample.missed
        outliers = noise.sample.gross
        assert_allclose([missed, outliers], [WHOLE.missed, WHOLE.outliers], rtol=0.35)
    assert abs(1.0 - there.mean() - missed) < 4.0 * np.sqrt(missed / there.size)
    gross = (unit[there] ** 2).sum(axis=1) > chi2(6).ppf(1.0 - 1e-6)
    assert outliers - 0.06 < gross.mean() < outliers + 0.08
    clean = see(names[1], 0)
    dirty = see(names[0], 0)
    assert np.trace(dirty.covariance[dirty.observed][0]) < 2.0 * np.trace(clean.covariance[0])
    assert dirty.outliers is not None
    assert dirty.outliers.gross == pytest.approx(outliers)


def test_a_level_multiplies_what_was_measured(names: tuple[str, str]) -> None:
    """The same operations are outliers and missed at every level but 0, at which all is seen as shown."""
    for seed in range(20):
        seen = []
        after = set()
        for noise_level in (NoiseLevel(0.2, 0.1), NoiseLevel(0.8, 0.2)):
            rng = np.random.default_rng(seed)
            seen.append(observe(scenes.shown(TOWER), make_noise(names[0], noise_level), rng))
            after.add(rng.random())
        assert len(after) == 1
        assert_array_equal(seen[0].observed, seen[1].observed)
        weak, strong = (
            pose.log(pose.inverse(TOWER.nominal_poses) @ observation.poses)[observation.observed]
            for observation in seen
        )
        lengths = [np.linalg.norm(xi[:, :3], axis=1) for xi in (weak, strong)]
        assert_allclose(lengths[1], 4.0 * lengths[0], rtol=1e-6)
        assert_allclose(strong[:, 3:], 2.0 * weak[:, 3:], rtol=1e-6, atol=1e-12)
        none = see(names[0], seed, NoiseLevel(0.0, 0.0))
        assert none.poses.tobytes() == TOWER.nominal_poses.tobytes()
        assert none.observed.all()
        assert_allclose(none.covariance, np.tile(np.diag(COVARIANCE_FLOOR**2), (3, 1, 1)), rtol=1e-9, atol=1e-20)


def test_nothing_of_the_truth_is_in_what_was_missed(names: tuple[str, str]) -> None:
    """Its pose is the one at which the part started or was seen last, and what is stated says that it is not known."""
    noise = make_noise(names[0], NOISE_LEVEL)
    demonstration = scenes.shown(TOWER)
    missed = 0
    for seed in range(60):
        seen = observe(demonstration, noise, np.random.default_rng(seed))
        for k in np.flatnonzero(~seen.observed):
            missed += 1
            start = TOWER.start[TOWER.assembly.operations[k].main]
            assert_array_equal(seen.poses[k], start)
            assert_allclose(np.sqrt(np.diagonal(seen.covariance[k])), UNOBSERVED_DEVIATION)
    assert missed > 5


def test_empirical_noise_gives_the_measured_poses_back(folder: Path) -> None:
    """At level 1 every error is a row of the file, shift and turn, or of opposite sign, as far off and turned back."""
    rows = np.genfromtxt(folder / "whole.csv", delimiter=",", skip_header=1, usecols=range(4, 10))
    rows = rows[np.isfinite(rows[:, 0])]
    camera = Camera()
    found = []
    for seed in range(60):
        seen = see(f"empirical:{folder / 'whole.csv'}", seed, NoiseLevel(1.0, 1.0))
        F = camera.frames(TOWER.nominal_poses)
        shift = np.einsum("nji,nj->ni", F, seen.poses[:, :3, 3] - TOWER.nominal_poses[:, :3, 3]) * 1e3
        R = seen.poses[:, :3, :3] @ np.swapaxes(TOWER.nominal_poses[:, :3, :3], 1, 2)
        turn = np.einsum("nji,nj->ni", F, Rotation.from_matrix(R).as_rotvec(degrees=True))
        for d, w in zip(shift[seen.observed], turn[seen.observed], strict=True):
            straight = np.abs(rows - [*d, *w]).max(axis=1).min() < 1e-6
            opposite = np.abs(rows[:, 3:] + w).max(axis=1)
            k = int(np.argmin(opposite))
            back = opposite[k] < 1e-6 and abs(np.linalg.norm(rows[k, :3]) - np.linalg.norm(d)) < 1e-6
            assert straight != back
            found.append(straight)
    assert 0.3 < np.mean(found) < 0.7


def test_a_file_that_changes_is_read_again_and_changes_the_hash(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    name = f"empirical:{path}"
    seen = []
    for i, source in enumerate(("whole", "inliers")):
        path.write_bytes((folder / f"{source}.csv").read_bytes())
        os.utime(path, ns=(i, i))
        hashed = compute_config_hash(TrialConfig("stick_in_tower", noise=name), "content")
        seen.append((see(name, 0).poses.tobytes(), hashed, hash_noise_files(name)[f"noise {name}"]))
    assert all(first != second for first, second in zip(*seen, strict=True))
    assert hash_noise_files("isotropic", "anisotropic", "package.module:name") == {}


def test_presets_are_models_by_name_and_fit_files_by_path(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    measured, camera = read_noise(list_presets()["megapose-lmo"])
    path.write_text(
        format_noise_file(measured, ("a note",)) + "[camera]\nat_mm = [0, 0, 1500]\nturn_deg = [180, 0, 0]\n"
    )
    noise = make_noise(str(path), NOISE_LEVEL)
    assert isinstance(noise, FittedNoise)
    assert noise.measured == measured
    assert_allclose(noise.camera.T_world_camera, pose.at((0, 0, 1.5), (180, 0, 0)))
    assert_allclose(camera.T_world_camera, Camera().T_world_camera)


GOOD = format_noise_file(read_noise(list_presets()["megapose-lmo"])[0])


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("missed_rate = 0.16609", "missed_rate = 1.5", "missed_rate: a number <= 1.0 is needed, 1.5 was given"),
        ("across_scale_mm = 3.2785", "across_scale_mm = 99", "shift: scales from .* to the limit are needed, not 99"),
    ],
)
def test_bad_noise_files_are_refused(before: str, after: str, message: str, tmp_path: Path) -> None:
    assert before in GOOD
    path = tmp_path / "noise.toml"
    path.write_text(GOOD.replace(before, after, 1), encoding="utf-8")
    with pytest.raises(InputError, match=message) as raised:
        make_noise(str(path), NOISE_LEVEL)
    assert str(path) in str(raised.value)
