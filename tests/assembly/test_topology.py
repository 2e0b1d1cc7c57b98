"""Operation dependency lists: the strings of the paper, and the product law."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from apo_bench import Assembly
from apo_bench.assembly import Operation, compute_placements, evaluate_odl, spell
from tests import scenes


def words(assembly: Assembly, after: int) -> dict[str, str]:
    """Part -> its ODL as a string, after that operation, counted from 1."""
    return {part: spell(odl) for part, odl in assembly.odls()[after - 1].items()}


def moves(*operations: Operation) -> Assembly:
    """An assembly of blocks in which these operations happen, without contacts."""
    parts = {part for operation in operations for part in operation.moves}
    return Assembly({part: scenes.block(part) for part in sorted(parts)}, operations, frozenset())


def test_sub_assembly_as_in_fig_4c() -> None:
    assembly = moves(Operation("A"), Operation("B"), Operation("A", carries=("B",)))
    assert words(assembly, 2) == {"A": "T1", "B": "T2"}
    assert words(assembly, 3) == {"A": "T3", "B": "T3 T1^-1 T2"}


def test_two_cubes_on_a_stick_as_in_fig_6() -> None:
    assert words(scenes.pockets().assembly, 6) == {
        "cube1": "T4",
        "stick": "T6",
        "cube2": "T6 T5^-1 T2",
        "cube3": "T6 T5^-1 T3",
    }


def test_relations_are_kept_when_they_are_lost() -> None:
    assembly = scenes.fixture().assembly
    history = {str(r.contact): (r.made + 1, r.lost if r.lost is None else r.lost + 1) for r in assembly.relations()}
    assert history["castle2.py on cube.ny"] == (3, 4)
    assert history["castle2.bottom on table.top"] == (3, None)
    assert history["stick.nz on castle2.sfl"] == (5, None)
    assert [r.lost for r in assembly.relations() if r.contact.manipulated.part == "cube"] == [3, None]


def test_odls_stand_for_the_poses_that_walking_the_operations_gives() -> None:
    for build in scenes.ALL.values():
        scene = build()
        goals = scenes.noisy(scene.nominal_poses, np.random.default_rng(1), 20.0, 20.0)
        for odls, poses in zip(
            scene.assembly.odls(), compute_placements(scene.assembly, scene.start, goals), strict=True
        ):
            for part, odl in odls.items():
                assert_allclose(poses[part], evaluate_odl(odl, goals), atol=1e-12)
            for part in set(poses) - set(odls):
                assert poses[part] is scene.start[part]
