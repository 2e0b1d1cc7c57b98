"""The form of trials with a real robot becomes an entry, by the thresholds of the judge."""

from __future__ import annotations

from pathlib import Path

import pytest

from apo_bench import InputError, load_scenario
from apo_bench.benchmark.scoring.entry import read_entry, write_entry
from apo_bench.benchmark.scoring.leaderboard import ranked
from apo_bench.benchmark.scoring.real_form import read_real_entry
from apo_bench.cli.app import main
from apo_bench.formats.kit import write_kit

LETTERS = {
    "yes,yes,yes,0.39,0.1,50,1,": "1",
    "yes,yes,yes,0.41,0.1,50,1,a gap of a fit face": "0",
    "yes,yes,yes,0.2,0.11,50,1,a gap of a support": "0",
    "yes,yes,yes,0.2,0.1,49,1,beside its place": "0",
    "yes,yes,yes,0.2,0.1,90,1.1,pushed": "0",
    "yes,yes,no,0.2,0.1,90,0,fell": "0",
    "Yes,no,yes,,,,,jammed": "0",
    "no,yes,yes,0,0,100,0,castle 2 fell while it was shown": "x",
}
"""Cells of a line -> its letter in the entry, at a clearance of 0.3 mm per side."""


def filled(folder: Path, cells: list[str]) -> Path:
    """The form of a kit with these cells behind those of the method contact."""
    write_kit(load_scenario("stick_in_tower"), 0.3, folder, ["uncorrected", "contact"], len(cells), step=False)
    form = folder / "form.csv"
    head, *lines = form.read_text(encoding="utf-8").splitlines()
    own = iter(cells)
    lines = [line.rstrip(",") + "," + next(own) if ",contact," in line else line for line in lines]
    form.write_text("\n".join([head, *lines]), encoding="utf-8")
    return form


def test_the_form_makes_an_entry_that_the_judge_would_make(tmp_path: Path) -> None:
    entry = read_real_entry(filled(tmp_path, list(LETTERS)), "contact", name="our lab")
    assert list(entry.tracks["real-stick_in_tower"].conditions.values()) == ["".join(LETTERS.values())]
    assert entry.tracks["real-stick_in_tower"].trials == len(LETTERS) - 1
    assert entry.overall is None
    write_entry(entry, tmp_path / "entry.json")
    again = read_entry(tmp_path / "entry.json")
    assert again == entry
    assert [line.status for line in ranked([again])] == ["real, self-reported, few trials"]


def test_the_command_writes_the_entry(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    form = filled(tmp_path, list(LETTERS))
    assert main(["score", "contact", "--results", str(form), "--out", str(tmp_path / "real.json")]) == 0
    assert "real-stick_in_tower" in capsys.readouterr().out
    assert read_entry(tmp_path / "real.json").real


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ("yes,yes,perhaps,0,0,100,0,", "line 3, column at_rest: yes or no is needed, 'perhaps' was given"),
        ("yes,yes,yes,,0,100,0,", "line 3, column fit_gap_mm: a number of at most 1000 is needed, nothing was given"),
    ],
)
def test_a_cell_that_is_wrong_is_named(tmp_path: Path, cells: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_real_entry(filled(tmp_path, [cells]), "contact")


def test_a_method_without_a_line_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no line has the method 'snap'"):
        read_real_entry(filled(tmp_path, []), "snap")
