"""Names of methods, and the properties that follow from a name."""

from types import MappingProxyType
from typing import Any, NamedTuple

from apo_bench.errors import require, require_known, require_text
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
"""Correctors that need only an observation -> the function."""
CORRECTOR = "contact-robust"
"""The default corrector."""
REOBSERVING = ("contact-robust",)
"""Correctors of the package that may observe operations again."""
SIMULATED = MappingProxyType({"physics-settle": "apo_bench.simulation.scene.settling:settle"})
"""Correctors that need a simulator: `correct` does not know them, a trial does."""
WITHOUT_CORRECTOR = ("oracle", "uncorrected", "nominal")
"""Methods without a corrector: they plan the true poses, the observed poses, or the scenario's poses fitted to them."""
METHODS = (*WITHOUT_CORRECTOR, *CORRECTORS, *SIMULATED)
"""Methods by name, without `spiral-search` and suffixes."""
SPIRAL_SEARCH = "spiral-search"
"""Replays the observed poses, with a robot that searches for holes in a spiral."""
_SPIRAL = "+spiral"
"""Suffix of any other method: the robot searches for holes in a spiral."""
_PROBE = "+probe"
"""Suffix of any method: the robot probes fixed surfaces to estimate its own calibration error."""


class Method(NamedTuple):
    """The parts of a method's name."""

    corrector: Any
    """`oracle`, `uncorrected`, `nominal`, or a corrector, as a name or as the function."""
    spiral: bool = False
    """Whether the robot searches for holes in a spiral; a robot that probes does so as a last resort."""
    probe: bool = False
    """Whether the robot probes fixed surfaces."""


def parse_method(method: str) -> Method:
    """Split the name of a method into its parts."""
    if method == SPIRAL_SEARCH:
        return Method("uncorrected", spiral=True)
    if method.endswith(_PROBE):
        return Method(method.removesuffix(_PROBE), spiral=True, probe=True)
    return Method(method.removesuffix(_SPIRAL), spiral=method.endswith(_SPIRAL))


def check_method(method: str) -> str:
    """Return the canonical name of a method: `uncorrected+spiral` becomes `spiral-search`.

    Raises:
        InputError: The name is not `oracle`, `uncorrected`, `nominal`, `spiral-search`, a corrector, or `module:name`,
        with
            or without `+spiral` or `+probe`.
    """
    require_text("method", method)
    corrector, spiral, probe = parse_method(method)
    require(
        not spiral or not parse_method(corrector).spiral,
        f"the method '{method}' was given; use one of +spiral and +probe, which includes it, once, as in "
        "contact+probe.",
    )
    if ":" not in corrector:
        own = " Or give your own corrector as 'package.module:name'; +spiral or +probe may follow any of them."
        require_known("method", corrector or method, (*METHODS, SPIRAL_SEARCH), rest=own)
    return SPIRAL_SEARCH if spiral and not probe and corrector == "uncorrected" else method


def knows_truth(method: str) -> bool:
    """Return whether a method replays the true poses, so that neither noise nor human error affects it."""
    return parse_method(method).corrector == "oracle"


def is_uncorrected(method: str) -> bool:
    """Return whether a method replays the observed poses."""
    return parse_method(method).corrector == "uncorrected"


def uses_contacts(method: str) -> bool:
    """Return whether a method has a corrector, which uses contacts."""
    return parse_method(method).corrector not in WITHOUT_CORRECTOR


def may_reobserve(method: str) -> bool:
    """Return whether a method may observe operations again: a corrector that does so, or one of the user."""
    corrector = parse_method(method).corrector
    return corrector in REOBSERVING or ":" in corrector


def probes(method: str) -> bool:
    """Return whether the robot of a method probes, for which it has a force-torque sensor at its wrist."""
    return parse_method(method).probe


_AFFECTED_BY = MappingProxyType(  # setting -> whether it affects a method; all other settings affect all methods
    {
        "noise": lambda method: not knows_truth(method),
        "human_error_scale": lambda method: not knows_truth(method),
        "contact_source": uses_contacts,
        "max_reobservations": may_reobserve,
        "ft_sensor": probes,
        "assumed_robot_error": probes,
    }
)


def affects(setting: str, method: str) -> bool:
    """Return whether a setting affects a method."""
    return setting not in _AFFECTED_BY or _AFFECTED_BY[setting](method)


def resolve_simulated(corrector: Any) -> Any:
    """Return the function of a corrector that needs a simulator, if given by name; other correctors as they are."""
    known = isinstance(corrector, str) and corrector in SIMULATED
    return resolve(corrector, SIMULATED, "corrector") if known else corrector
