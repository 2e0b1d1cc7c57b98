"""Names of methods: a plan, and whether the robot searches besides."""

import pytest

from apo_bench import InputError, SweepSettings, TrialSettings, load_scenario
from apo_bench.assembly import LookingCorrector
from apo_bench.benchmark.analysis import rank
from apo_bench.benchmark.sweeps.grid import units
from apo_bench.names import resolve
from apo_bench.records import CORRECTORS, feels, knows_relations, knows_truth, may_look, parsed
from apo_bench.records.short_names import checked_method


@pytest.mark.parametrize(
    ("name", "plan", "searches", "by_touch"),
    [
        ("search", "none", True, False),
        ("none+feel", "none", True, True),
        ("contact+feel", "contact", True, True),
        ("mine:correct+feel", "mine:correct", True, True),
        ("mine:search", "mine:search", False, False),
    ],
)
def test_a_name_has_a_plan_and_what_the_robot_does_besides(name, plan, searches, by_touch):
    assert parsed(checked_method(name)) == (plan, searches, by_touch)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("contact+search+search", "said once"),
        (
            "contact+search+feel",
            "'contact.search.feel' was given; one of .search and .feel, which searches too, is said",
        ),
        ("foo+feel", "unknown method 'foo'"),
        ("+search", r"unknown method '\+search'; did you mean 'search'\?"),
        ("contact+searchh", "unknown method"),
    ],
)
def test_a_wrong_name_is_refused(name, said):
    with pytest.raises(InputError, match=said):
        checked_method(name)


def test_one_method_has_one_name():
    assert TrialSettings("stick_in_tower", method="none+search").method == "search"
    assert SweepSettings(("stick_in_tower",), methods=("search", "none+search", "none")).methods == ("search", "none")
    assert TrialSettings("stick_in_tower", method="none+feel").method == "none+feel"


def test_what_a_method_meets_is_that_of_its_plan():
    for robot in ("search", "feel"):
        methods = (f"oracle+{robot}", f"none+{robot}", f"paper+{robot}")
        assert [knows_truth(m) for m in methods] == [True, False, False]
        assert [knows_relations(m) for m in methods] == [False, False, True]
    assert [feels(m) for m in ("paper+feel", "paper+search", "paper")] == [True, False, False]
    ranked = [
        "oracle",
        "oracle+feel",
        "none",
        "none+feel",
        "search",
        "contact",
        "contact+feel",
        "contact+search",
        "paper",
        "paper-track",
        "snap",
        "snap+search",
    ]
    assert sorted(ranked, key=lambda m: (rank(m), m)) == ranked


def test_an_oracle_that_searches_runs_once_per_seed():
    grid = SweepSettings(
        ("stick_in_tower",), (0.0, 1.0), methods=("oracle+search", "search"), trials=1, relations=("missed",)
    )
    trials = [t for unit in units([grid], {"stick_in_tower": load_scenario("stick_in_tower")}) for t in unit]
    asked = [(t.method, t.level_mm, t.careless, t.relations) for t in trials]
    assert asked.count(("oracle+search", 0.0, 0.0, "given")) == 1
    assert sorted(set(asked)) == sorted(asked)
    assert len(asked) == 5


def test_what_a_robot_that_feels_is_given_is_nothing_to_others():
    grid = SweepSettings(
        ("stick_in_tower",),
        (1.0,),
        (1.0,),
        methods=("oracle+feel", "oracle", "contact+feel", "contact"),
        trials=1,
        wrenches=("cobot", "external"),
        stated_errors=("unstated", "tool:1.0"),
    )
    trials = [t for unit in units([grid], {"stick_in_tower": load_scenario("stick_in_tower")}) for t in unit]
    given = {(t.method, t.wrench, t.stated_error) for t in trials}
    both = {(wrench, stated) for wrench in ("cobot", "external") for stated in ("unstated", "tool:1")}
    assert len(trials) == len(given) == 10
    for plan in ("oracle", "contact"):
        assert {(wrench, stated) for method, wrench, stated in given if method == f"{plan}+feel"} == both
        assert (plan, "external", "drawn") in given


def test_methods_that_may_look_are_those_that_can_ask():
    for name in CORRECTORS:
        assert may_look(name) == isinstance(resolve(name, CORRECTORS, "corrector"), LookingCorrector)
    assert may_look("contact-robust+search")
    assert may_look("mine:correct")
    assert not any(map(may_look, ("oracle", "none", "search")))
