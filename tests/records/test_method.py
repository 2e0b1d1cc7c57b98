"""Names of methods: a plan, and whether the robot searches besides."""

import pytest

from apo_bench import InputError, SweepConfig, TrialConfig, load_scenario
from apo_bench.assembly import ReobservingCorrector
from apo_bench.benchmark.analysis import rank_method
from apo_bench.benchmark.sweeps.grid import units
from apo_bench.names import resolve
from apo_bench.records import CORRECTORS, knows_truth, may_reobserve, parse_method, probes, uses_contacts
from apo_bench.records.methods import checked_method


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
    assert parse_method(checked_method(name)) == (plan, spiral, probe)


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
        checked_method(name)


def test_one_method_has_one_name():
    assert TrialConfig("stick_in_tower", method="uncorrected+spiral").method == "spiral-search"
    assert SweepConfig(("stick_in_tower",), method=("spiral-search", "uncorrected+spiral", "uncorrected")).method == (
        "spiral-search",
        "uncorrected",
    )
    assert TrialConfig("stick_in_tower", method="uncorrected+probe").method == "uncorrected+probe"


def test_what_a_method_meets_is_that_of_its_plan():
    for robot in ("spiral", "probe"):
        methods = (f"oracle+{robot}", f"uncorrected+{robot}", f"paper+{robot}")
        assert [knows_truth(m) for m in methods] == [True, False, False]
        assert [uses_contacts(m) for m in methods] == [False, False, True]
    assert [probes(m) for m in ("paper+probe", "paper+spiral", "paper")] == [True, False, False]
    ranked = [
        "oracle",
        "oracle+probe",
        "uncorrected",
        "uncorrected+probe",
        "spiral-search",
        "contact",
        "contact+probe",
        "contact+spiral",
        "paper",
        "paper-track",
        "snap",
        "snap+spiral",
    ]
    assert sorted(ranked, key=lambda m: (rank_method(m), m)) == ranked


def test_an_oracle_that_searches_runs_once_per_seed():
    grid = SweepConfig(
        ("stick_in_tower",),
        (0.0, 1.0),
        method=("oracle+spiral", "spiral-search"),
        trials=1,
        contact_source=("false-negative",),
    )
    trials = [t for unit in units([grid], {"stick_in_tower": load_scenario("stick_in_tower")}) for t in unit]
    asked = [(t.method, t.noise_mm, t.human_error_scale, t.contact_source) for t in trials]
    assert asked.count(("oracle+spiral", 0.0, 0.0, "given")) == 1
    assert sorted(set(asked)) == sorted(asked)
    assert len(asked) == 5


def test_what_a_robot_that_feels_is_given_is_nothing_to_others():
    grid = SweepConfig(
        ("stick_in_tower",),
        (1.0,),
        (1.0,),
        method=("oracle+probe", "oracle", "contact+probe", "contact"),
        trials=1,
        ft_sensor=("joint-torque", "wrist"),
        assumed_robot_error=("unknown", "tool:1.0"),
    )
    trials = [t for unit in units([grid], {"stick_in_tower": load_scenario("stick_in_tower")}) for t in unit]
    given = {(t.method, t.ft_sensor, t.assumed_robot_error) for t in trials}
    both = {(ft_sensor, stated) for ft_sensor in ("joint-torque", "wrist") for stated in ("unknown", "tool:1")}
    assert len(trials) == len(given) == 10
    for plan in ("oracle", "contact"):
        assert {(ft_sensor, stated) for method, ft_sensor, stated in given if method == f"{plan}+probe"} == both
        assert (plan, "wrist", "matched") in given


def test_methods_that_may_look_are_those_that_can_ask():
    for name in CORRECTORS:
        assert may_reobserve(name) == isinstance(resolve(name, CORRECTORS, "corrector"), ReobservingCorrector)
    assert may_reobserve("contact-robust+spiral")
    assert may_reobserve("mine:correct")
    assert not any(map(may_reobserve, ("oracle", "uncorrected", "spiral-search")))
