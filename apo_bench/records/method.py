"""What a method is called: what the robot is told to do, and whether it searches for holes or feels meanwhile."""

from typing import Any, NamedTuple

from apo_bench.errors import InputError, require, require_text, unknown
from apo_bench.names import resolve
from apo_bench.records.short_names import LOOKING, METHODS, SIMULATED, UNCORRECTED

_SEARCH = "search"
"""What was seen, carried out by a robot that feels for holes; after a `+` the same for any other method."""
_SEARCH_SUFFIX = f"+{_SEARCH}"
_FEEL_SUFFIX = "+feel"
"""After any method: a robot that finds out by touching how wrong it is itself."""


class Method(NamedTuple):
    """A method in its parts."""

    plan: str
    """Where the plan comes from: `oracle`, `none`, `by-heart`, or a corrector."""
    searches: bool
    """Whether the robot feels for holes; one that feels does so as its last resort."""
    feels: bool


def parsed(method: str) -> Method:
    """The parts of a method's name."""
    if method == _SEARCH:
        return Method("none", True, False)
    if method.endswith(_FEEL_SUFFIX):
        return Method(method.removesuffix(_FEEL_SUFFIX), True, True)
    return Method(method.removesuffix(_SEARCH_SUFFIX), method.endswith(_SEARCH_SUFFIX), False)


def checked_method(method: str) -> str:
    """A method's name as rows spell it: `none+search` is `search`.

    Raises:
        InputError: It is not `oracle`, `none`, `by-heart`, `search`,
            a corrector by name, or `module:name`, nor one with `+search`
            or `+feel`.
    """
    require_text("method", method)
    plan, searches, by_touch = parsed(method)
    require(
        not searches or not parsed(plan).searches,
        f"the method '{method}' was given; one of +search and +feel, which searches too, is said once, as in "
        "contact+feel.",
    )
    if ":" not in plan and plan not in METHODS:
        raise InputError(
            unknown("method", plan or method, (*METHODS, _SEARCH))
            + " Or give your own corrector as 'package.module:name'; any of them may be followed by +search or +feel."
        )
    return _SEARCH if searches and not by_touch and plan == "none" else method


def knows_truth(method: str) -> bool:
    """Whether a method replays the drawn layout, so that it meets neither noise nor carelessness."""
    return parsed(method).plan == "oracle"


def as_seen(method: str) -> bool:
    """Whether a method replays what was seen."""
    return parsed(method).plan == "none"


def knows_relations(method: str) -> bool:
    """Whether a method is told what touches what: whether it has a corrector."""
    return parsed(method).plan not in UNCORRECTED


def may_look(method: str) -> bool:
    """Whether a method can ask to see operations again."""
    return parsed(method).plan in LOOKING


def feels(method: str) -> bool:
    """Whether a robot carries out the plan of a method that feels, so that it has a sensor at its wrist."""
    return parsed(method).feels


def with_simulated(corrector: Any) -> Any:
    """What to pass to `correct`: the function, where a name stands for a corrector that needs a simulator."""
    known = isinstance(corrector, str) and corrector in SIMULATED
    return resolve(corrector, SIMULATED, "corrector") if known else corrector


def is_own(method: object) -> bool:
    """Whether a corrector is named as `module:name`, so that it runs in a process of its own."""
    return isinstance(method, str) and ":" in method
