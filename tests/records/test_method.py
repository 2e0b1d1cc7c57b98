"""Names of methods: a plan, and whether the robot searches besides."""

import pytest

from apo_bench import InputError
from apo_bench.assembly import ReobservingCorrector
from apo_bench.benchmark.analysis import rank_method
from apo_bench.names import resolve
from apo_bench.records import CORRECTORS, knows_truth, may_reobserve, parse_method, probes, uses_contacts
from apo_bench.records.methods import check_method


@pytest.mark.parametrize(
    ("name", "plan", "spiral", "probe"),
    [
        ("spiral-search", "uncorrected", True, False),
        ("uncorrected+probe", "uncorrected", True, True),
        ("contact+probe", "contact", True, True),
        ("mine:correct+probe", "mine:correct", True, True),
        ("mine:search", "mine:search", False, False),
    ],
)
def test_a_name_has_a_plan_and_what_the_robot_does_besides(name, plan, spiral, probe):
    assert parse_method(check_method(name)) == (plan, spiral, probe)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("contact+spiral+spiral", "use one of .spiral and .probe, which includes it, once"),
        ("foo+probe", "unknown method 'foo'"),
        ("+spiral", r"unknown method '\+spiral'; did you mean 'spiral-search'\?"),
    ],
)
def test_a_wrong_name_is_refused(name, said):
    with pytest.raises(InputError, match=said):
        check_method(name)


def test_what_a_method_meets_is_that_of_its_plan():
    for robot in ("spiral", "probe"):
        methods = (f"oracle+{robot}", f"uncorrected+{robot}", f"paper+{robot}")
        assert [knows_truth(m) for m in methods] == [True, False, False]
        assert [uses_contacts(m) for m in methods] == [False, False, True]
    assert [probes(m) for m in ("paper+probe", "paper+spiral", "paper")] == [True, False, False]
    ranked = [
        *("oracle", "oracle+probe", "uncorrected", "uncorrected+probe", "spiral-search"),
        *("contact", "contact+probe", "contact+spiral", "paper", "paper-track", "snap", "snap+spiral"),
    ]
    assert sorted(ranked, key=lambda m: (rank_method(m), m)) == ranked


def test_methods_that_may_look_are_those_that_can_ask():
    for name in CORRECTORS:
        assert may_reobserve(name) == isinstance(resolve(name, CORRECTORS, "corrector"), ReobservingCorrector)
    assert may_reobserve("contact-robust+spiral")
    assert may_reobserve("mine:correct")
    assert not any(map(may_reobserve, ("oracle", "uncorrected", "spiral-search")))
