"""What is refused at the door of the correctors, and that the sentence blames what is wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from apo_bench import Correction, InputError, Observation, correct, correct_many
from apo_bench.assembly import measure_largest_gap
from apo_bench.correction.contact.contact import contact
from apo_bench.geometry import Array
from tests import scenes

pytestmark = pytest.mark.numeric


def seen(seed: int = 0) -> Observation:
    built = scenes.stick_in_tower()
    return scenes.seen(built, scenes.noisy(built.nominal_poses, np.random.default_rng(seed), 2.0, 1.0))


def edited(name: str, change: Callable[[Array], None]) -> Observation:
    one = seen()
    array = np.array(getattr(one, name))
    change(array)
    changed: dict[str, Any] = {name: array}
    return replace(one, **changed)


def stretched(goals: Array) -> None:
    goals[1, :3, :3] *= 1.3


def far(goals: Array) -> None:
    goals[0, 0, 3] = 1e200


def lopsided(covariance: Array) -> None:
    covariance[1, 0, 1] = 0.9 * covariance[1, 0, 0]


WRONG: dict[str, tuple[Callable[[], Any], str]] = {
    "stretched": (lambda: edited("poses", stretched), "the pose of operation 2 in the observation is not a rigid pose"),
    "far": (lambda: edited("poses", far), "the pose of operation 1 in the observation has a position of 1e+200 m"),
    "lopsided": (
        lambda: edited("covariance", lopsided),
        "the covariance of operation 2 in the observation is not symm",
    ),
    "play nan": (lambda: replace(seen(), play_m=float("nan")), "states play_m=nan; give a finite length of 0 or more"),
    "gap zero": (lambda: replace(seen(), gap_m=0.0), "states gap_m=0.0"),
    "no start": (lambda: replace(seen(), start={}), "the observation has no start of the part"),
}


@pytest.mark.parametrize("case", WRONG)
@pytest.mark.parametrize("corrector", ["contact", lambda seen: seen.poses])
def test_an_observation_that_makes_no_sense_is_blamed_itself(case: str, corrector: Any) -> None:
    make, message = WRONG[case]
    with pytest.raises(InputError) as refused:
        correct(make(), corrector)
    assert message in str(refused.value)
    assert "the corrector" not in str(refused.value)
    assert "\n" not in str(refused.value)


def test_many_needs_a_list_and_a_corrector() -> None:
    for given in (seen(), None, [seen(), None]):
        with pytest.raises(InputError, match=r"correct_many must be a list \(each entry an Observation\)"):
            correct_many(given)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="unknown corrector 'papers'"):
        correct_many([seen()], "papers")
    with pytest.raises(InputError, match="the pose of operation 2 in observation 2 is not a rigid pose"):
        correct_many([seen(), edited("poses", stretched)])


def lying(seen: Observation, **changed: Any) -> Correction:
    made = Correction(seen.poses, "converged", "all is well", (), 0.0, 0.0, 0)
    return replace(made, **changed)


def test_the_gaps_that_a_corrector_claims_are_measured() -> None:
    one = seen()
    open_m = measure_largest_gap(one.assembly, one.start, one.poses)
    assert open_m > 1e-3
    for claimed in (0.0, float("nan"), -1.0):
        made = correct(one, lambda seen, claimed=claimed: lying(seen, gap_after_m=claimed))
        assert (made.gap_before_m, made.gap_after_m) == (open_m, open_m)
    wrapped = correct(one, lambda seen: contact(seen))
    own = correct(one, "contact")
    claimed_m = (own.gap_before_m, own.gap_after_m)
    measured_m = (wrapped.gap_before_m, wrapped.gap_after_m)
    assert measured_m == pytest.approx(claimed_m, rel=0, abs=1e-15)  # compiled and not: rounding
