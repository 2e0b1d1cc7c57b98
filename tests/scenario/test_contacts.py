"""Kinds of contact in scenario files: what is asked reaches the corrector, and what makes no sense is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from apo_bench import InputError, Observation, Scenario, correct, load_scenario
from apo_bench.assembly import Contact, Gap, PartFace
from apo_bench.resources import folder

SLOTS = (folder("scenarios") / "stick_on_castles.toml").read_text(encoding="utf-8")
PAIR = '["py", "castle1.spy"]'
WALLS = '{ faces = ["py", "castle1.spy"], kind = "clearance" }'
FLOOR = '["bottom", "table.top"]'
SPY = Contact(PartFace("stick", "py"), PartFace("castle1", "spy"))


def load(tmp_path: Path, *changes: tuple[str, str]) -> Scenario:
    text = SLOTS
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return load_scenario(path)


def seen(scenario: Scenario, goals: np.ndarray | None = None) -> Observation:
    n = len(scenario.assembly)
    covariance = np.tile(np.diag(np.repeat([1e-3, np.radians(1.0)], 3) ** 2), (n, 1, 1))
    goals = scenario.nominal_poses if goals is None else goals
    play_m = 1e-3 * scenario.clearance_mm
    return Observation(scenario.assembly, scenario.start, goals, covariance, np.ones(n, dtype=np.bool_), 1e-4, play_m)


@pytest.mark.parametrize(
    ("given", "asked", "interval_mm"),
    [
        (PAIR, Gap(), (0.0, 0.0)),
        ('{ faces = ["py", "castle1.spy"], kind = "contact" }', Gap("contact"), (-0.25, -0.25)),
        (WALLS, Gap("clearance"), (-0.25, 0.25)),
        (
            '{ faces = ["py", "castle1.spy"], kind = "clearance", gap_mm = [-0.1, 0.3] }',
            Gap("clearance", -1e-4, 3e-4),
            (-0.1, 0.3),
        ),
    ],
)
def test_the_kinds(given: str, asked: Gap, interval_mm: tuple[float, float], tmp_path: Path) -> None:
    scenario = load(tmp_path, (PAIR, given))
    plain = load_scenario("stick_on_castles")
    assert scenario.assembly.operations == plain.assembly.operations
    found = scenario.assembly.gaps.get(SPY, Gap())
    assert found.kind == asked.kind
    assert found[1:] == pytest.approx(asked[1:])
    assert set(scenario.assembly.gaps) == (set() if asked == Gap() else {SPY})
    assert scenario.assembly.interval(SPY, 0.25e-3) == pytest.approx(tuple(1e-3 * x for x in interval_mm))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (PAIR, "3", ["operation 3, contact 2: a table of named keys or a list is needed"]),
        (PAIR, WALLS.replace("spy", "spz"), ["contact 2, second", "face of part 'castle1'"]),
        (PAIR, WALLS.replace(" }", ", gap_mm = [0.1, 0.2] }"), ["gap_mm", "up to 0"]),
        (PAIR, WALLS.replace(" }", ", gap_mm = [0, 0] }"), ["gap_mm", "a higher one from 0"]),
        (FLOOR, '{ faces = ["bottom", "table.top"], kind = "clearance" }', ["without play", "say gap_mm"]),
        (PAIR, f"{PAIR}, {WALLS}", ["contact 3", "stands here twice"]),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_sentence(old: str, new: str, words: list[str], tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        load(tmp_path, (old, new))
    message = str(error.value)
    assert "\n" not in message
    assert message.startswith(str(tmp_path / "mine.toml"))
    assert message.endswith(".")
    for word in words:
        assert word in message


def test_a_contact_that_is_made_twice_has_one_kind(tmp_path: Path) -> None:
    """Example 5.3: the cube stands on the table before and after castle 2 is pushed against it."""
    text = (folder("scenarios") / "vanished_fixture.toml").read_text(encoding="utf-8")
    pair = '["nz", "table.top"]'
    path = tmp_path / "mine.toml"
    assert text.count(pair) == 2
    loose = f'{{ faces = {pair}, kind = "clearance", gap_mm = [-1, 1] }}'
    path.write_text(text.replace(pair, loose, 1), encoding="utf-8")
    with pytest.raises(InputError) as error:
        load_scenario(path)
    assert (
        "operation 4, contacts: 'cube.nz on table.top' is to be centred here and clearance from -1 to 1 mm in "
        "operation 2; state the same in both."
    ) in str(error.value)
    path.write_text(text.replace(pair, loose), encoding="utf-8")
    assert list(load_scenario(path).assembly.gaps.values()) == [Gap("clearance", -1e-3, 1e-3)]


def test_the_corrector_stays_within_the_walls_of_the_file(tmp_path: Path) -> None:
    """Seen 1 mm aside, the stick comes to the nearer wall, not to the middle."""
    both = (PAIR, WALLS), ('["ny", "castle1.sny"]', WALLS.replace("py", "ny"))
    second = (
        ('["py", "castle2.spy"]', WALLS.replace("castle1", "castle2")),
        ('["ny", "castle2.sny"]', WALLS.replace("py", "ny").replace("castle1", "castle2")),
    )
    scenario = load(tmp_path, *both, *second)
    assert len(scenario.assembly.gaps) == 4
    goals = np.array(scenario.nominal_poses)
    goals[2, 1, 3] += 1e-3
    made = correct(seen(scenario, goals), "contact")
    assert made.ok, made.sentence
    aside = made.poses[2, 1, 3] - made.poses[:2, 1, 3]
    np.testing.assert_allclose(aside, 0.25e-3, atol=1e-9)
