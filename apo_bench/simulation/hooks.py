"""Hooks that a demonstration or a replay calls."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, final

from apo_bench.assembly import Plan, Step

TICK_S = 0.02
"""How often the robot checks its state and a film takes a picture."""
BY_HAND = "by hand"
TOUCHING = "touch"
"""Phases with an empty hand: a demonstration, and a robot that probes before it picks anything."""


class Phase(NamedTuple):
    """What hands or robot do at one moment."""

    operation: int | None
    """From 0; None before the first begins."""
    macro: str
    """The macros of the motion, or the stage where it is none: `pick`, `carry`, `insert-into, move-to-bottom`; of a
    demonstration `by hand`."""
    force_n: float
    """On what is in the hand, [N], as the sensor at the wrist shows it; 0 with an empty hand, and of a human."""
    undoes: bool = False
    """Whether the operation is undone, to be done again later."""


def _nothing(_: Any) -> None:
    """The hook by default."""


@final
@dataclass(frozen=True, eq=False)
class Hooks:
    """Functions that are called while something is done."""

    before_replay: Callable[[Plan], None] = _nothing
    """With the plan, also with one that is refused before anything moves; no human has one."""
    before_step: Callable[[Step], None] = _nothing
    """Before an operation is done or undone."""
    after_step: Callable[[Step], None] = _nothing
    """After it, when everything rests; not of one that fails."""
    after_tick: Callable[[Any, Phase], None] | None = None
    """With the `MjData`, every tick of simulated time; of a demonstration also at its start. None: states between steps
    are not worked out for it."""
    tick_s: float = TICK_S
    """How long a tick of a demonstration is; a robot's is `TICK_S`."""


def as_hooks(watch: Hooks | Callable[[Any], None] | None) -> Hooks:
    """What is passed as `watch` as hooks: a function of the `MjData` is called after every tick.

    Args:
        watch: A function may say by an attribute `period_s` how long a tick of a demonstration is.
    """
    if isinstance(watch, Hooks):
        return watch
    if watch is None:
        return Hooks()
    look = watch
    return Hooks(after_tick=lambda data, phase: look(data), tick_s=getattr(watch, "period_s", TICK_S))
