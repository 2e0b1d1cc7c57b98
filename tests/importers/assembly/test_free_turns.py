"""Teeth that mesh are noted where the contacts leave the turn of a gear free."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from apo_bench.importers.assembly.contact_search import find_contacts
from apo_bench.importers.assembly.free_turns import list_meshing_parts
from apo_bench.importers.assembly.order_search import Placement
from apo_bench.scenario.parts.making import Body, bore, extrude, make_polygon, make_rectangle, make_shaft
from tests.importers.assembly.test_blocked import made


def gear(phase: float) -> Body:
    """Twelve teeth of 5 mm."""
    shares, radii = np.array([0.0, 0.2, 0.5, 0.7]), np.array([14.0, 19.0, 19.0, 14.0])
    angle = (2 * np.pi * (np.arange(12)[:, None] + shares) / 12 + phase).ravel()
    radius = np.tile(radii, 12)
    corners = zip((radius * np.cos(angle)).tolist(), (radius * np.sin(angle)).tolist(), strict=True)
    return extrude(make_polygon(*corners), 0, 10, bores=[bore((0, 0), 5.2, 0, 10, "bore")], bottom="foot", top="head")


@pytest.mark.parametrize("apart", [34.0, 40.0])
def test_teeth_that_mesh_although_the_contacts_leave_the_turn_free_are_noted(apart: float, tmp_path: Path) -> None:
    post = make_shaft(5, 0, 25, "side", bottom="tip", top="head")
    x = apart / 2
    parts = made(
        tmp_path,
        plate=(extrude(make_rectangle(120, 60), 0, 10, bottom="bottom", top="top"), (0, 0, 0)),
        post1=(post, (-x, 0, 10)),
        post2=(post, (x, 0, 10)),
        gear1=(gear(-0.35 * np.pi / 6), (-x, 0, 10)),
        gear2=(gear(np.pi - 0.85 * np.pi / 6), (x, 0, 10)),
    )
    solids = {each.name: each.solid for each in parts}
    poses = {each.name: each.T for each in parts}
    made_by = {
        name: tuple(
            each if each.manipulated.part == name else each._replace(manipulated=each[1], environment=each[0])
            for each in find_contacts(solids, poses)
            if name in {of.part for of in each}
        )
        for name in ("gear1", "gear2")
    }
    order = [Placement((name,), contacts, poses[name], "") for name, contacts in made_by.items()]
    notes = list(list_meshing_parts(solids, poses, order, ("plate", "post1", "post2")))
    assert len(notes) == (apart < 36)
    assert all(note.startswith("'gear2' may turn") and "meets 'gear1' after 1 degrees" in note for note in notes)
