"""Entries of strangers: a file that is not an entry is left out in one sentence, and no text of one means anything."""

from __future__ import annotations

import html.parser
import json
from pathlib import Path

import pytest
from markdown_it import MarkdownIt
from msgspec import to_builtins

from apo_bench.benchmark.scoring.entry import SCHEMA, Entry, TrackScore, score_of, write_entry
from apo_bench.benchmark.scoring.leaderboard import read_entries
from apo_bench.cli.app import main

NAMES = (
    r"$\frac{1$",
    "<script>alert(1)</script>",
    "<img src=x onerror=alert(1)>",
    "a | b | c",
    "`tick` ``two`` **bold** _it_ ~~no~~",
    "[link](javascript:alert(1)) ![x](y)",
    'x {: onclick="alert(1)" }',
    "&lt;script&gt; &amp; \\<b\\>",
    "# heading",
    "- <b>list</b>",
    r"\(x\) \[y\]",
    "名前 naïve 🙂",
)


def entry(name: str, track: str = "mine", file: str = "f" * 16, cell: str = "110") -> Entry:
    score, low, high = score_of({"c": cell})
    scored = TrackScore(
        file, True, score, low, high, len(cell), 3, 0.5, 0.1, 0.1, "0" * 16, "1" * 16, None, {"c": cell}
    )
    return Entry(SCHEMA, name, name, f"apo-bench score {name}", {"mujoco": "3"}, "", "machine", {track: scored})


def changed(**fields: object) -> dict[str, object]:
    form = to_builtins(entry("bad"))
    of_track = {key: value for key, value in fields.items() if key in form["tracks"]["mine"]}
    form["tracks"]["mine"] |= of_track
    return {**form, **{key: value for key, value in fields.items() if key not in of_track}}


BAD: dict[str, bytes] = {
    "a byte that is not UTF-8": json.dumps(changed(name="con@tact")).encode().replace(b"@", b"\xff"),
    "HTML in a hash": json.dumps(changed(code="<script>alert(1)</script>")).encode(),
    "more successes than executed plans": json.dumps(changed(executed=1)).encode(),
    "a name that turns the direction of text": json.dumps(changed(name="\u202etset")).encode(),
    "half a letter": json.dumps(changed(name="\ud800")).encode(),
    "no track": json.dumps(changed(tracks={})).encode(),
    "too large": b" " * 4_000_001,
}


@pytest.mark.parametrize("bad", BAD.values(), ids=BAD)
def test_a_file_that_is_not_an_entry_is_left_out_in_one_sentence_and_the_table_has_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], bad: bytes
) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    write_entry(entry("good"), folder / "good.json")
    (folder / "bad.json").write_bytes(bad)
    assert main(["leaderboard", str(folder), "--out", str(tmp_path / "page.md")]) == 0
    said = capsys.readouterr()
    assert said.err.startswith("left out: ")
    assert "bad.json" in said.err
    assert said.err.count("\n") == 1
    assert len(said.err) < 1600
    page = (tmp_path / "page.md").read_text()
    assert "| 1 | good |" in page
    assert "bad" not in page
    assert (tmp_path / "page.png").stat().st_size > 1000
    (folder / "good.json").unlink()
    assert main(["leaderboard", str(folder), "--out", str(tmp_path / "page.md")]) == 2
    assert "bad.json" in capsys.readouterr().err


class _Live(html.parser.HTMLParser):
    """Text of a page, its elements and their attributes."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.text = ""
        self.elements: set[str] = set()
        self.attributes: set[str] = set()
        self.feed(page)

    def handle_data(self, data: str) -> None:
        self.text += data

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.add(tag)
        self.attributes |= {name for name, _ in attrs}


def _commonmark(text: str) -> str:
    return MarkdownIt("commonmark", {"html": True}).enable(["table", "strikethrough"]).render(text)


def _python_markdown(text: str) -> str:
    markdown = pytest.importorskip("markdown")
    extensions = ["tables", "attr_list", "sane_lists", "toc", "pymdownx.arithmatex"]
    return str(
        markdown.markdown(text, extensions=extensions, extension_configs={"pymdownx.arithmatex": {"generic": True}})
    )


def page(folder: Path, name: str) -> str:
    folder.mkdir()
    write_entry(entry(name, track=name), folder / "e.json")
    assert main(["leaderboard", str(folder), "--out", str(folder / "page.md")]) == 0
    return (folder / "page.md").read_text()


@pytest.mark.parametrize("name", NAMES)
def test_names_mean_nothing_to_the_page_and_its_figure(tmp_path: Path, name: str) -> None:
    usual, unusual = (page(tmp_path / str(i), called) for i, called in enumerate(("usual", name)))
    for render in (_commonmark, _python_markdown):
        plain, live = _Live(render(usual)), _Live(render(unusual))
        assert live.elements == plain.elements
        assert live.attributes == plain.attributes
        assert live.text == plain.text.replace("usual", name)


def test_an_entry_of_another_version_of_a_track_is_left_out_and_the_many_stay(tmp_path: Path) -> None:
    write_entry(entry("alien", file="0" * 16), tmp_path / "a.json")
    for name in ("one", "two"):
        write_entry(entry(name), tmp_path / f"{name}.json")
    entries, left_out = read_entries(tmp_path)
    assert [e.name for e in entries] == ["one", "two"]
    assert len(left_out) == 1
    assert "a.json: the entry is of another version of the track mine" in left_out[0]
