"""The folder of a sweep that a stranger made: nothing in it is run, obeyed, or written through."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path
from typing import Any

import pytest

from apo_bench import InputError
from apo_bench.benchmark.analysis import tally
from apo_bench.benchmark.report.report import write_report
from apo_bench.cli import app as cli
from apo_bench.cli.rates import print_rates
from apo_bench.io import clean
from apo_bench.records.run.replay_command import format_replay_command
from apo_bench.records.run.run_folder import read_records
from apo_bench.records.user_code import list_user_code
from tests import pages
from tests.benchmark.analysis.test_rates import row, write

EVIL = """from pathlib import Path
Path("touched").write_text("evil code ran")
raise SystemExit
"""
NAMES = ({"arm": "evil:arm"}, {"method": "evil:correct"}, {"noise": "evil:noise"}, {"contact_source": "evil:told"})
DANGEROUS = (
    *('<script>alert("1")</script>', "$(touch x)", "; rm -r .", "`touch x`", "'; touch x; '", "-x", "a b", "&&"),
    *("[/red]", "--video=x.mp4"),
)


def failed(seed: int, **more: Any) -> dict[str, Any]:
    return row(str(more.pop("method", "contact")), seed, False, scenario="block_on_block", **more)


@pytest.fixture
def hostile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Rows that name code that lies beside them, from where the report is made."""
    folder = write(tmp_path / "run", [failed(seed, **names) for seed, names in enumerate(NAMES)])
    (folder / "evil.py").write_text(EVIL, encoding="utf-8")
    (folder / "run.json").write_text(json.dumps({"files": {"evil": "evil:scenario"}, "command": "os:abort"}))
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", [*sys.path, str(folder)])
    return folder


def test_nothing_that_rows_name_is_imported(hostile: Path) -> None:
    assert cli.main(["report", ".", "--max-pictures", "9"]) == 0
    assert cli.main(["compare", ".", ".", "--out", "made"]) == 0
    assert "evil" not in sys.modules
    assert not (hostile / "touched").exists()


@pytest.mark.parametrize(
    ("names", "own"),
    [
        ({"noise": "my noise.toml"}, ()),
        ({"noise": "flips:p=0.1/r=0.5"}, ()),
        (
            {
                "noise": "empirical:mine.csv",
                "contact_source": "face-offset:3mm",
                "method": "contact",
                "arm": "six_axis",
            },
            (),
        ),
        *((names, tuple(names.values())) for names in NAMES),
    ],
)
def test_what_is_code_of_ones_own(names: dict[str, str], own: tuple[str, ...]) -> None:
    assert list_user_code(row() | names) == own


def dangerous(seed: int, evil: str) -> dict[str, Any]:
    more = {
        "scenario": evil,
        "noise": evil,
        "arm": evil,
        "contact_source": f"x:{evil}",
        "method": evil,
        "sentence": evil,
    }
    return row(seed=seed, success=False) | more


@pytest.mark.parametrize("evil", DANGEROUS)
def test_commands_are_quoted(evil: str) -> None:
    said = shlex.split(format_replay_command(dangerous(3, evil)))
    assert said[:2] == ["apo-bench", "run"]
    assert said[2] == (f"./{evil}" if evil.startswith("-") else evil)
    for option, value in (("--noise", evil), ("--arm", evil), ("--contact-source", f"x:{evil}"), ("--method", evil)):
        assert said[said.index(option) + 1] == value


def test_names_are_shown_and_not_obeyed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [dangerous(seed, evil) for seed, evil in enumerate(DANGEROUS)]
    folder = write(tmp_path / "run", rows)
    page = write_report(folder).page
    assert "<script>alert" not in page.read_text(encoding="utf-8")
    assert all(evil in pages.lines(page) for evil in DANGEROUS)
    assert cli.main(["compare", str(folder), str(folder), "--out", str(tmp_path / "made")]) == 0
    assert "<script>alert" not in (tmp_path / "made" / "compare.html").read_text(encoding="utf-8")
    print_rates(tally(rows))
    assert "[/red]" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["scenario", "method"])
@pytest.mark.parametrize("evil", ["two\nlines", "\u202etxt"])
def test_names_in_commands_have_no_control_characters(name: str, evil: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"line 1, field {name}: control characters are not allowed"):
        write_report(write(tmp_path / "run", [row("contact") | {name: evil}]))


def test_a_terminal_shows_what_it_would_obey(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert clean("a\x1b[2J\nb\x07\x9b\u202e\ud800é") == "a\\x1b[2J\\nb\\x07\\x9b\\u202e\\ud800é"
    print_rates(tally([row("contact", 0, False, scenario="\x1b]0;title\x07")]))
    assert cli.main(["report", str(tmp_path / "no\x1b[31mwhere")]) == 2
    said = capsys.readouterr()
    for text in (said.out, said.err):
        assert "\x1b" not in text
        assert "\\x1b" in text


def test_a_sentence_of_a_row_is_only_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from apo_bench.assembly import Outcome
    from apo_bench.cli.shared import print_columns
    from apo_bench.trial.record_start_and_end import end_record
    from apo_bench.viz.trial_text import format_summary

    end = end_record(Outcome("correct", "raised", None, "\x1b[31mraised\nmore"), success=False)
    print_columns(format_summary(row("contact", 0, False, pose_source="noise-model") | end, "stick_in_tower"))
    assert "\\x1b[31mraised\\nmore" in capsys.readouterr().out
    assert end["sentence"] == "\\x1b[31mraised\\nmore"
    folder = write(tmp_path / "run", [row("contact", 0, False) | {"sentence": "\x1b[31m\x07\r\u202e"}])
    assert [one["sentence"] for one in read_records(folder)] == ["\\x1b[31m\\x07\\r\\u202e"]


@pytest.mark.parametrize("name", ["report.html", "tables", "tables/conditions.csv"])
def test_a_report_is_not_written_through_links(name: str, tmp_path: Path) -> None:
    folder = write(tmp_path / "run", [row("contact")])
    target = tmp_path / "target"
    (folder / name).parent.mkdir(exist_ok=True)
    target.mkdir() if name in ("tables", "figures") else target.write_text("mine", encoding="utf-8")
    (folder / name).symlink_to(target)
    with pytest.raises(InputError, match=f"{name} is a symbolic link"):
        write_report(folder)
    assert list(target.iterdir()) == [] if target.is_dir() else target.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("name", ["trials.jsonl", "torn.txt"])
def test_a_sweep_does_not_write_through_links(name: str, tmp_path: Path) -> None:
    from apo_bench.records.run.run_folder import RunFolder

    folder = tmp_path / "run"
    target = tmp_path / "target"
    folder.mkdir()
    target.write_bytes(b"")
    if name == "torn.txt":
        (folder / "trials.jsonl").write_text('{"torn', encoding="utf-8")
    (folder / name).symlink_to(target)
    with pytest.raises(InputError, match="is a symbolic link"):
        RunFolder(folder, {})
    assert target.read_bytes() == b""
