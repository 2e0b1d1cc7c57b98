"""Everything that rows and the command line call by a short name, and where it is: names alone, nothing is imported.

Whoever needs the object behind a name asks `apo_bench.names.resolve`.

What a corrector is told of the contacts, by the names that rows use.

`given`             the right ones
`missed`, `false`   one too few, one too many
`shifted:3`         one face is not where the model of its part says, by 3 mm
`recognised`        found in what was seen; `recognised-jointly` decides contacts and poses together
`module:name`       a function of somebody's own

What a method is called: what the robot is told to do, and whether it searches for holes or feels meanwhile.
"""

import math
from types import MappingProxyType
from typing import Any, NamedTuple

from apo_bench.errors import InputError, require, require_text, unknown
from apo_bench.names import resolve

CORRECTORS = MappingProxyType(
    {
        "contact": "apo_bench.correction.contact.contact:contact",
        "contact-refuse": "apo_bench.correction.contact.contact:contact_refuse",
        "contact-drop": "apo_bench.correction.contact.contact:contact_drop",
        "contact-robust": "apo_bench.correction.robust.robust:contact_robust",
        "paper": "apo_bench.correction.baselines.paper:paper",
        "paper-track": "apo_bench.correction.baselines.track:paper_track",
        "snap": "apo_bench.correction.baselines.snap:snap",
        "least-squares": "apo_bench.correction.baselines.penalty:least_squares",
        "penalty": "apo_bench.correction.baselines.penalty:penalty",
    }
)
"""The correctors that need an observation and nothing else."""
CORRECTOR = "contact-robust"
"""The corrector where none is asked for."""
LOOKING = ("contact-robust",)
"""Correctors that can ask to see operations again."""
SIMULATED = MappingProxyType({"settle": "apo_bench.simulation.scene.settling:settle"})
"""Correctors that need a simulator; `correct` does not know them, a trial does."""
UNCORRECTED = ("oracle", "none", "by-heart")
"""Plans without a corrector: the truth, what was seen, the scenario's own goals where they fit best what was seen."""
METHODS = (*UNCORRECTED, *CORRECTORS, *SIMULATED)
"""What a robot can be told to do: a plan without a corrector, or by one."""
WRONG_RELATIONS = MappingProxyType(
    {
        "missed": "apo_bench.perception.observation.relations:missed",
        "false": "apo_bench.perception.observation.relations:false",
        "shifted": "apo_bench.perception.observation.relations:Shifted",
    }
)
"""Wrong relations that a corrector is told."""
FOREIGN_ARMS = ("menagerie:", "robosuite:")
"""How the arms of other collections begin; what follows is looked up there, and never imported."""
FAILURES = ("flips", "stale", "swaps", "rays", "displaced-view")
"""Noise models in which a camera fails now and then: the covariance that is stated is that of what is no failure. Rates
may follow the name, as in `flips:p=0.1/r=0.5`."""
RESIDUALS = "empirical:"
"""Begins the name of a noise that draws from a file of residuals."""


GIVEN = "given"
"""The contacts come with the demonstration, and are right."""
WRONG = tuple(WRONG_RELATIONS)
RECOGNISED = ("recognised", "recognised-jointly")
_KINDS = (GIVEN, *WRONG, *RECOGNISED)
SHIFT_MM = 2.0
_LARGEST_SHIFT_MM = 50.0


def relations_name(text: str) -> str:
    """How rows spell it: `shifted` stands for 2 mm, `shifted:3.0` is `shifted:3`.

    Raises:
        InputError: A size that is not allowed.
    """
    kind, _, size = text.partition(":")
    if kind != "shifted":
        return text
    try:
        size_mm = float(size or SHIFT_MM)
    except ValueError:
        size_mm = math.nan
    require(
        0.0 < size_mm <= _LARGEST_SHIFT_MM,
        f"the relations '{text}' were given; a size above 0 and up to {_LARGEST_SHIFT_MM:g} mm is allowed: shifted:3.",
    )
    return f"shifted:{size_mm:g}"


def checked_relations(text: str) -> str:
    """The relations as rows spell them; raise an `InputError` unless there are such."""
    require_text("relations", text)
    name = relations_name(text)
    require(
        name.partition(":")[0] not in _KINDS or name in _KINDS or name.startswith("shifted:"),
        f"the relations '{text}' were given; only shifted has a size, as in shifted:3.",
    )
    if ":" not in name and name not in _KINDS:
        raise InputError(unknown("kind of relations", text, _KINDS) + " Or give your own as 'package.module:name'.")
    return name


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
    """Whether a method may ask to see operations again: one of those that do, or a corrector of one's own."""
    plan = parsed(method).plan
    return plan in LOOKING or ":" in plan


def feels(method: str) -> bool:
    """Whether a robot carries out the plan of a method that feels, so that it has a sensor at its wrist."""
    return parsed(method).feels


def with_simulated(corrector: Any) -> Any:
    """What to pass to `correct`: the function, where a name stands for a corrector that needs a simulator."""
    known = isinstance(corrector, str) and corrector in SIMULATED
    return resolve(corrector, SIMULATED, "corrector") if known else corrector
