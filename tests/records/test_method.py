"""Names of methods: a plan, and whether the robot searches besides."""

import pytest

from apo_bench import InputError, SweepSettings, TrialSettings, load_scenario
from apo_bench.assembly import LookingCorrector
from apo_bench.names import resolve
from apo_bench.records import CORRECTORS, knows_relations, knows_truth, may_look, parsed
from apo_bench.records.method import checked_method
from apo_bench.statistics import rank
from apo_bench.sweeps.grid import units


@pytest.mark.parametrize(
    ("name", "plan", "searches"),
    [
        ("search", "none", True),
        ("none+search", "none", True),
        ("none", "none", False),
        ("contact+search", "contact", True),
        ("oracle+search", "oracle", True),
        ("mine:correct+search", "mine:correct", True),
        ("mine:search", "mine:search", False),
    ],
)
def test_a_name_has_two_parts(name, plan, searches):
    assert parsed(checked_method(name)) == (plan, searches)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("search+search", "said once"),
        ("contact+search+search", "said once"),
        ("mine:correct+search+search", "said once"),
        ("foo+search", "unknown method 'foo'"),
        ("none+", r"unknown method 'none\+'; did you mean 'none'\?"),
        ("+search", r"unknown method '\+search'; did you mean 'search'\?"),
        ("search+contact", "unknown method"),
        ("contact+searchh", "unknown method"),
        ("", "unknown method ''"),
    ],
)
def test_a_wrong_name_is_refused(name, said):
    with pytest.raises(InputError, match=said):
        checked_method(name)


def test_one_method_has_one_name():
    assert TrialSettings("stick_in_tower", method="none+search").method == "search"
    assert SweepSettings(("stick_in_tower",), methods=("search", "none+search", "none")).methods == ("search", "none")


def test_what_a_method_meets_is_that_of_its_plan():
    assert [knows_truth(m) for m in ("oracle+search", "search", "paper+search")] == [True, False, False]
    assert [knows_relations(m) for m in ("oracle+search", "search", "paper+search")] == [False, False, True]
    ranked = ["oracle", "none", "search", "contact", "contact+search", "paper", "paper-track", "snap", "snap+search"]
    assert sorted(ranked, key=lambda m: (rank(m), m)) == ranked


def test_an_oracle_that_searches_runs_once_per_seed():
    grid = SweepSettings(
        ("stick_in_tower",), (0.0, 1.0), methods=("oracle+search", "search"), trials=1, relations=("missed",)
    )
    trials = [t for unit in units([grid], {"stick_in_tower": load_scenario("stick_in_tower")}) for t in unit.trials]
    asked = [(t.method, t.level_mm, t.careless, t.relations) for t in trials]
    assert asked.count(("oracle+search", 0.0, 0.0, "given")) == 1
    assert sorted(set(asked)) == sorted(asked)
    assert len(asked) == 5


def test_methods_that_may_look_are_those_that_can_ask():
    for name in CORRECTORS:
        assert may_look(name) == isinstance(resolve(name, CORRECTORS, "corrector"), LookingCorrector)
    assert may_look("contact-robust+search")
    assert not any(map(may_look, ("oracle", "none", "search", "mine:correct")))
