"""What a method is called: what the robot is told to do, and whether it feels for holes while it does that."""

from typing import Any, NamedTuple

from apo_bench.errors import InputError, unknown
from apo_bench.names import resolve
from apo_bench.records.short_names import LOOKING, METHODS, SIMULATED, UNCORRECTED

_SEARCH = "search"
"""What was seen, carried out by a robot that feels for holes; after a `+` the same for any other method."""
_SEARCH_SUFFIX = f"+{_SEARCH}"


class Method(NamedTuple):
    """A method in its two parts."""

    plan: str
    """Where the plan comes from: `oracle`, `none`, `by-heart`, or a corrector."""
    searches: bool


def parsed(method: str) -> Method:
    """The parts of a method's name."""
    if method == _SEARCH:
        return Method("none", True)
    return Method(method.removesuffix(_SEARCH_SUFFIX), method.endswith(_SEARCH_SUFFIX))


def checked_method(method: str) -> str:
    """A method's name as rows spell it: `none+search` is `search`.

    Raises:
        InputError: It is not `oracle`, `none`, `by-heart`, `search`,
            a corrector by name, or `module:name`, nor one with `+search`.
    """
    plan, searches = parsed(method)
    if searches and parsed(plan).searches:
        raise InputError(f"the method '{method}' was given; +{_SEARCH} is said once, as in contact+{_SEARCH}.")
    if ":" not in plan and plan not in METHODS:
        raise InputError(
            unknown("method", plan or method, (*METHODS, _SEARCH))
            + f" Or give your own corrector as 'package.module:name'; any of them may be followed by +{_SEARCH}."
        )
    return _SEARCH if searches and plan == "none" else method


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


def with_simulated(corrector: Any) -> Any:
    """What to pass to `correct`: the function, where a name stands for a corrector that needs a simulator."""
    known = isinstance(corrector, str) and corrector in SIMULATED
    return resolve(corrector, SIMULATED, "corrector") if known else corrector


def is_own(method: object) -> bool:
    """Whether a corrector is named as `module:name`, so that it runs in a process of its own."""
    return isinstance(method, str) and ":" in method
