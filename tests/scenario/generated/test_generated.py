"""Generated assemblies: the same seed draws the same, what it draws is whole, and its contacts are those that touch."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench import Scenario, load_scenario
from apo_bench.assembly import compute_placements
from apo_bench.errors import InputError
from apo_bench.importers.assembly.contact_search import find_contacts
from apo_bench.scenario import find_scenario_path, list_nominal_operations
from apo_bench.scenario.generated import FAMILIES, complete_name, generate_assembly, write_generated
from apo_bench.scenario.parts import load_part

SMALL = (
    "generated:corners:2",
    "generated:pegs:11",
    "generated:posts:0",
    "generated:covers:15",
    "generated:carried:2",
    "generated:pinned:5",
    "generated:bridges:2",
    "generated:keys:0",
    "generated:grooves:2",
    "generated:castles:2",
    "generated:rods:0",
)
"""One with few parts of every family but `mixed`, which has stations of these."""
seeds = st.integers(0, 10**15 - 1)


@pytest.fixture(params=SMALL, scope="module")
def scenario(request: pytest.FixtureRequest) -> Scenario:
    return load_scenario(request.param)


@settings(max_examples=20, deadline=None)
@given(st.sampled_from([*FAMILIES]), seeds)
def test_an_assembly_is_whole(family: str, seed: int) -> None:
    """As many parts as its family may have; all but the fixed ones are moved, onto what is there, by unique names."""
    made, _ = generate_assembly(f"generated:{family}:{seed}")
    low, high = FAMILIES[family].sizes
    assert low <= len(made.parts) <= high
    there = {*made.fixed}
    for act in made.acts:
        there |= {act.part}
        assert {other.partition(".")[0] for _, other in act.contacts} <= there
        assert {*act.carries} <= there
    assert there == {*made.parts}


@given(seeds)
@settings(max_examples=50)
def test_a_plain_seed_names_one_of_a_family_that_is_not_held_out(seed: int) -> None:
    name = complete_name(f"generated:{seed}")
    assert complete_name(name) == name
    assert FAMILIES[name.split(":")[1]].weight > 0


@pytest.mark.parametrize("name", ["generated:5", "generated:grooves:12345678901234"])
def test_the_same_seed_gives_the_same_bytes(name: str, tmp_path: Path) -> None:
    folders = [tmp_path / each for each in ("first", "again")]
    for folder in folders:
        folder.mkdir()
        write_generated(name, folder)
    first, again = ({path.name: path.read_bytes() for path in folder.iterdir()} for folder in folders)
    assert first == again


def test_ways_are_free(scenario: Scenario) -> None:
    assert all(each.after.free for each in list_nominal_operations(scenario))


def test_its_contacts_are_those_that_touch(scenario: Scenario) -> None:
    """Those that stand at the end are what `drafting` finds there."""
    assembly = scenario.assembly
    end = compute_placements(assembly, scenario.start, scenario.nominal_poses)[-1]
    said = {frozenset(each.contact) for each in assembly.relations() if each.lost is None}
    touching = {frozenset(contact) for contact in find_contacts(assembly.solids, end)}
    assert said == {pair for pair in touching if not {each.part for each in pair} <= assembly.fixed}


@pytest.mark.parametrize("name", ["generated:grooves:2", "generated:rods:0", "generated:rods:2", "generated:castles:2"])
def test_parts_are_as_their_files_say(name: str) -> None:
    """The loader leaves out this check of parts that it has just written."""
    for path in find_scenario_path(name).parent.glob("*.xml"):
        load_part(path)


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("generated:", "is not of the form generated:SEED or generated:FAMILY:SEED"),
        ("generated:-1", "is not of the form"),
    ],
)
def test_a_name_that_is_none_gets_one_sentence(name: str, sentence: str) -> None:
    with pytest.raises(InputError, match=r"^[^\n]*$") as caught:
        load_scenario(name)
    assert sentence in str(caught.value)
