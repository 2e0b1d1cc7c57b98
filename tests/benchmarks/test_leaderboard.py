"""The committed leaderboard is that of the committed entries, and marks of tracks are what the entries say."""

from __future__ import annotations

from pathlib import Path

from apo_bench.benchmark.scoring.track import read_track, track_names
from benchmarks.leaderboard import PAGE, README, entries, for_regression, in_readme, write_page


def test_the_page_and_the_readme_are_of_the_entries(tmp_path: Path) -> None:
    write_page(tmp_path / PAGE.name)
    assert (tmp_path / PAGE.name).read_text() == PAGE.read_text()
    assert in_readme(README.read_text()) == README.read_text()


def test_entries_are_of_the_tracks_as_they_are() -> None:
    for entry in entries():
        assert not entry.quick
        assert {name: score.track for name, score in entry.tracks.items()} == {
            name: read_track(name).hash for name in entry.tracks
        }


def test_tracks_that_tell_the_best_apart_no_more_do_not_count() -> None:
    marked = [name for name in track_names() if not read_track(name).overall]
    assert marked == list(for_regression(entries()))
