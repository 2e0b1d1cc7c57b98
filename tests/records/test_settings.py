"""The settings of a trial are stated once: what else lists them is made from that."""

from __future__ import annotations

import json
import sys
from dataclasses import fields
from inspect import signature
from pathlib import Path
from typing import get_type_hints

import pytest

from apo_bench import InputError, SweepConfig, TrialConfig, run_trial
from apo_bench.benchmark.sweeps.sweep_file import SWEEP_KEYS
from apo_bench.cli.shared.setting_options import make_sweep_options, make_trial_options
from apo_bench.envs.apo_replay import APOReplay
from apo_bench.records import KEY, RECORD_FIELDS, REQUIRED, SETTINGS, restore_settings

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "tests" / "kept" / "sweep"
"""2 scenarios, 2 levels, 3 methods, 2 seeds."""


def test_columns_of_a_row_are_the_settings_in_their_order_with_their_ranges() -> None:
    columns = [info.name for info in SETTINGS.values()]
    assert [column for column in RECORD_FIELDS if column in columns] == columns
    for name, kind in get_type_hints(TrialConfig, include_extras=True).items():
        column = RECORD_FIELDS[name]
        if not SETTINGS[name].choices and name != "secret_seed":
            assert column in (kind, kind | None)
    assert {*KEY, *columns} - {*REQUIRED} == {"secret_seed"}


def test_sweeps_have_an_axis_or_one_value_of_every_setting() -> None:
    here = {field.name for field in fields(SweepConfig)}
    for name, info in SETTINGS.items():
        noise = name in ("noise_mm", "noise_deg")
        alone = name in ("seed", "secret_seed")
        assert info.axis + info.shared + noise + alone == 1
        assert name in here | {"secret_seed"}
        assert not info.axis or name in SWEEP_KEYS


def test_every_setting_is_an_option_of_run_and_sweep() -> None:
    options = {option.name for option in make_trial_options()}
    assert options == {info.keyword for info in SETTINGS.values() if info.name != "scenario"} | {"noise_level"}
    assert options - {"seed"} <= {option.name for option in make_sweep_options()} | {"secret_seed_file"}


def test_the_environment_has_the_same_defaults() -> None:
    defaults = {name: parameter.default for name, parameter in signature(APOReplay).parameters.items()}
    here = [name for name in SETTINGS if defaults.get(name) is not None and name != "scenario"]
    robot = ["robot_error", "max_reobservations", "ft_sensor", "assumed_robot_error", "min_predicted_success"]
    assert here == ["human_error_scale", "pose_source", "grasp", "arm", *robot, "timestep_s", "fidelity"]
    assert [defaults[name] for name in here] == [SETTINGS[name].default for name in here]
    assert defaults["noise_level"] == TrialConfig.noise_mm == TrialConfig.noise_deg


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"grasp": "glue"}, "unknown grasp 'glue'. Known: friction, weld."),
        ({"grasp": "weld", "method": "oracle+probe"}, "the grasp 'weld' was given for a method with +probe"),
        ({"clearance_mm": float("inf")}, "clearance mm must be a number from 0 to 5, got inf"),
    ],
)
def test_a_setting_that_cannot_be_is_one_sentence(wrong: dict[str, object], said: str) -> None:
    with pytest.raises(InputError) as refused:
        TrialConfig(**{"scenario": "block_on_block", **wrong})  # type: ignore[arg-type]
    assert str(refused.value).startswith(said)


def test_a_trial_is_written_as_before() -> None:
    """Bytes are promised on one machine; everywhere the columns, their order, the settings and the ending are."""
    for line in (KEPT / "trials.jsonl").read_text(encoding="utf-8").splitlines()[:3]:
        before = json.loads(line)
        again = run_trial(restore_settings(before, before["scenario"]))
        assert [column for column in again if column in before] == list(before)
        same = [info.name for info in SETTINGS.values() if info.name in before]
        for column in (*same, "success", "failure_stage", "failure_code", "corrected_operations"):
            assert dict(again)[column] == before[column]


def test_every_setting_and_column_has_a_sentence_on_a_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "docs")
    import fields as pages

    monkeypatch.delitem(sys.modules, "fields")
    for name in SETTINGS:
        assert f"| `{name}` | " in pages.settings_page()
    for column in RECORD_FIELDS:
        assert f"| `{column}` | " in pages.record_page()
