"""What a robot does at a moment, for those who look on and want to say it."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol, runtime_checkable

from apo_bench.assembly.goals import Plan


class Doing(NamedTuple):
    """One moment of a replay."""

    operation: int | None
    """From 0; None before the first begins."""
    macro: str
    """The macros of the motion, or the stage where it is none: `pick`, `carry`, `insert-into, move-to-bottom`."""
    force_n: float
    """On what is in the hand, [N], as the sensor at the wrist shows it; 0 with an empty hand."""
    undoes: bool = False
    """Whether the operation is undone, to be done again later."""


@runtime_checkable
class Inspector(Protocol):
    """A `watch` that is told the plan, and at every tick what the robot does; it changes nothing."""

    def begin(self, plan: Plan) -> None: ...

    def inspect(self, data: Any, doing: Doing) -> None: ...
