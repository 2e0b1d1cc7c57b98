"""`apo-bench inspect dof` and `apo-bench correct`: what they print, what they write, how they end."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from apo_bench import load_scenario, read_observation
from apo_bench.assembly import measure_largest_gap
from apo_bench.cli import app as cli
from apo_bench.geometry import pose

ROOT = Path(__file__).parents[2]
SEEN = ROOT / "docs" / "seen.csv"


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    """Exit code, stdout, stderr."""
    capsys.readouterr()
    code = cli.main(arguments)
    out, err = capsys.readouterr()
    return code, out, err


def asked(path: Path, *more: str) -> tuple[str, ...]:
    return ("correct", "stick_in_tower", "--observation", str(path), *more)


def aside(folder: Path, mm: float) -> Path:
    """The observation of the README with castle 2 further aside than the noise explains."""
    lines = SEEN.read_text(encoding="utf-8").splitlines()
    cells = lines[2].split(",")
    cells[3] = f"{float(cells[3]) + mm:g}"
    path = folder / "aside.csv"
    path.write_text("\n".join([*lines[:2], ",".join(cells), *lines[3:]]), encoding="utf-8")
    return path


def planned(path: Path) -> np.ndarray:
    """The target poses in the file of a plan."""
    entries = json.loads(path.read_text())["operations"]
    return np.array([pose.unpack([*(1e-3 * np.array(o["position_mm"])), *o["quaternion_wxyz"]]) for o in entries])


def test_an_observation_is_explained_where_it_is_corrected_to(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "inspect", "dof", "stick_in_tower", "--observation", str(SEEN), "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert (found["rank"], found["freedom"]) == (13, 5)
    made = json.loads(run(capsys, *asked(SEEN, "--json"))[1])
    for part, operation in zip(found["parts"], made["operations"], strict=True):
        assert part["position_mm"] == pytest.approx(operation["position_mm"], abs=1e-6)
    assert found.pop("hypotheses") == made["hypotheses"] == []
    assert made["explanation"] | {"predicted_success": made["predicted_success"]} == found
    assert 0.0 < found["predicted_success"] < 1.0


@pytest.mark.parametrize("ending", ["csv", "json"])
def test_what_is_written_holds_every_contact(capsys: pytest.CaptureFixture[str], tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"made.{ending}"
    code, out, err = run(capsys, *asked(SEEN, "--out", str(path), "--json"))
    assert (code, err, out.count("\n")) == (0, "", 1)
    made = json.loads(out)
    scenario = load_scenario("stick_in_tower")
    seen = read_observation(SEEN, scenario)
    goals = read_observation(path, scenario).poses if ending == "csv" else planned(path)
    assert measure_largest_gap(seen.assembly, seen.start, goals) < 1e-12
    stated = [pose.unpack([*(1e-3 * np.array(o["position_mm"])), *o["quaternion_wxyz"]]) for o in made["operations"]]
    assert goals == pytest.approx(np.array(stated), abs=1e-12)
    assert (made["status"], made["rank"], made["freedom"], made["test"]["passes"]) == ("converged", 13, 5, True)
    assert np.array(made["operations"][0]["covariance_mm_deg"]).shape == (6, 6)


@pytest.mark.parametrize(("method", "code", "status"), [("contact", 0, "converged")])
def test_what_happens_in_doubt(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, method: str, code: int, status: str
) -> None:
    """Castle 2 was seen 25 mm aside: R4, which it has with the stick, is what the rest does without."""
    path = aside(tmp_path, 25.0)
    out = tmp_path / "out.csv"
    ended, said, err = run(capsys, *asked(path, "--method", method, "--json", "--out", str(out)))
    made = json.loads(said)
    assert (ended, made["status"], made["test"]["passes"]) == (code, status, False)
    assert made["dropped"] == (["R4"] if method == "contact-drop" else [])
    assert (made["test_after"] or {}).get("passes") == (True if method == "contact-drop" else None)
    assert made["test"]["ambiguous"] == ["R4"]
    assert out.exists() == (code == 0)
    assert err == ""
    if method == "contact-drop":
        assert (made["rank"], made["freedom"], made["explanation"]["rank"]) == (11, 7, 11)
    if code:
        assert made["operations"] is None
    assert "R4 may be wrong" in run(capsys, *asked(path, "--method", method))[1]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--method", "papr"), "did you mean 'paper'"),
        (("--deviation-mm", "0"), "deviation_mm 0 was given; a number from 0.0001 to 10000 is allowed"),
    ],
)
def test_a_wrong_request_is_said_in_one_sentence(
    capsys: pytest.CaptureFixture[str], more: tuple[str, ...], said: str
) -> None:
    code, out, err = run(capsys, *asked(SEEN, *more))
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert said in err


def test_what_was_seen_is_not_written_over(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "seen.csv"
    link = tmp_path / "link.csv"
    path.write_bytes(SEEN.read_bytes())
    link.symlink_to(path)
    for out, words in ((path, "is a file that the command reads"), (link, "a symbolic link")):
        code, said, err = run(capsys, *asked(path, "--out", str(out)))
        assert (code, said, words in err) == (2, "", True)
    assert path.read_bytes() == SEEN.read_bytes()


def test_no_simulator_is_needed() -> None:
    """Nor what draws; the commands read, correct and print without them. Part files alone are read by MuJoCo."""
    missing = ("mink", "dm_control", "matplotlib", "apo_bench.simulation")
    every = (asked(SEEN), asked(SEEN, "--json"), ("inspect", "dof", "stick_in_tower", "--observation", str(SEEN)))
    code = f"import sys\nfor name in {missing!r}: sys.modules[name] = None\nfrom apo_bench.cli.app import main\n"
    done = _python(f"{code}for asked in {[list(one) for one in every]!r}: print('ended with', main(asked))")
    assert (done.returncode, done.stderr) == (0, "")
    *said, rest = done.stdout.split("ended with 0\n")
    assert len(said) == len(every)
    assert all("R3" in one for one in said)
    assert rest == ""


def _python(code: str) -> subprocess.CompletedProcess[Any]:
    return subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )
