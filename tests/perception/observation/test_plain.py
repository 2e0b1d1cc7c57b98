"""Plain functions as noise models, and the commands that list noise models and print their cards."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from apo_bench import InputError, observe
from apo_bench.cli.app import main
from apo_bench.geometry import Array, pose
from apo_bench.perception.observation.models.displacement import COVARIANCE_FLOOR
from apo_bench.perception.observation.noise import NOISES, NoiseLevel, make_noise
from apo_bench.perception.observation.noise_file import presets
from apo_bench.perception.observation.plain import Plain
from apo_bench.viz.noise_sheet import ErrorSample, describe_model, draw_errors, find_facts, list_models, noise_sheet
from tests import scenes

TOWER = scenes.stick_in_tower()
SHOWN = scenes.shown(TOWER)
NOISE_LEVEL = NoiseLevel(1.0, 1.0)


def lifted(goals: Array, rng: np.random.Generator) -> Array:
    """Everything is seen too high, by a millimetre or two."""
    goals[:, 2, 3] += rng.uniform(1e-3, 2e-3, len(goals))
    return goals


def with_deviations(function, mm: object, deg: object):
    def noise(goals, rng):
        return function(goals, rng)

    noise.deviation_mm = mm
    noise.deviation_deg = deg
    return noise


@pytest.mark.parametrize("wrap", [lambda: with_deviations(lifted, 2.0, 0.5), lambda: Plain(lifted, 2.0, 0.5)])
def test_goals_and_declared_deviations_become_an_observation(wrap) -> None:
    before = TOWER.goals.copy()
    seen = observe(SHOWN, make_noise(wrap(), NOISE_LEVEL), np.random.default_rng(4))
    up = np.random.default_rng(4).uniform(1e-3, 2e-3, 3)
    assert_allclose(seen.poses[:, 2, 3] - TOWER.goals[:, 2, 3], up, atol=1e-15)
    assert_allclose(seen.covariance, np.tile(np.diag(np.repeat([2e-3, np.radians(0.5)], 3) ** 2), (3, 1, 1)))
    assert seen.observed.all()
    assert_array_equal(TOWER.goals, before)


def test_what_is_declared_as_nothing_is_stated_as_the_floor_and_carelessness_is_added() -> None:
    human_error_scale = np.zeros((3, 6, 6))
    human_error_scale[1, 1, 1] = 0.003**2
    model = make_noise(with_deviations(lambda goals, rng: goals, 0, 0), NOISE_LEVEL)
    seen = observe(scenes.shown(TOWER, human_error_scale), model, np.random.default_rng(0))
    expected = np.tile(np.diag(COVARIANCE_FLOOR**2), (3, 1, 1))
    expected[1, 1, 1] = 0.003**2
    assert_allclose(seen.covariance, expected, rtol=1e-9, atol=1e-20)
    assert seen.poses.tobytes() == TOWER.goals.tobytes()


def test_a_class_made_with_a_level_may_be_plain_too() -> None:
    class Mine:
        def __init__(self, noise_level: NoiseLevel) -> None:
            self.deviation_mm = 3 * noise_level.mm
            self.deviation_deg = noise_level.deg

        def __call__(self, goals: Array, rng: np.random.Generator) -> Array:
            return goals @ pose.exp(rng.standard_normal((len(goals), 6)) * self.deviation_mm * 1e-3)

    seen = observe(SHOWN, make_noise(Mine, NoiseLevel(2.0, 1.0)), np.random.default_rng(0))
    assert_allclose(seen.covariance[0, 0, 0], 0.006**2)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (lifted, "set lifted.deviation_mm and lifted.deviation_deg, or give (assembly, shown, rng)"),
        (with_deviations(lifted, -1.0, 1.0), "'noise' declares deviation_mm -1.0; a number from 0 to 10000 is allowed"),
        (with_deviations(lifted, 1.0, "2"), "declares deviation_deg '2'; a number from 0 to 180 is allowed"),
    ],
)
def test_declarations_that_are_missing_or_make_no_sense(given, message: str) -> None:
    with pytest.raises(InputError) as refused:
        make_noise(given, NOISE_LEVEL)
    assert message in str(refused.value)


def test_one_declaration_alone_is_not_enough() -> None:
    half = with_deviations(lifted, 1.0, 1.0)
    del half.deviation_deg
    with pytest.raises(InputError, match=r"set noise\.deviation_deg, or give"):
        make_noise(half, NOISE_LEVEL)


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (None, "failed: goals of Observation"),
        (np.zeros((3, 4, 4)), "goal for operation 1 that is not a rigid pose"),
        (TOWER.goals * np.nan, "failed: goals of Observation: every number must be finite"),
    ],
)
def test_what_a_plain_function_must_not_return(returned: object, message: str) -> None:
    model = make_noise(with_deviations(lambda goals, rng: returned, 1.0, 1.0), NOISE_LEVEL)
    with pytest.raises(InputError, match="the noise model 'noise' ") as refused:
        observe(SHOWN, model, np.random.default_rng(0))
    assert message in str(refused.value)


def test_a_plain_function_by_module_and_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    (tmp_path / "plain_noise_here.py").write_text(
        "def high(goals, rng):\n    goals[:, 2, 3] += 0.002\n    return goals\n\n\n"
        "high.deviation_mm, high.deviation_deg = 2.0, 0.5\n\n\n"
        "def undeclared(goals, rng):\n    return goals\n"
    )
    monkeypatch.chdir(tmp_path)
    assert main(["noise", "show", "plain_noise_here:high"]) == 0
    assert "# plain_noise_here:high: " in capsys.readouterr().out
    assert main(["noise", "show", "plain_noise_here:undeclared"]) == 2
    output = capsys.readouterr().err
    assert output.count("\n") == 1
    assert "undeclared.deviation_mm" in output


def test_every_model_with_a_name_is_listed_and_says_what_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["noise", "list"]) == 0
    listing = capsys.readouterr().out
    for name, title in list_models().items():
        assert f"{name} " in listing
        assert title in listing
        about = find_facts(name)
        assert about.formula
        assert about.frame
        assert about.states


def test_a_card_prints_what_the_model_does(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["noise", "show", "camera", "--noise-level", "2"]) == 0
    text = capsys.readouterr().out
    about = find_facts("camera")
    assert text.startswith(f"# camera: {about.title}\n")
    for line in (*about.formula, *about.parameters, about.frame, about.states, *about.notes):
        assert line in text
    assert "\nErrors at 2 mm and 2 deg, 3000 operations of stick_in_tower:\n" in text


@pytest.mark.parametrize("name", sorted([*NOISES, *presets()]))
def test_the_page_of_cards_is_up_to_date(name: str) -> None:
    """Written by `python docs/noise_sheets.py`."""
    page = (Path(__file__).parents[3] / "docs" / "reference" / "noise-models.md").read_text(encoding="utf-8")
    where = "at 1 times the measured mm and 1 times the measured degrees" if name in presets() else "at 1 mm and 1 deg"
    assert f"{describe_model(name, 2)}\nErrors {where}, " in page


def test_the_table_of_a_card_is_of_errors_that_were_drawn() -> None:
    errors = np.zeros((5, 4))
    errors[:, 0] = [2.0, 2.0, -2.0, -2.0, 7.0]
    text = noise_sheet("isotropic", NOISE_LEVEL, ErrorSample(errors, np.array([3.0, 1.0, 1.0, 1.0]), 0.25))
    across = next(line for line in text.splitlines() if line.startswith("| across"))
    assert across.split("|")[2:5] == [f"{cell:>10} " for cell in ("3.61", "3", "2")]
    assert "5 operations of stick_in_tower; 25.0 % were not observed" in text


@pytest.mark.parametrize(
    ("given", "noise_level", "words"),
    [
        ("flips:p=0.1", NoiseLevel(2.0, 1.0), "Errors at 2 mm and 1 deg, 30 operations"),
        ("megapose-lmo-inliers", NOISE_LEVEL, "Errors at 1 times the measured mm and 1 times the measured degrees, 30"),
        (
            "megapose-lmo-inliers",
            NoiseLevel(2.0, 0.5),
            "Errors at 2 times the measured mm and 0.5 times the measured degrees, 30",
        ),
        (Plain(lifted, 2.0, 0.5), NoiseLevel(2.0, 2.0), "Errors at every noise level, 30 operations"),
    ],
)
def test_a_card_says_what_its_level_means(given: object, noise_level: NoiseLevel, words: str) -> None:
    assert f"\n{words}" in noise_sheet(given, noise_level, draw_errors(given, noise_level, 10))


def test_no_level_reaches_a_plain_function() -> None:
    for noise_level in (NoiseLevel(0.0, 0.0), NoiseLevel(5.0, 5.0)):
        seen = observe(SHOWN, make_noise(with_deviations(lifted, 2.0, 0.5), noise_level), np.random.default_rng(4))
        assert (seen.poses[:, 2, 3] > TOWER.goals[:, 2, 3] + 1e-3).all()


@pytest.mark.filterwarnings("error")
def test_a_card_of_noise_that_sees_nothing_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    blind = tmp_path / "blind.toml"
    text = presets()["megapose-lmo"].read_text(encoding="utf-8")
    blind.write_text(re.sub("missed_rate = [0-9.]+", "missed_rate = 1", text), encoding="utf-8")
    assert main(["noise", "show", str(blind)]) == 0
    assert capsys.readouterr().out.endswith("\nNo operation of stick_in_tower was observed.\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["show", "isotropc"], "unknown noise model 'isotropc'; did you mean 'isotropic'"),
        (["show", "isotropic", "--noise-level", "-1"], "noise_level must be a number from 0 to 50, got -1"),
        (["show", "megapose"], "did you mean 'megapose-lmo'"),
    ],
)
def test_wrong_requests(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["noise", *arguments]) == 2
    output = capsys.readouterr().err
    assert message in output
    assert output.count("\n") == 1
