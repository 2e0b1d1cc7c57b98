"""The committed leaderboard is that of the committed entries, which are of the tracks as they are."""

from __future__ import annotations

from pathlib import Path

from apo_bench.benchmark.scoring.track import read_track
from benchmarks.leaderboard import PAGE, README, entries, in_readme, write_page


def test_the_page_and_the_readme_are_of_the_entries(tmp_path: Path) -> None:
    write_page(tmp_path / PAGE.name)
    assert (tmp_path / PAGE.name).read_text() == PAGE.read_text()
    assert in_readme(README.read_text()) == README.read_text()


def test_entries_are_of_the_tracks_as_they_are() -> None:
    for entry in entries():
        assert {name: score.track for name, score in entry.tracks.items()} == {
            name: read_track(name).hash for name in entry.tracks
        }
