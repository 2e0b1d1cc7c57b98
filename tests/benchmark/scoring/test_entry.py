"""Entries: what is counted, what is refused, and how a table is made of them."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from apo_bench import InputError
from apo_bench.benchmark.scoring.entry import (
    SCHEMA,
    Entry,
    TrackScore,
    compare_entries,
    read_entry,
    score_of,
    write_entry,
)
from apo_bench.benchmark.scoring.leaderboard import leaderboard_table, ranked


def track(overall: bool = True, secret_seed: str | None = None, file: str = "f" * 16, **cells: str) -> TrackScore:
    counted = "".join(cells.values()).replace("x", "")
    value, low, high = score_of(cells)
    return TrackScore(
        track=file,
        overall=overall,
        score=value,
        low=low,
        high=high,
        trials=len(counted),
        executed=len(counted),
        predicted_success=None,
        brier=None,
        reliability=None,
        records="0" * 16,
        code="1" * 16,
        secret_seed=secret_seed,
        conditions=cells,
    )


def entry(name: str, **tracks: TrackScore) -> Entry:
    return Entry(SCHEMA, name, name, f"apo-bench score {name}", {"mujoco": "3"}, "", "machine", tracks)


def test_a_score_is_the_mean_over_cells_whatever_trials_count() -> None:
    assert score_of({"a": "1111", "b": "10xx"})[0] == pytest.approx(75.0)
    assert score_of({"a": "11", "b": "xx"})[0] == 100.0
    assert score_of({}) == (0.0, 0.0, 100.0)


def test_tracks_that_do_not_count_are_left_out_of_the_score_over_all() -> None:
    both = entry("m", given=track(a="10"), easy=track(overall=False, a="11"))
    overall = both.overall
    assert overall is not None
    assert overall == pytest.approx(score_of({"a": "10"}))
    assert entry("m", easy=track(overall=False, a="11")).overall is None


@settings(deadline=None)
@given(st.dictionaries(st.text("ab|", min_size=1), st.text("10x", min_size=1), min_size=1))
def test_what_is_written_is_read(cells: dict[str, str]) -> None:
    first = entry("m", given=replace(track(c="1"), **_of(cells)))
    with tempfile.TemporaryDirectory() as folder:
        write_entry(first, Path(folder) / "e.json")
        assert read_entry(Path(folder) / "e.json") == first


def _of(cells: dict[str, str]) -> dict[str, object]:
    named: Any = {f"c{i}": trials for i, trials in enumerate(cells.values())}
    made = track(**named)
    names = ("score", "low", "high", "trials", "executed")
    return {**{name: getattr(made, name) for name in names}, "conditions": cells}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"score": 99.0}, "the score 99 "),
        ({"executed": 0}, "0 of them executed, are stated, and its conditions have 2 with 1 successes"),
        ({"conditions": {"a": "1?"}}, "matching regex"),
        ({"low": -1.0}, ">= 0.0"),
        ({"rank": 1}, "unknown field"),
    ],
)
def test_a_score_by_hand_is_refused(tmp_path: Path, change: dict[str, object], said: str) -> None:
    write_entry(entry("m", given=track(a="10")), tmp_path / "e.json")
    form = json.loads((tmp_path / "e.json").read_text())
    form["tracks"]["given"] |= change
    (tmp_path / "e.json").write_text(json.dumps(form))
    with pytest.raises(InputError, match=said):
        read_entry(tmp_path / "e.json")


def test_the_best_stands_first() -> None:
    lines = ranked([entry("low", given=track(a="1000000000")), entry("high", given=track(a="1111111111", b="11"))])
    assert [line.entry.name for line in lines] == ["high", "low"]
    assert [line.place for line in lines] == [1, 2]


def test_a_difference_is_over_the_trials_of_both_and_agrees_with_the_scores() -> None:
    ours, theirs = (
        entry(name, given=track(a=a, b=b)) for name, a, b in (("m", "110x", "1111"), ("contact", "1000", "1x11"))
    )
    (found,) = compare_entries(ours, theirs).values()
    assert found.value == pytest.approx(100 * (1 / 3 + 0) / 2)
    line, reference = ranked([ours, theirs])
    assert line.difference is not None
    assert line.difference.interval == pytest.approx(found.interval)
    assert line.p == pytest.approx(found.p)
    assert reference.difference is None
    other = entry("m", given=track(file="e" * 16, a="1"))
    assert compare_entries(other, theirs) == {}


def test_p_values_are_adjusted_for_all_comparisons_with_the_reference() -> None:
    reference = entry("contact", given=track(a="0" * 20 + "1" * 20))
    better = [entry(f"m{i}", given=track(a="0" * 12 + "1" * 28)) for i in range(3)]
    (raw,) = compare_entries(better[0], reference).values()
    lines = ranked([reference, *better])
    assert [line.p for line in lines if line.p is not None] == pytest.approx([3 * raw.p] * 3)


def test_an_entry_without_all_tracks_has_no_score_and_stands_last() -> None:
    whole = entry("whole", given=track(a="10"), tight=track(a="10"))
    lines = ranked([entry("part", given=track(a="11")), whole])
    assert [(line.entry.name, line.score is None) for line in lines] == [("whole", False), ("part", True)]
    assert len(leaderboard_table(lines).items) == 1


def test_verified_is_who_was_run_with_a_salt_of_the_organiser_in_every_track() -> None:
    secret_seed = "5" * 16
    salted = entry("salted", given=track(a="1", secret_seed=secret_seed), tight=track(a="1", secret_seed=secret_seed))
    half = entry("half", given=track(a="1", secret_seed=secret_seed), tight=track(a="1"))
    told = {line.entry.name: line.status for line in ranked([salted, half], frozenset({secret_seed}))}
    assert told == {"salted": "verified, few trials", "half": "self-reported, few trials"}
    assert {line.status for line in ranked([salted, half])} == {"self-reported, few trials"}
