"""A gripper as it was measured: what its fingers do at each command."""

from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from apo_bench.geometry.arrays import Array, copyable, frozen

_GRADED = 0.6
"""A gripper of which one step of the command makes this part of its opening knows open and closed only."""


@final
@copyable
@dataclass(frozen=True, eq=False)
class Hand:
    """Measured from closed to open; openings are of each finger, half the distance between the pads, [m]."""

    actuators: tuple[str, ...]
    joints: tuple[str, ...]
    opening: Array
    """(n,), ascending; below zero where pads would be inside each other."""
    commands: Array
    """(n, actuators), in their own units."""
    states: Array
    """(n, joints), [rad] or [m]."""
    force_n: float
    """How hard each pad pushes on a part of half its opening."""
    squeeze_m: float
    """How far inside the part its fingers are sent for that, each."""
    gives_m: float
    """How far the middle of each pad then gives way, beyond the surface of that part."""
    turns_deg: float
    """How far a pad turns while the empty hand closes to half of its opening."""
    friction: float
    """Of what pushes on that part."""
    seconds: float
    """How long it takes to close or open at most."""
    pads: tuple[str, str]
    """A geom of each side."""
    thick_m: float
    """How much farther apart the middles of these are than the surfaces that hold."""
    reach: Array
    """(n,), how far the pads reach beyond the tip, [m]."""

    def __post_init__(self) -> None:
        n = len(self.opening)
        object.__setattr__(self, "opening", frozen(self.opening, n))
        object.__setattr__(self, "reach", frozen(self.reach, n))
        object.__setattr__(self, "commands", frozen(self.commands, n, len(self.actuators)))
        object.__setattr__(self, "states", frozen(self.states, n, len(self.joints)))

    @cached_property
    def graded(self) -> bool:
        """Whether it can be opened by any amount; else it is open or closed."""
        steps = np.diff(self.opening)
        return bool(steps.max() < _GRADED * steps.sum())

    def command(self, opening: float) -> Array:
        """(actuators,), at which the fingers of the empty hand stand at an opening; all of it, if there is no more."""
        return self._at(self.commands, opening)

    def state(self, opening: float) -> Array:
        """(joints,), at an opening of the empty hand."""
        return self._at(self.states, opening)

    def of_command(self, ctrl: Array) -> float:
        """The opening that is commanded, [m]."""
        k = int(np.abs(self.commands[-1] - self.commands[0]).argmax())
        return _inverse(self.commands[:, k], self.opening, float(ctrl[k]))

    def _at(self, rows: Array, opening: float) -> Array:
        if not self.graded:
            return np.array(rows[-1 if opening > self.opening[0] else 0])
        return np.array([np.interp(opening, self.opening, column) for column in rows.T])


def _inverse(x: Array, y: Array, at: float) -> float:
    order = np.argsort(x, kind="stable")
    return float(np.interp(at, x[order], y[order]))
