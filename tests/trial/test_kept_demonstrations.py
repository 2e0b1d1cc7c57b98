"""Demonstrations that are kept are what was made, bit for bit; of a damaged file that is said, and it is made again."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from apo_bench import InputError, Scene, SweepSettings, TrialSettings, build_scene, run_sweep
from apo_bench.cli.app import main
from apo_bench.records import RANGE, Salt
from apo_bench.trial import kept_demonstrations
from apo_bench.trial.kept_demonstrations import KeptDemonstrations, decides, demonstration_key
from apo_bench.trial.stages import SimulatedDemonstration, scene_of
from tests.trial.test_code_version import PACKAGE, reached

SPEC = TrialSettings("block_on_block", seed=7, careless=1.0)


@cache
def scene() -> Scene:
    return scene_of(SPEC)


@pytest.fixture
def once(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The seeds of the demonstrations that were simulated, one entry each."""
    made = kept_demonstrations.simulate_demonstration
    seeds = list[int]()

    def counted(scene: Scene, careless: float, seed: int, *more: Any) -> SimulatedDemonstration:
        seeds.append(seed)
        return made(scene, careless, seed, *more)

    monkeypatch.setattr(kept_demonstrations, "simulate_demonstration", counted)
    return seeds


def content(simulated: SimulatedDemonstration) -> list[Any]:
    """All of a simulated demonstration but the assembly; poses as bytes, parts in their order."""
    human = simulated.demonstration
    layout = simulated.layout
    arrays = [layout.goals, human.goals, human.careless]
    named = [[(part, T.tobytes()) for part, T in poses.items()] for poses in (layout.start, human.start, human.final)]
    return [*(a.tobytes() for a in arrays), *named, human.code, human.why, human.gap_m, human.play_m]


def test_what_is_read_is_what_was_made(tmp_path: Path, once: list[int]) -> None:
    kept = KeptDemonstrations(tmp_path / "new" / "folder")
    made, read = (kept.simulated(SPEC, scene()) for _ in range(2))
    assert once == [7]
    assert content(read) == content(made)
    assert read.demonstration.assembly is scene().scenario.assembly
    assert [path.name for path in kept.folder.iterdir()] == [f"{demonstration_key(SPEC, scene())}.json"]


def test_a_demonstration_that_failed_is_kept_with_its_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = kept_demonstrations.simulate_demonstration(scene(), 1.0, 7)
    failed = replace(made.demonstration, code="demonstration_failed", why="a gap (castle.px on table.top)")
    monkeypatch.setattr(kept_demonstrations, "simulate_demonstration", lambda *_: replace(made, demonstration=failed))
    kept = KeptDemonstrations(tmp_path)
    assert content(kept.simulated(SPEC, scene())) == content(kept.simulated(SPEC, scene()))
    assert kept.simulated(SPEC, scene()).demonstration.why == "a gap (castle.px on table.top)"


def edited(change: Callable[[dict[str, Any]], None]) -> Callable[[Path], None]:
    """Write a file again after a change of what stands in it."""

    def edit(path: Path) -> None:
        said = json.loads(path.read_text())
        change(said)
        path.write_text(json.dumps(said))

    return edit


def signed(change: Callable[[dict[str, Any]], None]) -> Callable[[Path], None]:
    """The same, with a digest that fits."""

    def both(said: dict[str, Any]) -> None:
        change(said["demonstration"])
        said["digest"] = kept_demonstrations._hash(json.dumps(said["demonstration"]))

    return edited(both)


def torn(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (torn, "this is not JSON"),
        (lambda path: path.write_bytes(b"\0" * 1_000_001), "larger than 1 MB"),
        (lambda path: path.write_text("[]"), "an object with named keys is needed"),
        (edited(lambda said: said.update(schema="apo-bench/kept-demonstration/0")), "no kept demonstration of this"),
        (edited(lambda said: said.update(key="0" * 64)), "another demonstration, renamed"),
        (edited(lambda said: said["demonstration"]["goals"][0][0].reverse()), "the file is damaged"),
    ],
)
def test_a_damaged_file_is_one_sentence_and_is_made_again(
    tmp_path: Path, once: list[int], capsys: pytest.CaptureFixture[str], spoil: Callable[[Path], None], said: str
) -> None:
    kept = KeptDemonstrations(tmp_path)
    good = content(kept.simulated(SPEC, scene()))
    [path] = tmp_path.iterdir()
    spoil(path)
    assert content(kept.simulated(SPEC, scene())) == good
    complaint = capsys.readouterr().err
    assert said in complaint
    assert complaint.endswith("; the demonstration is made again.\n")
    assert complaint.count("\n") == 1
    assert content(kept.simulated(SPEC, scene())) == good
    assert once == [7, 7], "the file is whole again"
    assert list(tmp_path.iterdir()) == [path], "nothing else is left"


def test_a_file_of_another_user_is_not_read(
    tmp_path: Path, once: list[int], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = KeptDemonstrations(tmp_path)
    good = content(kept.simulated(SPEC, scene()))
    [path] = tmp_path.iterdir()
    signed(moved)(path)
    monkeypatch.setattr(os, "geteuid", lambda: path.stat().st_uid + 1)
    assert content(kept.simulated(SPEC, scene())) == good
    assert "belongs to another user; the demonstration is made again." in capsys.readouterr().err
    assert once == [7, 7]


def moved(said: dict[str, Any]) -> None:
    """The truth, by 20 mm."""
    said["truth"][0][0][3] += 0.02


def test_own_files_are_trusted_as_the_guide_says(tmp_path: Path) -> None:
    """A digest that was computed again fits: whoever writes as this user decides the truth."""
    kept = KeptDemonstrations(tmp_path)
    good = kept.simulated(SPEC, scene())
    [path] = tmp_path.iterdir()
    signed(moved)(path)
    off = kept.simulated(SPEC, scene()).layout.goals - good.layout.goals
    assert off[0, 0, 3] == pytest.approx(0.02)
    guide = (PACKAGE.parent / "docs" / "guide" / "sweeps.md").read_text()
    assert "the folder is trusted: its digests find damage, not intent." in guide
    assert "put there by somebody else" not in guide


def test_what_cannot_be_kept_is_used_all_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept = KeptDemonstrations(tmp_path / "gone")
    kept.folder.rmdir()
    assert kept.simulated(SPEC, scene()).demonstration.code == "ok"
    complaint = capsys.readouterr().err
    assert "the demonstration cannot be kept: " in complaint
    assert "cannot be written (No such file or directory)" in complaint


@pytest.mark.parametrize(("made", "what"), [(Path.mkdir, "a folder"), (os.mkfifo, "a pipe")])
def test_what_stands_in_the_way_of_a_file_is_one_sentence(
    made: Callable[[Path], None], what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = KeptDemonstrations(tmp_path)
    made(tmp_path / f"{demonstration_key(SPEC, scene())}.json")
    assert kept.simulated(SPEC, scene()).demonstration.code == "ok"
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1
    assert "the demonstration is made again, and cannot be kept: " in complaint
    assert complaint.endswith(f".json is {what}, and only an ordinary file is written over; remove it.\n")


def test_a_folder_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for wrong in (tmp_path / "file", tmp_path / "file" / "folder", Path("a\0b")):
        with pytest.raises(InputError, match="name a folder that can be written"):
            KeptDemonstrations(wrong)


def test_the_key_is_of_all_that_decides_a_demonstration_and_of_nothing_else() -> None:
    key = demonstration_key(SPEC, scene())
    salted = replace(SPEC, salt=Salt(bytes(range(32))))
    others = [demonstration_key(spec, scene()) for spec in (replace(SPEC, seed=8), replace(SPEC, careless=0.5), salted)]
    for asked in ({"clearance_mm": 0.5}, {"timestep_s": 0.0005}):
        others.append(demonstration_key(SPEC, build_scene(scene().scenario, **asked)))
    others.append(demonstration_key(replace(SPEC, scenario="stick_on_castles"), scene()))
    assert len({key, *others}) == 1 + len(others)
    alike = replace(SPEC, level_mm=3.0, method="paper", noise="per-part", relations="missed", fidelity="contact")
    assert demonstration_key(alike, scene()) == key
    assert demonstration_key(replace(SPEC, grasp="weld"), build_scene(scene().scenario, grasp="weld")) == key


def test_all_code_that_a_demonstration_runs_through_is_in_the_key() -> None:
    starts = (
        "simulation/human/demonstration.py",
        "simulation/scene/scene.py",
        "scenario/layout.py",
        "scenario/file.py",
    )
    run_through = set().union(*(reached(PACKAGE / start, tables=False) for start in starts))
    assert {"simulation/human/demonstration.py", "judging/verdict.py", "parts/mjcf.py"} <= run_through
    assert [file for file in sorted(run_through) if not decides(file)] == []
    assert decides("trial/stages.py")
    assert not decides("correction/contact/contact.py")


def test_what_a_range_finder_records_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_demonstrations, "simulate_demonstration", lambda *asked: asked[3])
    assert KeptDemonstrations(tmp_path).simulated(replace(SPEC, eye=RANGE, noise=RANGE), scene()) == RANGE  # type: ignore[comparison-overlap]
    assert list(tmp_path.iterdir()) == []


def test_rows_are_the_same_bytes_with_and_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    grid = SweepSettings(("block_on_block",), (1.0,), (1.0,), ("none", "paper"), trials=2, fidelity="contact")
    rows = []
    for out, folder in (("plain", None), ("first", tmp_path / "kept"), ("again", tmp_path / "kept")):
        if out == "again":
            monkeypatch.setattr(kept_demonstrations, "simulate_demonstration", lambda *_: pytest.fail("made again"))
        run_sweep(grid, tmp_path / out, cache=folder)
        rows.append((tmp_path / out / "trials.jsonl").read_bytes())

    assert rows[0] == rows[1] == rows[2]
    assert len(list((tmp_path / "kept").iterdir())) == 2


def test_the_command_keeps_demonstrations_where_it_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], once: list[int]
) -> None:
    command = ["replay", "block_on_block", "--seed", "7", "--fidelity", "contact", "--json", "--cache", str(tmp_path)]
    said = []
    for _ in range(2):
        assert main(command) == 0
        said.append(capsys.readouterr().out)
    assert said[0] == said[1]
    assert once == [7]
    wrong = tmp_path / "file"
    wrong.touch()
    assert main([*command[:-1], str(wrong)]) == 2
    assert "the cache" in capsys.readouterr().err
