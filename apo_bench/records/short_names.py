"""Short names of correctors, methods and contact sources: strings only, `apo_bench.names.resolve` imports the objects.

Contact sources:

`given`             the correct contacts
`false-negative`    one contact is missing
`false-positive`    one contact too many
`shifted:3`         one face is 3 mm away from where the model of its part has it
`detected`          detected in the observed poses; `detected-jointly` estimates contacts and poses together
`module:name`       your own function
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
        "least-squares": "apo_bench.correction.baselines.least_squares:least_squares",
        "penalty": "apo_bench.correction.baselines.penalty:penalty",
    }
)
"""The correctors that need an observation and nothing else."""
CORRECTOR = "contact-robust"
"""The corrector where none is asked for."""
REOBSERVING = ("contact-robust",)
"""Correctors that may observe operations again."""
SIMULATED = MappingProxyType({"physics-settle": "apo_bench.simulation.scene.settling:settle"})
"""Correctors that need a simulator; `correct` does not know them, a trial does."""
WITHOUT_CORRECTOR = ("oracle", "uncorrected", "nominal")
"""Plans without a corrector: the true poses, the observed poses, the scenario's own poses fitted to the observed ones."""
METHODS = (*WITHOUT_CORRECTOR, *CORRECTORS, *SIMULATED)
"""Methods by name."""
WRONG_CONTACTS = MappingProxyType(
    {
        "false-negative": "apo_bench.perception.observation.wrong_contacts:missed",
        "false-positive": "apo_bench.perception.observation.wrong_contacts:false",
        "shifted": "apo_bench.perception.observation.wrong_contacts:Shifted",
    }
)
"""Sources of wrong contacts."""
FOREIGN_ARMS = ("menagerie:", "robosuite:")
"""How the arms of other collections begin; what follows is looked up there, and never imported."""
FAILURES = ("flips", "stale", "swaps", "rays", "displaced-view")
"""Noise models in which a camera fails now and then: the covariance that is stated is that of what is no failure. Rates
may follow the name, as in `flips:p=0.1/r=0.5`."""
RESIDUALS = "empirical:"
"""Begins the name of a noise that draws from a file of residuals."""


GIVEN = "given"
"""The correct contacts, which come with the demonstration."""
WRONG = tuple(WRONG_CONTACTS)
DETECTED = ("detected", "detected-jointly")
_KINDS = (GIVEN, *WRONG, *DETECTED)
SHIFT_MM = 2.0
_LARGEST_SHIFT_MM = 50.0


def contact_source_name(text: str) -> str:
    """The canonical name of a contact source: `shifted` is `shifted:2`, `shifted:3.0` is `shifted:3`.

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
        f"the contact source '{text}' was given; a size above 0 and up to {_LARGEST_SHIFT_MM:g} mm is allowed: "
        "shifted:3.",
    )
    return f"shifted:{size_mm:g}"


def checked_contact_source(text: str) -> str:
    """The canonical name of a contact source; raise an `InputError` if there is no such source."""
    require_text("contact source", text)
    name = contact_source_name(text)
    require(
        name.partition(":")[0] not in _KINDS or name in _KINDS or name.startswith("shifted:"),
        f"the contact source '{text}' was given; only shifted has a size, as in shifted:3.",
    )
    if ":" not in name and name not in _KINDS:
        raise InputError(unknown("contact source", text, _KINDS) + " Or give your own as 'package.module:name'.")
    return name


SPIRAL_SEARCH = "spiral-search"
"""The observed poses, executed by a robot that searches for holes in a spiral."""
_SPIRAL = "+spiral"
"""After any other method: the robot searches for holes in a spiral."""
_PROBE = "+probe"
"""After any method: the robot probes fixed surfaces to estimate its own calibration error."""


class Method(NamedTuple):
    """A parsed method."""

    corrector: str
    """What makes the plan: `oracle`, `uncorrected`, `nominal`, or a corrector."""
    spiral: bool = False
    """Whether the robot searches for holes in a spiral; one that probes does so as a last resort."""
    probe: bool = False
    """Whether the robot probes fixed surfaces."""


def parse_method(method: str) -> Method:
    """The parts of a method's name."""
    if method == SPIRAL_SEARCH:
        return Method("uncorrected", spiral=True)
    if method.endswith(_PROBE):
        return Method(method.removesuffix(_PROBE), spiral=True, probe=True)
    return Method(method.removesuffix(_SPIRAL), spiral=method.endswith(_SPIRAL))


def checked_method(method: str) -> str:
    """The canonical name of a method: `uncorrected+spiral` is `spiral-search`.

    Raises:
        InputError: It is not `oracle`, `uncorrected`, `nominal`, `spiral-search`, a corrector by name, or
            `module:name`, nor one with `+spiral` or `+probe`.
    """
    require_text("method", method)
    corrector, spiral, probe = parse_method(method)
    require(
        not spiral or not parse_method(corrector).spiral,
        f"the method '{method}' was given; use one of +spiral and +probe, which includes it, once, as in "
        "contact+probe.",
    )
    if ":" not in corrector and corrector not in METHODS:
        raise InputError(
            unknown("method", corrector or method, (*METHODS, SPIRAL_SEARCH))
            + " Or give your own corrector as 'package.module:name'; +spiral or +probe may follow any of them."
        )
    return SPIRAL_SEARCH if spiral and not probe and corrector == "uncorrected" else method


def knows_truth(method: str) -> bool:
    """Whether a method replays the true poses, so that neither noise nor human error affects it."""
    return parse_method(method).corrector == "oracle"


def is_uncorrected(method: str) -> bool:
    """Whether a method replays the observed poses."""
    return parse_method(method).corrector == "uncorrected"


def uses_contacts(method: str) -> bool:
    """Whether a method uses contacts: whether it has a corrector."""
    return parse_method(method).corrector not in WITHOUT_CORRECTOR


def may_reobserve(method: str) -> bool:
    """Whether a method may observe operations again: a corrector that does so, or your own."""
    corrector = parse_method(method).corrector
    return corrector in REOBSERVING or ":" in corrector


def probes(method: str) -> bool:
    """Whether the robot of a method probes, so that it has a force-torque sensor at its wrist."""
    return parse_method(method).probe


def with_simulated(corrector: Any) -> Any:
    """What to pass to `correct`: the function, where a name stands for a corrector that needs a simulator."""
    known = isinstance(corrector, str) and corrector in SIMULATED
    return resolve(corrector, SIMULATED, "corrector") if known else corrector
