"""The insertion axis of every operation of a scenario, as stated in its file or planned, and checks of stated ones."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.planning.insertion.arrival import Arrival
from apo_bench.planning.insertion.attach_line import Preference
from apo_bench.planning.insertion.operation_macros import OperationMacros, describe_operation_macros
from apo_bench.scenario.layout import find_nominal_start
from apo_bench.scenario.scenario import Scenario

_THROUGH = 1e-3
"""A direction leads through a face if its cosine to the normal of the face is larger."""


@lru_cache(maxsize=32)
def list_nominal_operations(scenario: Scenario) -> tuple[OperationMacros, ...]:
    """The planned insertion of every operation of a scenario, at its nominal poses."""
    lines = [attach.stated for attach in scenario.attach]
    return describe_operation_macros(scenario.assembly, find_nominal_start(scenario), scenario.nominal_poses, lines)


def add_attach_lines(scenario: Scenario, stated: Sequence[Preference], file: str) -> Scenario:
    """Return the scenario with the insertion axis of every operation.

    Args:
        stated: Direction and length that the file states for each operation, if any.
        file: Name of the file, for messages.

    Raises:
        InputError: A stated direction leads through a face that the part touches, or a stated line begins inside
            another part.
    """
    operations = describe_operation_macros(
        scenario.assembly, find_nominal_start(scenario), scenario.nominal_poses, stated
    )
    for each, preference in zip(operations, stated, strict=True):
        _check_stated_line(each.after, preference, f"{file}, operation {each.operation + 1}, attach", each.main)
    return replace(scenario, attach=tuple(each.after.line for each in operations))


def _check_stated_line(after: Arrival, stated: Preference, key: str, main: str) -> None:
    """Raise an `InputError` if a stated direction or length of an insertion is impossible.

    Args:
        after: The planned arrival at the goal.
        key: File and key, for messages.
        main: Name of the moved part.
    """
    if stated.direction is not None:
        way = after.T[:3, :3] @ stated.direction
        through = max(after.touched, key=lambda each: float(each.normal @ way), default=None)
        if through is not None and through.normal @ way > _THROUGH:
            face = next(of for of in through.contact if of.part == through.rests)
            raise InputError(
                f"{key}, along: '{main}' would come through '{face}', which it has to touch; "
                f"give a direction that leads onto that face or along it, or leave 'along' out."
            )
    if stated.travel_m is not None and after.chain.way is not None:
        least = after.chain.way.length_m
        level = abs(after.chain.way.direction[2]) < 0.5
        require(
            not level or stated.travel_m >= least - 1e-6,
            f"{key}, travel_mm: {1e3 * stated.travel_m:g} mm before its goal '{main}' would still be inside of "
            f"what it is put into; give at least {np.ceil(1e3 * least - 1e-6):g}, or leave 'travel_mm' out.",
        )
