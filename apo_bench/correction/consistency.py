"""Is a relation wrong? The chi-square test of a correction, and which relation to suspect if it fails.

If every relation is right and the stated noise is too, the squared length of the correction is chi-square distributed
with as many degrees of freedom as the contacts fix. A redundant contact that is wrong contradicts the others; one that
is not redundant only asks for a correction that is too long. In both cases everything fits once it is left out, so the
relations are ranked by how well the rest fits without them. More than one may do: they form the ambiguity set, and
nothing that was seen tells them apart.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from apo_bench.assembly.correction_record import Consistency, Suspect
from apo_bench.assembly.equations import pattern
from apo_bench.assembly.topology import Assembly, Contact
from apo_bench.correction.play import plays
from apo_bench.correction.solvers.gauss_newton import SMALLEST
from apo_bench.geometry.arrays import Array, frozen, remembered

TEST_LEVEL = 0.01
"""False alarms that are accepted."""
MOST_SUSPECTS = 64
"""Relations that are left out in turn; of more, those that pull hardest."""
_Measure = Callable[[NDArray[np.bool_]], Consistency]
"""The test of a correction by some of the contacts, (c,)."""
ROUNDING = 1e-13
"""Part of the largest diagonal entry that is added to all: redundant contacts without play have no other."""
SOFT_M = 0.05e-3
"""Standard deviation that contradictory contacts are given, [m], so that their contradiction can be measured."""


def suspects(
    assembly: Assembly, among: NDArray[np.bool_], measure: _Measure, pull: Callable[[], Array]
) -> tuple[Suspect, ...]:
    """Every relation that has contacts `among`, (c,), those considered, left out in turn; the most suspect first.

    Args:
        pull: How hard each contact pulls, (c,): of more relations than `MOST_SUSPECTS`, only those that pull hardest
            are tried.
    """
    every = assembly.arcs()
    considered = [i for i, arc in enumerate(every) if among[list(arc)].any()]
    if len(considered) > MOST_SUSPECTS:
        size = pull()
        considered = sorted(sorted(considered, key=lambda i: -size[list(every[i])].sum())[:MOST_SUSPECTS])
    return _ranked(assembly, among, measure, [(f"R{i + 1}", every[i]) for i in considered])


def contact_suspects(
    assembly: Assembly, among: NDArray[np.bool_], measure: _Measure, relation: str
) -> tuple[Suspect, ...]:
    """Every contact of one relation, `R3`, left out in turn; each is called `R3: stick.py on castle1.spy`."""
    contacts = assembly.relations()
    together = dict[Contact, list[int]]()
    for j in assembly.arcs()[int(relation.removeprefix("R")) - 1]:
        if among[j]:
            together.setdefault(assembly.given(contacts[j].contact), []).append(j)
    return _ranked(assembly, among, measure, [(f"{relation}: {one}", tuple(js)) for one, js in together.items()])


def _ranked(
    assembly: Assembly, among: NDArray[np.bool_], measure: _Measure, groups: Sequence[tuple[str, tuple[int, ...]]]
) -> tuple[Suspect, ...]:
    """Groups of contacts, left out in turn: by p-value, and where that underflows by how far chi-square is off."""
    relations = assembly.relations()
    found = list[Suspect]()
    for name, group in groups:
        kept = among.copy()
        kept[list(group)] = False
        tested = measure(kept)
        contacts = tuple(dict.fromkeys(assembly.given(relations[j].contact) for j in group))
        numbers = tested.chi_square, tested.freedom, tested.p_value
        found.append(Suspect(name, contacts, relations[group[0]].made, *numbers))
    return tuple(sorted(found, key=lambda s: (-s.p_value, (s.chi_square - s.freedom) / sqrt(2 * s.freedom + 1))))


@remembered
def fit_deviation(assembly: Assembly, play_m: float) -> Array:
    """The standard deviation of each compact equation, (3 c,), [m]: a contact that fits is uniform within its play.

    A row stands for all vertices of its contact, so it is off by as much as they are together.
    """
    count, unit_m = plays(assembly, play_m)
    each = unit_m / sqrt(3.0) * np.sqrt(count * np.diff(pattern(assembly).begin))
    return frozen(np.repeat(each, 3))


def p_value(chi_square: float, freedom: int) -> float:
    """The chance of a chi-square at least as large; 1 where nothing is tested."""
    if not isfinite(chi_square):
        return 0.0
    return float(chdtrc(freedom, chi_square)) if freedom else 1.0


def softened_length(z: Array, Jt: Array, S: Array) -> Array:
    """The squared length, (b,), of corrections z, (b, 6 n), if equations may be off by covariance S, (3 c, 3 c), [m^2].

    Near z equations are linear in the little that play leaves, so the shortest sum of what is left of z and of what
    equations are off by is r^t (J J^t + S)^-1 r, with r = J z what the observation was off by.
    """
    J = np.swapaxes(Jt, 1, 2)
    A = J @ Jt + S
    r = J @ z[..., None]
    diagonal = A.reshape(len(A), -1)[:, :: A.shape[1] + 1]
    diagonal += ROUNDING * diagonal.max(axis=1, initial=SMALLEST)[:, None]
    return np.asarray((r * np.linalg.solve(A, r)).sum(axis=(1, 2)))
