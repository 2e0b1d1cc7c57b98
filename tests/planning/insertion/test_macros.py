"""Macros by peeling, and ways checked by what boxes sweep; against sampling, and on small assemblies of every state."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from apo_bench import Assembly
from apo_bench.assembly import Operation
from apo_bench.geometry import Array, Solid
from apo_bench.planning.insertion.arrival import Arrival, plan_arrival
from apo_bench.planning.insertion.attach_line import Preference
from apo_bench.planning.insertion.macros import (
    MacroChain,
    StraightExit,
    build_macro_chain,
    invert_macros,
    peel_contacts,
)
from tests import scenes

X, Y, Z = np.eye(3)


def out(along: Array, walls: tuple[int, ...]) -> StraightExit:
    """Along the first axis there is, a decimetre."""
    return StraightExit(along[0], 0.1, True)


def made(*normals: Array) -> MacroChain:
    return build_macro_chain(np.array(normals).reshape(-1, 3), out)


def names(found: MacroChain) -> list[str]:
    return [macro.name for macro in found.macros]


@pytest.mark.parametrize(
    ("letter", "normals", "macros"),
    [
        ("S", [], []),
        ("A", [Z], ["move-to-contact"]),
        ("B", [Y, -Y], ["insert-between"]),
        ("C", [X, Z], ["move-to-contact", "slide-to-contact"]),
        ("D", [Y, Z, -Y], ["insert-into-slot", "move-to-contact"]),
        ("E", [Y, -Y, Z, -Z], ["insert-into"]),
        ("F", [X, Y, Z], ["move-to-contact", "slide-to-contact", "slide-to-contact"]),
        ("G", [X, Y, -Y, Z], ["insert-into-slot", "move-to-contact", "slide-to-contact"]),
        ("H", [X, -X, Y, -Y, Z], ["insert-into", "move-to-bottom"]),
        ("I", [X, -X, Y, -Y, Z, -Z], []),
    ],
)
def test_the_procedure_tree(letter: str, normals: list[Array], macros: list[str]) -> None:
    found = made(*normals)
    assert (found.state.letter, names(found)) == (letter, macros)
    assert found.locked == (letter == "I")
    closed = [i for macro in found.macros for i in macro.makes]
    assert sorted(closed) == ([] if found.locked else list(range(len(normals)))), "every contact is made once"
    for macro in found.macros:
        n = np.array(normals)
        assert np.abs(n[list(macro.keeps)] @ macro.direction).max(initial=0.0) < 1e-9, "along what was made before"
        if macro.guarded:
            assert (n[list(macro.makes)] @ macro.direction < -1e-3).all(), "onto what it makes"
        else:
            assert np.abs(n[list(macro.makes)] @ macro.direction).max() < 1e-9, "between its walls"


def test_what_carries_is_met_first_and_from_above() -> None:
    for normals in ([X, Z], [Z, X], [Y, X, Z]):
        np.testing.assert_array_equal(made(*normals).macros[0].direction, -Z)
    groove = [(Z + X) / 2**0.5, (Z - X) / 2**0.5]
    (down,) = made(*groove).macros
    np.testing.assert_array_equal(down.direction, -Z)
    assert down.makes == (0, 1)
    (up,) = made(-Z).macros
    np.testing.assert_array_equal(up.direction, Z)


def test_a_part_leaves_the_way_it_came() -> None:
    """Sides first, then out of walls; from supports alone it is just lifted."""
    assert invert_macros(made(Z), (0,)) == ()
    (off,) = invert_macros(made(Z, X), (0,))
    assert (off.name, off.direction.tolist(), off.makes) == ("depart", [1.0, 0.0, 0.0], (1,))
    (pulled,) = invert_macros(made(Y, -Y, Z, -Z), (2,))
    assert pulled.length_m == 0.1
    assert abs(pulled.direction[0]) == pytest.approx(1.0)
    back = invert_macros(made(X, Y, -Y, Z), (3,))
    assert back[0].makes == (0,), "off the end of the slot first"


def test_peeling_takes_off_everything_that_is_not_locked() -> None:
    rng = np.random.default_rng(0)
    for _ in range(60):
        n = rng.standard_normal((rng.integers(1, 5), 3))
        normals = n / np.linalg.norm(n, axis=1)[:, None]
        if rng.integers(2):
            normals = np.concatenate([normals, -normals[:1]])
        layers = peel_contacts(normals)
        assert sorted(i for layer in layers for i in layer.breaks) == list(range(len(normals)))
        assert [layer.locked for layer in layers[:-1]] == [False] * (len(layers) - 1)
        for layer in layers:
            if layer.cone.state.detaching:
                t = layer.cone.direction
                assert (normals[list(layer.breaks)] @ t > 0.0).all()
                assert np.abs(normals[list(layer.keeps)] @ t).max(initial=0.0) < 1e-6


def assembly(contacts: dict[str, Sequence[str]], **parts: tuple[Solid, Array]) -> tuple[Assembly, dict[str, Array]]:
    """One movable part called `part`, all others fixed, and where everything is."""
    touched = [c for other, pairs in contacts.items() for c in scenes.touch("part", other, *pairs)]
    solids = {name: solid for name, (solid, _) in parts.items()}
    fixed = frozenset(parts) - {"part"}
    return Assembly(solids, (Operation("part", tuple(touched)),), fixed), {name: T for name, (_, T) in parts.items()}


def arrival(built: tuple[Assembly, dict[str, Array]], stated: Preference | None = None) -> Arrival:
    of, poses = built
    return plan_arrival(of, ("part",), of.operations[0].contacts, poses, stated or Preference())


def between(height_mm: float = 80.0) -> tuple[Assembly, dict[str, Array]]:
    return assembly(
        {"left": ("py-ny",), "right": ("ny-py",)},
        left=(scenes.block(), scenes.mm(0, 50, height_mm)),
        right=(scenes.block(), scenes.mm(0, -50, height_mm)),
        part=(scenes.block(), scenes.mm(0, 0, height_mm)),
    )


def slot(*more: tuple[str, Sequence[str], Solid, Array]) -> tuple[Assembly, dict[str, Array]]:
    contacts = {"castle": scenes.SLOT} | {name: pairs for name, pairs, _, _ in more if pairs}
    parts = {name: (solid, T) for name, _, solid, T in more}
    at = scenes.mm(0, 0, 40)
    return assembly(contacts, castle=(scenes.castle(), np.eye(4)), part=(scenes.stick(), at), **parts)
