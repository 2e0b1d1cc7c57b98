"""Noise fitted to residuals: known parameters come back, figures of published estimates, files, and the command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from scipy.stats import kstest

from apo_bench import load_scenario
from apo_bench.cli.app import main
from apo_bench.formats.bop import read_results
from apo_bench.formats.bop_models import find_models_info, read_symmetries
from apo_bench.formats.bop_truth import read_truth
from apo_bench.importers.recording.object_symmetries import find_object_symmetries
from apo_bench.importers.recording.objects_file import read_objects
from apo_bench.perception.observation.fitting.fit import compute_goodness_of_fit, fit_noise
from apo_bench.perception.observation.models.empirical import format_residuals
from apo_bench.perception.observation.models.residuals import Residuals, match_residuals
from apo_bench.perception.observation.models.truncated_tails import StudentT, TruncatedTails
from apo_bench.viz.fit_text import make_fit_form
from tests import bop_made as made_of
from tests.bop_made import Known

SPLITS = (
    TruncatedTails(StudentT(2.0, 4.0), StudentT(8.0, 3.0), 50.0),
    TruncatedTails(StudentT(0.5, 2.0), StudentT(13.0, 0.9), 50.0),
    TruncatedTails(StudentT(3.0), StudentT(40.0), 30.0),
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
    for figures in compute_goodness_of_fit(known_file, fit_noise(known_file, "made")):
        assert figures.distance < 1.95 / np.sqrt(known_file.is_upright.sum())
        assert_allclose(figures.fitted, figures.observed, rtol=0.05)


@pytest.mark.parametrize("split", SPLITS)
def test_the_distribution_is_what_is_drawn(split: TruncatedTails) -> None:
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
    assert np.median(residuals.across_mm[(part == 2) & ~residuals.is_upright]) > 10.0
    kinds = np.array([line.split(",")[3] for line in format_residuals(residuals).splitlines()[1:]])
    assert set(kinds[part[:: -(-n // len(kinds))] == 3]) == {"turned"}
    measured = fit_noise(residuals, "")
    for mine, known in ((measured.shift_mm, plain.shift_mm), (measured.turn_deg, plain.turn_deg)):
        assert_allclose([*mine.across, *mine.along], [*known.across, *known.along], rtol=0.1)
    assert all(figures.distance < 1.2 * figures.by_chance for figures in compute_goodness_of_fit(residuals, measured))
    assert make_fit_form(residuals, measured, compute_goodness_of_fit(residuals, measured))["round_objects"] == [3]


def test_estimates_are_folded_by_the_symmetries_of_the_models(tmp_path: Path) -> None:
    """Each estimate is turned by a symmetry about an axis off the origin: all are as good as the upright ones."""
    rng = np.random.default_rng(4)
    drawn = made_of.draw(300, Known(missed=0.0, outliers=0.0), rng, objects=1)
    plain = compared_files(*made_of.files(tmp_path, drawn))
    half = np.diag([-1.0, -1.0, 1.0, 1.0])
    half[0, 3] = 60.0  # the axis is 30 mm beside the origin
    info = {"1": {"symmetries_discrete": [half.ravel().tolist()]}}
    (tmp_path / "models_info.json").write_text(json.dumps(info), encoding="utf-8")
    turned = drawn._replace(R_seen=drawn.R_seen @ half[:3, :3], t_seen=drawn.t_seen + drawn.R_seen @ half[:3, 3])
    estimates, truth = made_of.files(tmp_path, turned)
    found = find_models_info(truth)
    assert found is not None
    seen = read_results(estimates)
    folded = match_residuals(seen, read_truth(truth, seen), read_symmetries(found))
    assert_allclose(folded.shift_mm, plain.shift_mm, atol=1e-4)
    assert_allclose(folded.turn_deg, plain.turn_deg, atol=1e-4)


def test_estimates_are_folded_by_the_symmetries_of_parts_of_a_scenario(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Half of the estimates of a stick are turned by half about an axis 60 mm from the origin of the model."""
    drawn = made_of.draw(200, Known(missed=0.0, outliers=0.0), np.random.default_rng(4), objects=1)
    plain = compared_files(*made_of.files(tmp_path, drawn))
    (tmp_path / "o.toml").write_text(
        'schema = "apo-bench/objects/1"\n[objects]\nstick = { id = 1, frame = { at_mm = [0, 60, 0] } }\n'
    )
    symmetries = find_object_symmetries(
        read_objects(tmp_path / "o.toml"), load_scenario("stick_in_tower").assembly.solids
    )
    half = max(symmetries[1].images, key=lambda g: float(np.linalg.norm(g[:3, 3])))
    assert np.linalg.norm(half[:3, 3]) == pytest.approx(120.0)
    often = (np.arange(200) % 2 == 0)[:, None, None]
    turned = drawn._replace(
        R_seen=np.where(often, drawn.R_seen @ half[:3, :3], drawn.R_seen),
        t_seen=np.where(often[:, 0], drawn.t_seen + drawn.R_seen @ half[:3, 3], drawn.t_seen),
    )
    estimates, truth = made_of.files(tmp_path, turned)
    seen = read_results(estimates)
    folded = match_residuals(seen, read_truth(truth, seen), symmetries)
    assert_allclose(folded.shift_mm, plain.shift_mm, atol=1e-4)
    assert folded.turned_in_place == 0
    files = ("--estimates", str(estimates), "--truth", str(truth), "--objects", str(tmp_path / "o.toml"))
    assert main(["noise", "fit", *files, "--scenario", "stick_in_tower", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["outlier_rate"] == 0.0
    assert main(["noise", "fit", *files]) == 2
    assert "--scenario and --objects go together" in capsys.readouterr().err


def test_a_folder_of_scenes_is_read_and_estimates_of_other_scenes_do_not_count(tmp_path: Path) -> None:
    """Truth of scenes 1 and 2 in `val`, estimates of scenes 1 to 3: none is left over."""
    drawn = made_of.draw(300, Known(missed=0.0, outliers=0.0), np.random.default_rng(5))
    drawn.where[:, 0] = 1 + np.arange(300) // 100
    for scene in (1, 2):
        own = drawn.where[:, 0] == scene
        (tmp_path / "val" / f"{scene:06}").mkdir(parents=True)
        made_of.scene_gt(
            tmp_path / "val" / f"{scene:06}" / "scene_gt.json", drawn.where[own], drawn.R[own], drawn.t[own]
        )
    estimates, _ = made_of.files(tmp_path, drawn)
    residuals = compared_files(estimates, tmp_path / "val")
    assert len(residuals.where) == residuals.is_estimated.sum() == 200
    assert (residuals.surplus, residuals.absent) == (0, 0)


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
    form = make_fit_form(lmo, measured, compute_goodness_of_fit(lmo, measured))
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
