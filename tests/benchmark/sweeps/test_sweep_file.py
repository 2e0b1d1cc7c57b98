"""Sweep files: what they say, and one sentence for everything that is wrong with them."""

from __future__ import annotations

from pathlib import Path

import pytest

from apo_bench import InputError, SweepConfig, run_sweep
from apo_bench.benchmark.sweeps.grid import list_work_units, load_all
from apo_bench.benchmark.sweeps.sweep_file import is_sweep_file, read_sweep
from apo_bench.cli.app import main
from apo_bench.records import make_trial_key
from apo_bench.resources import folder

WHOLE = """
scenario = ["stick_in_tower", "stick_on_castles"]
noise = ["isotropic", "per-part"]
noise_level = [0, 1, [2, 0.5]]
human_error_scale = [1]
method = ["uncorrected", "paper"]
grasp = ["friction", "weld"]
contact_source = ["given", "false-negative"]
pose_source = ["noise-model"]
clearance_mm = [0.25, 0.5]
trials = 3
seed = 7
arm = "six_axis"
timestep_ms = 0.5
fidelity = "full"

[[also]]
method = ["oracle"]

[[also]]
scenario = ["block_on_block"]
noise_level = [4]
trials = 1
"""


def written(folder: Path, text: str | bytes) -> Path:
    path = folder / "sweep.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_every_key_is_read_and_further_grids_replace_what_they_name(tmp_path: Path) -> None:
    top, oracle, far = read_sweep(written(tmp_path, WHOLE))
    assert top == SweepConfig(
        scenario=("stick_in_tower", "stick_on_castles"),
        noise_level=(0.0, 1.0, (2.0, 0.5)),
        human_error_scale=(1.0,),
        method=("uncorrected", "paper"),
        clearance_mm=(0.25, 0.5),
        trials=3,
        seed=7,
        noise=("isotropic", "per-part"),
        contact_source=("given", "false-negative"),
        grasp=("friction", "weld"),
        timestep_s=0.0005,
    )
    assert (oracle.method, oracle.noise_level, oracle.trials) == (("oracle",), top.noise_level, 3)
    assert (far.scenario, far.noise_level, far.method, far.trials) == (("block_on_block",), (4.0,), top.method, 1)


def test_what_is_left_out_is_as_usual(tmp_path: Path) -> None:
    assert read_sweep(written(tmp_path, 'scenario = ["pocket_table"]')) == (SweepConfig(("pocket_table",)),)


def test_trials_of_all_grids_are_united_each_once() -> None:
    first = SweepConfig(("stick_in_tower",), (0, 1), (0, 1), ("oracle", "uncorrected", "paper"), trials=2, seed=5)
    again = SweepConfig(("stick_in_tower",), (1, (1, 1), -0.0), (1,), ("oracle", "paper"), trials=3, seed=5)
    other = SweepConfig(("block_on_block",), ((2, 1),), (1,), ("uncorrected",), trials=1, seed=6)
    loaded = load_all([first, again, other])
    trials = [t for unit in list_work_units([first, again, other], loaded) for t in unit]
    keys = [make_trial_key(t, loaded[t.scenario].name) for t in trials]
    assert len(set(keys)) == len(keys) == 2 * (1 + 2 * 2 * 2) + 1 * (1 + 2) + 1
    assert [(t.seed, t.noise_mm, t.noise_deg) for t in trials if t.scenario == "block_on_block"] == [(6, 2.0, 1.0)]
    for unit in list_work_units([first, again, other], loaded):
        assert len({(t.scenario, t.clearance_mm, t.seed, t.human_error_scale, t.pose_source) for t in unit}) == 1


def test_scenario_files_are_told_from_sweep_files(tmp_path: Path) -> None:
    assert not is_sweep_file(str(folder("scenarios") / "stick_in_tower.toml"))
    assert not is_sweep_file("stick_in_tower")
    assert is_sweep_file(str(written(tmp_path, WHOLE)))
    assert is_sweep_file(str(written(tmp_path, "")))


NEEDS = 'scenario = ["stick_in_tower"]\n'
BAD: list[tuple[str | bytes, str]] = [
    ("", "the key 'scenario' is missing"),
    (NEEDS + "metod = []", "unknown key 'metod' (did you mean 'method'?)"),
    (NEEDS + "[[also]]\narm = 'mine'", "unknown key 'arm'"),
    (NEEDS + "[[also]]\nmethod = []", "also 1: no method was given for the sweep; at least one is needed"),
    (NEEDS + "noise_level = ['1']", "noise level must be"),
    (NEEDS + "trials = 1000000", "trials, and at most 1,000,000 are allowed in one folder"),
    (NEEDS + "seed = 9007199254740991", "seed must be a whole number from 0"),
    (NEEDS + "method = ['papr']", "unknown method 'papr'; did you mean 'paper'?"),
    (NEEDS + "pose_source = ['depth-camera']\nnoise_level = [[1, 2]]", "noise level must be one number, mm per ray"),
    ("scenario = ['stick_in_towr']", "did you mean 'stick_in_tower'"),
]


@pytest.mark.parametrize(("text", "words"), BAD, ids=range(len(BAD)))
def test_one_sentence_for_what_is_wrong(text: str | bytes, words: str, tmp_path: Path) -> None:
    path = written(tmp_path, text)
    out = tmp_path / "out"
    with pytest.raises(InputError) as refused:
        run_sweep(read_sweep(path), out)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)
    assert not out.exists()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--noise-level", "1"], "--noise-level and the sweep file"),
        (["--fidelity", "half"], "unknown fidelity 'half'. Known: full, near-contact."),
        (["--trial-limit", "0"], "a limit of 0 s per trial was given"),
        (["--backend", "rai"], "unknown backend 'rai'; did you mean 'ray'?"),
    ],
)
def test_what_goes_together(more: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sweep", str(written(tmp_path, WHOLE)), *more, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()
