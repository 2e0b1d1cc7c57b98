"""Ranking of the relations that may be wrong if the test of a correction fails.

Each relation is left out in turn, and the test of the rest is repeated: without the wrong relation everything fits.
Several relations may qualify; they form the ambiguity set, which no observation can resolve.
"""

from collections.abc import Sequence
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Assembly, Contact, Suspect
from apo_bench.correction.contact.problem import Problem
from apo_bench.correction.contact.solved import pull, run_tests

MOST_SUSPECTS = 64
"""Most relations that are left out in turn; of more, those with the largest multipliers."""


def suspects(problem: Problem, kept: NDArray[np.bool_]) -> tuple[Suspect, ...]:
    """The relations with contacts that are `kept`, (c,), ranked by the test without them, the most suspect first.

    Of more than `MOST_SUSPECTS` relations only those with the largest multipliers (`pull`) are tried.
    """
    arcs = problem.observation.assembly.arcs()
    considered = [i for i, arc in enumerate(arcs) if kept[list(arc)].any()]
    if len(considered) > MOST_SUSPECTS:
        size = pull(problem, kept)
        considered = sorted(sorted(considered, key=lambda i: -size[list(arcs[i])].sum())[:MOST_SUSPECTS])
    return _rank(problem, kept, [(f"R{i + 1}", arcs[i]) for i in considered])


def contact_suspects(problem: Problem, kept: NDArray[np.bool_], relation: str) -> tuple[Suspect, ...]:
    """The contacts of one relation, `R3`, ranked likewise; each is called `R3: stick.py on castle1.spy`."""
    single = contacts_of(problem.observation.assembly, relation)
    return _rank(problem, kept, [(name, group) for name, group in single.items() if kept[list(group)].any()])


def contacts_of(assembly: Assembly, relation: str) -> dict[str, tuple[int, ...]]:
    """Names of the contacts of one relation, `R3: stick.py on castle1.spy` -> their numbers in `relations()`.

    A contact of round faces has several numbers, since it stands for several contacts of sheets.
    """
    relations = assembly.relations()
    together = dict[Contact, tuple[int, ...]]()
    for j in assembly.arcs()[int(relation.removeprefix("R")) - 1]:
        contact = assembly.given(relations[j].contact)
        together[contact] = (*together.get(contact, ()), j)
    return {f"{relation}: {contact}": group for contact, group in together.items()}


def _rank(
    problem: Problem, kept: NDArray[np.bool_], groups: Sequence[tuple[str, tuple[int, ...]]]
) -> tuple[Suspect, ...]:
    """Leave out each named group of contacts in turn and rank the groups, the most suspect first.

    The order is by p-value; where that underflows, by the normalised excess of chi-square.
    """
    relations = problem.observation.assembly.relations()
    ranked = list[Suspect]()
    rest = np.tile(kept, (len(groups), 1))
    for row, (_, group) in zip(rest, groups, strict=True):
        row[list(group)] = False
    for (name, group), test in zip(groups, run_tests(problem, rest), strict=True):
        contacts = tuple(dict.fromkeys(problem.observation.assembly.given(relations[j].contact) for j in group))
        numbers = test.chi_square, test.freedom, test.p_value
        ranked.append(Suspect(name, contacts, relations[group[0]].made, *numbers))
    # A chi-square of f degrees of freedom has mean f and variance 2 f.
    return tuple(sorted(ranked, key=lambda s: (-s.p_value, (s.chi_square - s.freedom) / sqrt(2 * s.freedom + 1))))
