"""Names of methods."""

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
"""The correctors that need an observation and nothing else."""
CORRECTOR = "contact-robust"
"""The default corrector."""
REOBSERVING = ("contact-robust",)
"""Correctors that may observe operations again."""
SIMULATED = MappingProxyType({"physics-settle": "apo_bench.simulation.scene.settling:settle"})
"""Correctors that need a simulator; `correct` does not know them, a trial does."""
WITHOUT_CORRECTOR = ("oracle", "uncorrected", "nominal")
"""Plans of the true poses, the observed poses, or the scenario's own poses fitted to the observed ones."""
METHODS = (*WITHOUT_CORRECTOR, *CORRECTORS, *SIMULATED)
"""Methods by name."""
SPIRAL_SEARCH = "spiral-search"
"""The observed poses, executed by a robot that searches for holes in a spiral."""
_SPIRAL = "+spiral"
"""After any other method: the robot searches for holes in a spiral."""
_PROBE = "+probe"
"""After any method: the robot probes fixed surfaces to estimate its own calibration error."""


class Method(NamedTuple):
    """A parsed method."""

    corrector: Any
    """What makes the plan: `oracle`, `uncorrected`, `nominal`, or a corrector, by name or itself."""
    spiral: bool = False
    """Whether the robot searches for holes in a spiral; one that probes does so as a last resort."""
    probe: bool = False
    """Whether the robot probes fixed surfaces."""


def parse_method(method: str) -> Method:
    """Parse the name of a method."""
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
    if ":" not in corrector:
        own = " Or give your own corrector as 'package.module:name'; +spiral or +probe may follow any of them."
        require_known("method", corrector or method, (*METHODS, SPIRAL_SEARCH), rest=own)
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


_AFFECTED_BY = MappingProxyType(
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
    """Whether a setting affects a method."""
    return setting not in _AFFECTED_BY or _AFFECTED_BY[setting](method)


def resolve_simulated(corrector: Any) -> Any:
    """What to pass to `correct`: the function, where a name stands for a corrector that needs a simulator."""
    known = isinstance(corrector, str) and corrector in SIMULATED
    return resolve(corrector, SIMULATED, "corrector") if known else corrector
