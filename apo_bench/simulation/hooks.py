"""Hooks: callbacks during a demonstration or a replay, and the phase that they are told."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, final

from apo_bench.assembly import Plan, Step

TICK_S = 0.02
"""Period in which the robot checks its state and a film takes a picture."""
BY_HAND = "by hand"
"""`Phase.macro` of a demonstration."""
TOUCHING = "touch"
"""`Phase.macro` of a robot that probes with an empty hand before it picks anything."""


class Phase(NamedTuple):
    """The activity of the hands or the robot at one moment."""

    operation: int | None
    """Counted from 0; None before the first begins."""
    macro: str
    """The macros of the motion, such as `insert-into, move-to-bottom`; else its stage, such as `pick`, `carry`;
    `by hand` in a demonstration."""
    force_n: float
    """Contact force on the held part, [N], from the wrist sensor; 0 with an empty hand and in a demonstration."""
    undoes: bool = False
    """Whether the operation is undone, to be repeated later."""


def _nothing(_: Any) -> None:
    """The default hook."""


@final
@dataclass(frozen=True, eq=False)
class Hooks:
    """Functions that are called during a demonstration or a replay."""

    before_replay: Callable[[Plan], None] = _nothing
    """Called with the plan, also if it is refused before any motion; not in a demonstration."""
    before_step: Callable[[Step], None] = _nothing
    """Called before an operation is done or undone."""
    after_step: Callable[[Step], None] = _nothing
    """Called after an operation, once everything rests; not if it fails."""
    after_tick: Callable[[Any, Phase], None] | None = None
    """Called with the `MjData` every tick of simulated time, in a demonstration also at its start. None: states in
    skipped stretches of a simulation are not reconstructed."""
    tick_s: float = TICK_S
    """Length of a tick of a demonstration; a robot always uses `TICK_S`."""


def as_hooks(watch: Hooks | Callable[[Any], None] | None) -> Hooks:
    """The argument `watch` as hooks: a function is called with the `MjData` after every tick.

    Args:
        watch: Hooks, a function, or None. An attribute `period_s` of a function is the tick of a demonstration, [s].
    """
    if isinstance(watch, Hooks):
        return watch
    if watch is None:
        return Hooks()
    look = watch
    return Hooks(after_tick=lambda data, phase: look(data), tick_s=getattr(watch, "period_s", TICK_S))
