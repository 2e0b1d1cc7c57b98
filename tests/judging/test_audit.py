"""The audit of the judge: what it says of states whose verdict a person gave before."""

from __future__ import annotations

import numpy as np
import pytest

from apo_bench.geometry import find_revolution, find_symmetries, pose
from tests import audited_more_rounds, audited_rounds, audited_wholes, rounds, scenes
from tests.audited_states import DIFFERS as FLAT_DIFFERS
from tests.audited_states import LOOSE, Loose, Seen
from tests.audited_states import STATES as FLAT_STATES
from tests.end_states import END, Edit, moved, shift, verdict

NUDGED = [*audited_wholes.STATES, *audited_more_rounds.STATES]
STATES = [*FLAT_STATES, *audited_rounds.STATES, *NUDGED]
DIFFERS = {**FLAT_DIFFERS, **audited_rounds.DIFFERS, **audited_wholes.DIFFERS, **audited_more_rounds.DIFFERS}


@pytest.mark.parametrize("seen", STATES, ids=lambda seen: seen.what)
def test_a_person_says_the_same_unless_the_rule_says_otherwise(seen: Seen) -> None:
    assert verdict(seen.scene(), seen.edits).success == (seen.right != (seen.what in DIFFERS))


@pytest.mark.parametrize("seen", LOOSE, ids=lambda seen: seen.what)
def test_a_person_says_nearly(seen: Loose) -> None:
    found = verdict(seen.scene(), seen.edits)
    assert (found.success, found.loose_success) == (False, seen.nearly)


@pytest.mark.parametrize("name", ["stick_in_tower", "subassembly_on_castles", "pockets"])
def test_symmetries_and_the_place_on_the_table_do_not_matter(name: str) -> None:
    """Every part put in by any of its symmetries, all of it elsewhere, turned by up to 40 degrees."""
    rng = np.random.default_rng(7)
    scene = scenes.ALL[name]()
    for _ in range(4):
        loose = scene.assembly.solids.keys() - scene.assembly.fixed
        edits = [turned(part, rng.choice(find_symmetries(scene.assembly.solids[part]))) for part in sorted(loose)]
        if name != "pockets":
            x, y, turn = rng.uniform([-200, -200, -40], [200, 200, 40])
            edits.append(moved(1, scenes.mm(x, y, 0, (0, 0, turn))))
        found = verdict(scene, edits)
        assert (found.success, found.finished.why) == (True, "")


def turned(part: str, g: np.ndarray) -> Edit:
    """The part is turned, from the beginning."""

    def edit(states: list[dict]) -> None:
        for state in states:
            state[part] = state[part] @ g

    return edit


@pytest.mark.parametrize("name", ["nested", "in_groove", "countersink"])
def test_a_part_of_revolution_is_the_same_after_any_turn_about_its_axis(name: str) -> None:
    """Turned anyhow when it was put, and again at the end; all of it elsewhere."""
    rng = np.random.default_rng(11)
    scene = rounds.ALL[name]()
    round_ones = [part for part, solid in scene.assembly.solids.items() if find_revolution(solid) is not None]
    for _ in range(3):
        edits = [turned(part, pose.at((0, 0, 0), (0, 0, rng.uniform(-180, 180)))) for part in round_ones]
        edits += [shift(part, END, 0, 0, 0, (0, 0, rng.uniform(-180, 180))) for part in round_ones]
        x, y, turn = rng.uniform([-100, -100, -40], [100, 100, 40])
        found = verdict(scene, [*edits, moved(1, scenes.mm(x, y, 0, (0, 0, turn)))])
        assert (found.success, found.finished.why) == (True, "")
