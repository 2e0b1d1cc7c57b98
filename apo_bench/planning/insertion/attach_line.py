"""The straight line on which a part comes to its goal, planned (`Attach`) or preferred (`Preference`)."""

from dataclasses import dataclass
from typing import NamedTuple, final

from apo_bench.geometry import Array, freeze, make_copyable


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class Attach:
    """The straight line on which a part comes to its goal."""

    direction: Array
    """Unit vector of the motion, (3,), in the frame of the main part at its goal."""
    travel_m: float
    """Length of the line, from its beginning to the goal, [m]."""

    def __post_init__(self) -> None:
        freeze(self, direction=(3,))

    @property
    def stated(self) -> "Preference":
        """The whole line as a preference."""
        return Preference(self.direction, self.travel_m)


class Preference(NamedTuple):
    """The stated parts of a line of attach; the planner chooses the others."""

    direction: Array | None = None
    """As in `Attach`; None: the planner chooses."""
    travel_m: float | None = None
    """As in `Attach`; None: the planner chooses."""


ANY = Preference()  # nothing is stated
