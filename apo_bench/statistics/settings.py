"""Settings: what the methods and levels of one table or panel have in common.

How rates, differences and levels are said.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, TypeVar

from apo_bench.io import grouped
from apo_bench.records import NO_ROBOT_ERROR, RANGE, USUAL, TrialSettings, feels, knows_relations, knows_truth, may_look
from apo_bench.statistics.rates import PLACE_FIELDS, Cell, Interval, Place, Rate, rank_relations


def percent(rate: float | None, digits: int = 1) -> str:
    """`97.0 %`, or a dash where nothing counted; only what is all or nothing says 100.0 or 0.0."""
    if rate is None:
        return "–"
    text = f"{100 * rate:.{digits}f}"
    least = 10.0**-digits
    if rate < 1.0 and float(text) == 100.0:
        return f"> {100 - least:.{digits}f} %"
    return f"< {least:.{digits}f} %" if rate > 0.0 and float(text) == 0.0 else f"{text} %"


def percents(interval: Interval, digits: int = 1) -> str:
    """`91.5 to 99.0 %`."""
    return f"{100 * interval.low:.{digits}f} to {100 * interval.high:.{digits}f} %"


def share(r: Rate) -> str | None:
    """`12 of 13 (66.7 to 98.6 %)`; None without a trial."""
    return f"{r.successes} of {r.trials} ({percents(r.interval)})" if r.trials else None


def signed(x: float, digits: int) -> str:
    """`+4.0`; what is nothing to so many digits has no minus."""
    return f"{round(x, digits) + 0.0:+.{digits}f}"


def points(difference: float | None, interval: Interval) -> str | None:
    """`+4.0 (-0.3 to +9.1)`."""
    if difference is None:
        return None
    middle, low, high = (signed(100 * x, 1) for x in (difference, *interval))
    return f"{middle} ({low} to {high})"


def failures(cell: Cell, most: int = 3) -> str:
    """`attach: force_stop 12, judge: gap 3`: the most frequent endings of trials that failed."""
    return ", ".join(f"{why} {count}" for why, count in list(cell.failures.items())[:most])


def level_label(level: float, level_deg: float, noise: str = "") -> str:
    """`0.5`, `0.5 mm, 1 deg` where the two differ, or `0.5 mm per ray` of the range finder."""
    if noise == RANGE:
        return f"{level:g} mm per ray"
    return f"{level:g}" if level == level_deg else f"{level:g} mm, {level_deg:g} deg"


_Item = TypeVar("_Item")


class Setting(NamedTuple):
    """One table or panel: everything but method, level and seed."""

    scenario: str
    clearance_mm: float
    noise: str
    relations: str
    careless: float
    grasp: str
    fidelity: str
    looks: int = 0
    robot_error: str = NO_ROBOT_ERROR
    wrench: str = TrialSettings.wrench
    stated_error: str = TrialSettings.stated_error
    abstain: float = 0.0

    def holds(self, cell: Place) -> bool:
        """Whether a cell belongs here.

        The oracle meets neither noise nor carelessness, plans without a corrector are not told any relations, few
        methods can ask to look again, and few robots feel.
        """
        return (
            _site(cell) == _site(self)
            and (knows_truth(cell.method) or (cell.noise, cell.careless) == (self.noise, self.careless))
            and (not knows_relations(cell.method) or cell.relations == self.relations)
            and (not may_look(cell.method) or cell.looks == self.looks)
            and (not feels(cell.method) or (cell.wrench, cell.stated_error) == (self.wrench, self.stated_error))
        )

    def title(self) -> str:
        """`stick_in_tower, careless human`, and whatever is not as usual."""
        return ", ".join([self.scenario, *self.conditions()])

    def conditions(self, clearance: bool = True) -> list[str]:
        """All but the scenario, as a person says it; the clearance can be left out."""
        human = {0.0: "careful human", 1.0: "careless human"}.get(self.careless, f"carelessness {self.careless:g}")
        unusual = {
            "range finder" if self.noise == RANGE else f"{self.noise} noise": self.noise != USUAL,
            f"relations {self.relations}": self.relations != "given",
            f"{self.grasp} grasp": self.grasp != "friction",
            f"robot error {self.robot_error}": self.robot_error != NO_ROBOT_ERROR,
            f"fidelity {self.fidelity}": self.fidelity != "full",
            f"{self.looks} more look{'s' * (self.looks > 1)}": self.looks > 0,
            f"wrench {self.wrench}": self.wrench != TrialSettings.wrench,
            f"stated error {self.stated_error}": self.stated_error != TrialSettings.stated_error,
            f"abstaining below {self.abstain:g}": self.abstain > 0,
        }
        place = [human, *[f"{self.clearance_mm:g} mm clearance"] * clearance]
        return place + [words for words, here in unusual.items() if here]


def cell_place(item: Any) -> Place:
    """The place of a cell; of anything that has one, that."""
    return item.place if hasattr(item, "place") else Place(*(getattr(item, name) for name in PLACE_FIELDS))


def settings(cells: Iterable[Any]) -> list[Setting]:
    """The settings of cells, sorted by scenario first; a cell makes its own only if no other setting holds it."""
    places = [cell_place(cell) for cell in cells]
    chosen = set[Setting]()
    # who meets most of what a setting says goes first, so that others find the setting that they belong to
    for _, alike in sorted(grouped((_meets(p.method), p) for p in places).items(), reverse=True):
        chosen |= {
            s for s, p in {setting_of(p): p for p in alike}.items() if not any(other.holds(p) for other in chosen)
        }
    return sorted(chosen, key=lambda s: (s[:2], s.noise != USUAL, s.noise, rank_relations(s.relations), s[4:]))


def _meets(method: str) -> tuple[bool, ...]:
    """What of a setting a method meets: noise, relations, what a robot that feels is given, looks."""
    return not knows_truth(method), knows_relations(method), feels(method), may_look(method)


def members(settings: Sequence[Setting], items: Iterable[_Item]) -> dict[Setting, list[_Item]]:
    """The cells, or whatever has a place, of every setting, in their order; of several oracles the one most tried."""
    near = grouped((_site(cell_place(item)), item) for item in items)
    return {s: _one_ceiling([x for x in near.get(_site(s), ()) if s.holds(cell_place(x))]) for s in settings}


def levels_of(items: Iterable[Any]) -> list[tuple[float, float]]:
    """Levels in mm and degrees of all but the oracle, sorted."""
    return sorted({level_of(item) for item in items if not knows_truth(cell_place(item).method)})


def level_of(item: Any) -> tuple[float, float]:
    """In mm and degrees."""
    place = cell_place(item)
    return place.level, place.level_deg


def level_words(level: tuple[float, float], noise: str) -> str:
    """`0.5`, or `0.5 mm, 1 deg` where they differ."""
    return f"{level[0]:g}" if noise == RANGE else level_label(*level, noise)


def level_unit(noise: str) -> str:
    """What a level is, as an axis says it."""
    return "level: mm per ray" if noise == RANGE else "level: mm and degrees per axis"


def setting_of(p: Place) -> Setting:
    """The setting that a place belongs to by itself."""
    return Setting(*(getattr(p, name) for name in Setting._fields))


def _site(x: Place | Setting) -> tuple[Any, ...]:
    return x.scenario, x.clearance_mm, x.grasp, x.fidelity, x.robot_error, x.abstain


def _one_ceiling(inside: list[_Item]) -> list[_Item]:
    ceilings = [item for item in inside if cell_place(item).method == "oracle"]
    best = max(ceilings, key=lambda item: getattr(item, "trials", 0), default=None)
    return [item for item in inside if item is best or cell_place(item).method != "oracle"]
