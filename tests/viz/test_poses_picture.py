"""`apo-bench inspect poses`: what is believed, drawn and said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from apo_bench import Observation, correct, load_scenario
from apo_bench.cli import app as cli
from apo_bench.formats.observation import make_nominal_observation
from apo_bench.viz.poses_picture import format_poses, make_poses_panel

SHIFT_M = 2e-3


def lifted() -> Observation:
    """Example 5.1 with castle 2 seen 2 mm too high, and the stick half a millimetre."""
    seen = make_nominal_observation(load_scenario("stick_in_tower"), 1.0, 1.0)
    goals = np.array(seen.poses)
    goals[1, 2, 3] += SHIFT_M
    goals[2, 2, 3] += SHIFT_M / 4
    return Observation(seen.assembly, seen.start, goals, seen.covariance, seen.observed, seen.gap_m)


def test_contacts_that_do_not_hold_are_named_the_worst_first() -> None:
    seen = lifted()
    found = make_poses_panel("observed", seen, seen.poses, 3)
    assert found.gap_m == pytest.approx(SHIFT_M)
    wrong = ("R2 castle2 -> castle1: 2.00 mm", "R4 stick -> castle2: 1.50 mm", "R3 stick -> castle1: 0.50 mm")
    assert found.open == wrong
    np.testing.assert_array_equal(found.poses["castle2"], seen.poses[1])
    mended = make_poses_panel("corrected", seen, correct(seen, "contact").poses, 3)
    assert (mended.open, mended.gap_m < 1e-9) == ((), True)
    assert format_poses([mended]) == ["corrected: largest gap 0.000 mm; all contacts hold"]


def test_a_picture_is_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import imageio.v3 as imageio

    out = tmp_path / "seen.png"
    assert cli.main(["inspect", "poses", "stick_in_tower", "--observation", "docs/seen.csv", "--out", str(out)]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0].startswith("observed: largest gap 5.466 mm; open: ")
    assert said[1:] == ["corrected by contact-robust: largest gap 0.000 mm; all contacts hold", "", f"Wrote {out}"]
    drawn = imageio.imread(out)
    left = drawn[60:530, :620]
    right = drawn[60:530, 620:1240]
    assert left.std() > 10.0
    assert (np.abs(left.astype(int) - right) > 40).any(axis=-1).mean() > 0.005


def test_an_operation_that_is_not_there(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["inspect", "poses", "stick_in_tower", "--operation", "4"]) == 2
    said = capsys.readouterr()
    assert "--operation must be from 1 to 3, got 4" in said.err
    assert said.err.count("\n") == 1
    assert not Path("poses.png").exists()
