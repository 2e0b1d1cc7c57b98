"""The salt of a sweep: who does not have it cannot draw the trials; who has it draws the same ones."""

from __future__ import annotations

import json
import os
import pickle
import shlex
import stat
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from apo_bench import InputError, Scene, SweepConfig, TrialConfig, run_sweep
from apo_bench.benchmark.analysis import tally
from apo_bench.benchmark.report.comparison.compare import compare
from apo_bench.benchmark.report.report import write_report
from apo_bench.cli import app as cli
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.records import SecretSeed, open_secret_seed, read_secret_seed
from apo_bench.records.run.replay_command import format_replay_command
from apo_bench.records.secret_seed import make_secret_seed
from apo_bench.trial.trial_stages import ARM, OBSERVATION, observe_demonstration, simulate_demonstration, stream
from tests import pages
from tests.benchmark.analysis.test_rates import row, write

HERE = SecretSeed(bytes(range(16)))
THERE = SecretSeed(bytes(range(1, 33)))
HEX = "8d217488cd5974580ccd50092e6d071ae625d86a6e19b8fc95ab5f4914f76f02"
"""What a salt may look like; the same in every process, so that workers collect the same tests."""
HOPELESS = 40.0
"""A level [mm, degrees] at which plans are refused before the arm moves, so that a trial costs little."""
GRID = SweepConfig(
    ("block_on_block",), (HOPELESS,), (0.0,), ("uncorrected", "paper"), trials=2, seed=3, grasp=("weld",)
)


def state(seed: int, which: int, secret_seed: SecretSeed | None = None) -> Any:
    return stream(seed, which, secret_seed).bit_generator.state


def test_a_salt_makes_every_stream_another_one() -> None:
    drawn = [
        int(stream(seed, which, secret_seed).integers(2**63))
        for seed in (0, 1, 2**33 + 5)
        for which in range(6)
        for secret_seed in (None, HERE, THERE)
    ]
    assert len(set(drawn)) == len(drawn)
    assert state(3, ARM, HERE) == state(3, ARM, SecretSeed(bytes(range(16))))


def test_every_stage_draws_with_the_salt(tower: Scene) -> None:
    noise = make_noise("isotropic", NoiseLevel(1.0, 1.0))
    plain = simulate_demonstration(tower, 1.0, 3)
    salted = simulate_demonstration(tower, 1.0, 3, secret_seed=HERE)
    assert not np.array_equal(plain.layout.poses, salted.layout.poses)
    off = [shown.demonstration.poses[1] - shown.layout.poses[1] for shown in (plain, salted)]
    assert not np.allclose(*off, rtol=0, atol=1e-5)
    seen = [observe_demonstration(plain, noise, 3, secret_seed) for secret_seed in (None, HERE, THERE, HERE)]
    assert not any(np.array_equal(seen[0].poses, other.poses) for other in seen[1:])
    np.testing.assert_array_equal(seen[1].poses, seen[3].poses)
    expected = noise(tower.scenario.assembly, plain.demonstration, stream(3, OBSERVATION, HERE))
    np.testing.assert_array_equal(seen[1].poses, expected.poses)


def test_nothing_that_is_printed_or_written_shows_the_salt() -> None:
    spec = TrialConfig("block_on_block", secret_seed=HERE)
    for text in (repr(spec), str(spec), repr(HERE), f"{HERE}", HERE.hash):
        assert HERE.secret.hex() not in text
        assert repr(HERE.secret)[2:-1] not in text
    with pytest.raises(TypeError, match="bytes is not JSON serializable"):
        json.dumps(asdict(spec))
    assert pickle.loads(pickle.dumps(spec)) == spec != replace(spec, secret_seed=THERE)


@pytest.mark.parametrize("end", ["", "\r\n"])
def test_a_salt_file_is_one_line_of_hexadecimal_digits(tmp_path: Path, end: str) -> None:
    path = tmp_path / "secret_seed"
    path.write_bytes((HERE.secret.hex() + end).encode())
    assert read_secret_seed(path) == HERE
    path.write_bytes((HERE.secret.hex().upper() + end).encode())
    assert read_secret_seed(path) == HERE
    linked = tmp_path / "linked"
    linked.symlink_to(path)
    assert read_secret_seed(linked) == HERE


@pytest.mark.parametrize("content", [HEX[:30].encode(), b"0" * 64, HEX.encode() + b"\n" + HEX.encode()])
def test_anything_else_is_no_salt_and_is_not_repeated(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "secret_seed"
    path.write_bytes(content)
    with pytest.raises(InputError, match="is not a secret seed file; it must hold one line of 32 to 1024") as error:
        read_secret_seed(path)
    assert len(content) < 20 or content.decode(errors="replace").strip() not in str(error.value)


def test_a_salt_is_made_once_for_its_owner_alone(tmp_path: Path) -> None:
    path = tmp_path / "secret_seed"
    made = open_secret_seed(path, tmp_path / "out")
    assert len(made.secret) == 32
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert os.listdir(tmp_path) == ["secret_seed"]
    assert open_secret_seed(path, tmp_path / "out") == made
    make_secret_seed(path)
    assert read_secret_seed(path) == made
    assert open_secret_seed(tmp_path / "other", tmp_path / "out") != made


def of_salt(secret_seed: str | None, methods: tuple[str, ...] = ("uncorrected",)) -> list[dict[str, Any]]:
    return [row(method, seed, seed % 2 == 0) | {"secret_seed": secret_seed} for method in methods for seed in range(6)]


def test_rows_of_different_salts_are_neither_counted_nor_paired(tmp_path: Path) -> None:
    plain = of_salt(None)
    salted = of_salt(HERE.hash)
    with pytest.raises(InputError, match=f"drawn without a secret seed and with the secret seed {HERE.hash}; count"):
        tally([*plain, *({**one, "seed": one["seed"] + 10} for one in salted)])
    assert tally(salted)[0].trials == tally(plain)[0].trials == 6
    folders = {name: write(tmp_path / name, rows) for name, rows in (("a", plain), ("b", salted))}
    other = write(tmp_path / "c", of_salt(THERE.hash))
    for first, second in (("a", "b"), ("b", "a")):
        with pytest.raises(InputError, match="so that they have no trial in common"):
            compare(folders[first], folders[second])
    with pytest.raises(InputError, match=f"the secret seed {HERE.hash} and .* with the secret seed {THERE.hash}"):
        compare(folders["b"], other)
    assert compare(folders["b"], folders["b"]).shared == 6


def test_the_report_says_which_salt_and_how_to_run_a_trial_again(tmp_path: Path) -> None:
    out = write(tmp_path / "out", of_salt(HERE.hash))
    said = pages.words(write_report(out).page)
    assert HERE.hash in said
    assert "FILE stands for its file" in said
    plain = write_report(write(tmp_path / "plain", of_salt(None)))
    assert HERE.hash not in pages.words(plain.page)


def test_a_salted_sweep(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same rows in this process and in another one; resumed and replayed with its salt, which nothing shows."""
    file = tmp_path / "secret_seed"
    here = tmp_path / "here"
    there = tmp_path / "there"
    rows = run_sweep(GRID, here, secret_seed_file=file)
    secret_seed = read_secret_seed(file)
    assert len(rows) == 4
    assert {one["secret_seed"] for one in rows} == {secret_seed.hash}
    assert json.loads((here / "run.json").read_text())["secret_seed"] == secret_seed.hash
    spread = run_sweep(GRID, there, secret_seed_file=file, workers=1)
    assert sorted(map(json.dumps, spread)) == sorted(map(json.dumps, rows))
    before = (here / "trials.jsonl").read_bytes()
    assert run_sweep(GRID, here, secret_seed_file=file) == rows
    with pytest.raises(InputError, match=f"drawn with the secret seed {secret_seed.hash}, and no"):
        run_sweep(GRID, here)
    make_secret_seed(tmp_path / "other")
    with pytest.raises(InputError, match=f"drawn with the secret seed {secret_seed.hash}, and the secret seed file"):
        run_sweep(GRID, here, secret_seed_file=tmp_path / "other")
    assert (here / "trials.jsonl").read_bytes() == before
    capsys.readouterr()
    command = shlex.split(format_replay_command(rows[0]))[1:]
    assert command[command.index("--secret-seed-file") + 1] == "FILE"
    assert cli.main([word if word != "FILE" else str(file) for word in command] + ["--json"]) == 0
    assert json.loads(capsys.readouterr().out) == rows[0]
    write_report(here)
    for path in (*here.rglob("*"), *there.rglob("*")):
        if path.is_file():
            content = path.read_bytes()
            assert secret_seed.secret not in content
            assert secret_seed.secret.hex().encode() not in content.lower()
