"""The straight line on which a part comes to its goal, stated or planned."""

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
    """How far before the goal the line begins."""

    def __post_init__(self) -> None:
        freeze(self, direction=(3,))

    @property
    def stated(self) -> "Preference":
        """The whole line as a preference."""
        return Preference(self.direction, self.travel_m)


class Preference(NamedTuple):
    """What of a line of attach is stated; the rest is left to the plan."""

    direction: Array | None = None
    """The direction of the line, (3,), as in `Attach`; None where it is not stated."""
    travel_m: float | None = None


ANY = Preference()
