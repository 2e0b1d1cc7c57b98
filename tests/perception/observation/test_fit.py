"""Noise fitted to residuals: known parameters come back, figures of published estimates, files, and the command."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from scipy.stats import kstest

from apo_bench.formats.bop import read_results
from apo_bench.formats.bop_truth import read_truth
from apo_bench.perception.observation.fitting.fit import fit_noise, fit_split, goodness_of_fit
from apo_bench.perception.observation.fitting.quantiles import LOWER_QUARTILE_OF_THREE, round_split, split_of_quantiles
from apo_bench.perception.observation.models.empirical import residuals_text
from apo_bench.perception.observation.models.fitted import MeasuredNoise
from apo_bench.perception.observation.models.residuals import Residuals, match_residuals
from apo_bench.perception.observation.models.tails import Split, Tail
from apo_bench.perception.observation.noise_file import presets, read_noise
from apo_bench.viz.fit_text import fit_form
from tests import bop_made as made_of
from tests.bop_made import Known

SPLITS = (
    Split(Tail(2.0, 4.0), Tail(8.0, 3.0), 50.0),
    Split(Tail(0.5, 2.0), Tail(13.0, 0.9), 50.0),
    Split(Tail(3.0), Tail(40.0), 30.0),
)


def compared_files(estimates: Path, truth: Path) -> Residuals:
    seen = read_results(estimates)
    return match_residuals(seen, read_truth(truth, seen))


@pytest.fixture(scope="module")
def known_file(tmp_path_factory: pytest.TempPathFactory) -> Residuals:
    """40,000 parts with known errors, through the files."""
    estimates = made_of.draw(40_000, Known(), np.random.default_rng(3))
    return compared_files(*made_of.files(tmp_path_factory.mktemp("known"), estimates))


def test_known_parameters_are_recovered_within_five_percent(known_file: Residuals) -> None:
    known = Known()
    measured = fit_noise(known_file, "made")
    for split, tails in ((measured.shift_mm, known.shift), (measured.turn_deg, known.turn)):
        assert_allclose([*split.across, *split.along], tails, rtol=0.05)
    assert_allclose([measured.missed, measured.outliers], [known.missed, known.outliers], rtol=0.05)
    assert_allclose(measured.farthest_mm, known.farthest, rtol=0.1)


def test_a_right_fit_is_close_everywhere(known_file: Residuals) -> None:
    """The largest difference is what chance makes of so many (1.95 / sqrt(n): one in a thousand)."""
    for figures in goodness_of_fit(known_file, fit_noise(known_file, "made")):
        assert figures.distance < 1.95 / np.sqrt(known_file.upright.sum())
        assert_allclose(figures.fitted, figures.observed, rtol=0.05)


def test_a_wrong_fit_is_told(known_file: Residuals) -> None:
    wrong = MeasuredNoise(
        "wrong", Split(Tail(4.0, 4.0), Tail(8.0, 3.0), 50.0), fit_noise(known_file, "").turn_deg, 0.1, 0.1, 800
    )
    across, *others = goodness_of_fit(known_file, wrong)
    assert across.distance > 0.2 > 10.0 * across.by_chance
    assert max(one.distance for one in others) < 0.03


def test_the_limit_is_no_sign_of_short_tails() -> None:
    """Errors that are mostly beyond the limit: the scale is that of the whole, not of what is left."""
    split = Split(Tail(4.0), Tail(30.0), 50.0)
    fitted = fit_split(split.draw(40_000, np.random.default_rng(5)), 50.0)
    assert_allclose([fitted.across.scale, fitted.along.scale], [4.0, 30.0], rtol=0.05)


@pytest.mark.parametrize("split", SPLITS)
def test_the_distribution_is_what_is_drawn(split: Split) -> None:
    drawn = split.draw(20_000, np.random.default_rng(0))
    length = np.linalg.norm(drawn, axis=1)
    assert length.max() < split.limit
    for sizes, cdf in (
        (np.linalg.norm(drawn[:, :2], axis=1), split.cdf_across),
        (np.abs(drawn[:, 2]), split.cdf_along),
        (length, split.cdf_length),
    ):
        grid = np.linspace(0.0, split.limit, 4001)
        assert kstest(sizes, lambda x, cdf=cdf, grid=grid: np.interp(x, grid, cdf(grid))).pvalue > 1e-3
        assert cdf(split.limit) == pytest.approx(1.0, abs=1e-6)
    across, along = split.variances
    for squares, variance in ((drawn[:, :2] ** 2, across), (drawn[:, 2] ** 2, along)):
        assert abs(squares.mean() - variance) < 5.0 * squares.std() / np.sqrt(len(drawn))


def test_parts_that_look_alike_when_turned_do_not_count(tmp_path: Path) -> None:
    """Object 2 looks alike turned by half about an axis 20 mm beside its origin, object 3 by any angle: both are taken
    so in estimates, all of them right. The fit is that of the others, but for chance."""
    rng = np.random.default_rng(6)
    drawn = made_of.draw(8000, Known(missed=0.0, outliers=0.0), rng)
    plain = fit_noise(compared_files(*made_of.files(tmp_path, drawn)), "")
    part = drawn.where[:, 2]
    n = len(drawn.where)
    angle = np.where(part == 2, 180.0 * (rng.random(n) < 0.5), np.where(part == 3, rng.uniform(-180.0, 180.0, n), 0.0))
    turned = Rotation.from_euler("z", angle[:, None], degrees=True).as_matrix()
    axis = np.where(part == 2, 20.0, 0.0)[:, None] * [1.0, 0.0, 0.0]
    beside = axis - np.einsum("nij,nj->ni", turned, axis)
    t = drawn.t_seen + np.einsum("nij,nj->ni", drawn.R_seen, beside)
    residuals = compared_files(*made_of.files(tmp_path, drawn._replace(R_seen=drawn.R_seen @ turned, t_seen=t)))
    assert residuals.round_objects == (3,)
    assert np.median(residuals.across_mm[(part == 2) & ~residuals.upright]) > 10.0
    kinds = np.array([line.split(",")[3] for line in residuals_text(residuals).splitlines()[1:]])
    assert set(kinds[part[:: -(-n // len(kinds))] == 3]) == {"turned"}
    measured = fit_noise(residuals, "")
    for mine, known in ((measured.shift_mm, plain.shift_mm), (measured.turn_deg, plain.turn_deg)):
        assert_allclose([*mine.across, *mine.along], [*known.across, *known.along], rtol=0.1)
    assert all(figures.distance < 1.2 * figures.by_chance for figures in goodness_of_fit(residuals, measured))
    assert fit_form(residuals, measured, goodness_of_fit(residuals, measured))["round_objects"] == [3]


@pytest.mark.parametrize("turns", ["quarters", "end over end"])
def test_parts_that_look_alike_about_an_axis_far_from_the_origin_are_no_outliers(turns: str, tmp_path: Path) -> None:
    """All estimates of object 2 are right; those of the others have their outliers."""
    rng = np.random.default_rng(8)
    drawn = made_of.draw(2000, Known(missed=0.0), rng)
    part, n = drawn.where[:, 2], len(drawn.where)
    gross = np.linalg.norm(drawn.shift, axis=1) >= 50.0
    kept = (part != 2) | ~gross
    angles = {
        "quarters": rng.choice([0, 90, 180, 270], n),
    }
    axes = rng.choice(list("xyz"), n) if turns == "end over end" else np.full(n, "z")
    turn = np.array(
        [
            Rotation.from_euler(axis, angle if of == 2 else 0.0, degrees=True).as_matrix()
            for axis, angle, of in zip(axes, angles.get(turns, rng.choice([0, 180], n)), part, strict=True)
        ]
    )
    centre = np.array([70.0, -20.0, 10.0])
    t = drawn.t_seen + np.einsum("nij,nj->ni", drawn.R_seen, centre - turn @ centre)
    seen = made_of.results(tmp_path / "e.csv", drawn.where[kept], (drawn.R_seen @ turn)[kept], t[kept])
    truth = made_of.results(tmp_path / "truth.csv", drawn.where, drawn.R, drawn.t)
    residuals = compared_files(seen, truth)
    assert (residuals.off_mm[residuals.found & (part == 2)] < 60.0).all()
    assert np.mean(residuals.inlier[residuals.found & (part == 2)]) > 0.98
    assert residuals.beside > 100
    others = residuals.found & (part != 2)
    assert (residuals.inlier[others] == ~gross[others]).all()


@pytest.fixture(scope="module")
def lmo(request: pytest.FixtureRequest) -> Residuals:
    return published(request, "lmo")


def published(request: pytest.FixtureRequest, name: str) -> Residuals:
    folder = request.config.getoption("--bop-dir")
    if folder is None:
        pytest.skip("needs --bop-dir, the folder results_sub of the test data of the BOP toolkit")
    (estimates,) = folder.glob(f"cnos-fastsammegapose_{name}-test*.csv")
    (truth,) = folder.glob(f"gt-*_{name}-test_{name}.csv")
    return compared_files(estimates, truth)


def test_published_estimates_have_the_figures_that_are_known(lmo: Residuals) -> None:
    """Median and more of MegaPose on LM-O. Angles by the trace of matrices as written are what was published of it;
    the truth is scaled by up to half a percent, so nearest rotations are farther apart in the lower quartile."""
    measured = fit_noise(lmo, "LM-O")
    form = fit_form(lmo, measured, goodness_of_fit(lmo, measured))
    assert (form["found"], form["parts"]) == (1205, 1445)
    assert form["inliers"] / form["found"] == pytest.approx(0.82, rel=0.01)
    assert_allclose(form["inlier_across_mm"][1:4], [4.2, 6.5, 9.4], rtol=0.1)
    assert_allclose(form["inlier_along_mm"][1:4], [10.4, 20.9, 31.5], rtol=0.1)
    assert form["along_over_across"] == pytest.approx(2.4, rel=0.1)
    assert_allclose(form["inlier_turn_by_trace_deg"][:2], [2.6, 5.2], rtol=0.1)
    assert form["inlier_turn_deg"][1] == pytest.approx(5.2, rel=0.1)
    for figures in form["fit"].values():
        assert_allclose(figures["fitted"][1:], figures["observed"][1:], rtol=0.1)
        assert figures["kolmogorov_smirnov"] < figures["kolmogorov_smirnov_by_chance"]


@pytest.mark.parametrize("name", ["lmo", "tless"])
def test_the_preset_is_the_fit(name: str, request: pytest.FixtureRequest) -> None:
    shipped = read_noise(presets()[f"megapose-{name}"])[0]
    measured = fit_noise(published(request, name), "")
    for mine, fitted in ((shipped.shift_mm, measured.shift_mm), (shipped.turn_deg, measured.turn_deg)):
        assert_allclose(
            [*mine.across, *mine.along, mine.limit], [*fitted.across, *fitted.along, fitted.limit], rtol=1e-3
        )
    assert_allclose(
        [shipped.missed, shipped.outliers, shipped.farthest_mm],
        [measured.missed, measured.outliers, measured.farthest_mm],
        rtol=1e-3,
    )


def test_a_fit_to_quantiles_meets_them() -> None:
    """Of MegaPose on T-LESS, whatever it is turned by; a Student t meets p50, p75 and p90 within 10 %."""
    across = {50: 0.8, 75: 1.2, 90: 2.3}
    along = {50: 5.3, 75: 9.5, 90: 16.5}
    drawn = split_of_quantiles(across, along, 50.0).draw(200_000, np.random.default_rng(0))
    for sizes, given in ((np.linalg.norm(drawn[:, :2], axis=1), across), (np.abs(drawn[:, 2]), along)):
        assert_allclose(np.percentile(sizes, [*given]), [*given.values()], rtol=0.1)
    turns = np.linalg.norm(round_split(2.0, 30.0).draw(200_000, np.random.default_rng(1)), axis=1)
    assert np.percentile(turns, 25) == pytest.approx(2.0, rel=0.01)
    assert np.percentile(np.linalg.norm(np.random.default_rng(2).standard_normal((400_000, 3)), axis=1), 25) == (
        pytest.approx(LOWER_QUARTILE_OF_THREE, rel=0.01)
    )
