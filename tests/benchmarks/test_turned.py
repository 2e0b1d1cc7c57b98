"""What was seen turned: no corrector of the package calls goals right at which faces look the same way."""

from dataclasses import replace

import numpy as np

from apo_bench import correct
from apo_bench.geometry import pose
from apo_bench.records import CORRECTORS
from benchmarks.turned import OURS, SEED, faces_oppose, of_boxes, scenario_of, turned


def test_every_corrector_of_the_package_is_asked():
    """`contact-fast` is another name of `contact`, and `learned-set` is `contact-robust` of what a network leaves: it
    is asked below, and has no line in the table."""
    assert set(OURS) == set(CORRECTORS) - {"contact-fast", "learned-set"}


def test_nothing_converges_with_faces_that_look_the_same_way():
    names = of_boxes()
    asked = (*OURS, "learned-set")
    ended = []
    for i in range(2 * len(asked)):
        layout, seen = turned(scenario_of(names[i % len(names)]), np.random.default_rng([SEED, 10_000 + i]))
        made = correct(seen, asked[i // 2])
        ended.append(made.ok)
        assert not made.ok or faces_oppose(seen.assembly, layout, made)
    assert any(ended)
    assert not all(ended)


def test_faces_are_looked_at_in_the_world():
    layout, seen = turned(scenario_of("bridge_cycle"), np.random.default_rng(0))
    made = correct(replace(seen, goals=layout.goals))
    assert faces_oppose(seen.assembly, layout, made)
    goals = np.array(made.goals)
    goals[2] = goals[2] @ pose.at((0.0, 0.0, 0.0), (180.0, 0.0, 0.0))
    assert not faces_oppose(seen.assembly, layout, replace(made, goals=goals))
    without = replace(made, goals=goals, dropped=("R4", "R5"))
    assert faces_oppose(seen.assembly, layout, without)
