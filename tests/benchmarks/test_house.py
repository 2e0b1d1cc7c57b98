"""The numbers of the plan: counted right on a plan that can be counted by hand."""

from __future__ import annotations

from pathlib import Path

from benchmarks.house import arrows_of, floors, in_cycles, public

PLAN = {"cli": {"trial", "show"}, "show": {"trial"}, "trial": {"a"}, "a": {"b"}, "b": {"a"}}


def test_rooms_of_one_cycle_stand_on_one_floor() -> None:
    assert in_cycles(PLAN) == {"a", "b"}
    assert floors(PLAN) == 4
    assert floors({"alone": set()}) == 1


def test_public_names_are_what_a_module_defines_without_an_underscore() -> None:
    text = "from x import y\nA, _B = 1, 2\nC: int = 3\ndef f(): z = 1\ndef _g(): pass\nclass D: pass\n"
    assert sorted(public(text, Path("m.py"))) == ["A", "C", "D", "f"]


def test_arrows_of_the_package_never_lead_back() -> None:
    arrows = arrows_of(Path(__file__).parents[2])
    assert "simulation" not in arrows["correction"]
    assert "trial" in arrows["envs"]
    assert in_cycles(arrows) == set()
