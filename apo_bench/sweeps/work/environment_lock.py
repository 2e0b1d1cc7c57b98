"""The environment lock of a sweep: what all its rows are made with, wherever they are made.

What passes between a sweep and its workers, whichever executor it has: units of work, messages, the wish to stop.

Messages are tuples whose first item is a word:

("began",)              a trial begins; its scene is compiled and its corrector imported, so its time counts now
("row", row, timing)    it has ended
("done",)               the unit of work has ended
("refused", sentence)   the request cannot be honoured; nothing follows
("failed", text)        a trial could not be run; nothing follows
"""

import platform
import signal
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from types import FrameType
from typing import Any, final

from apo_bench.correction.correctors import checked_corrector
from apo_bench.errors import InputError, require
from apo_bench.observation.noise import Level, make_noise
from apo_bench.observation.relations import make_relations
from apo_bench.records import RECOGNISED, UNCORRECTED, TrialSettings, parsed, with_simulated
from apo_bench.scenario import Scenario, load_scenario
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.trial.fingerprint import content_hash
from apo_bench.trial.inputs import noise_content, own_content

_PACKAGES = (
    *("apo_bench", "mujoco", "mink", "daqp", "gymnasium"),
    *("numpy", "scipy", "trimesh", "manifold3d", "shapely"),
)
"""The packages whose version may show in a row."""
_OPTIONAL = ("numba",)
"""The same, and without them rows are only rounded otherwise."""


@final
@dataclass(frozen=True)
class Names:
    """What the trials of a sweep name, each once."""

    arm: str
    scenarios: tuple[str, ...]
    """The scenarios as they were given."""
    methods: tuple[str, ...]
    relations: tuple[str, ...]
    noises: Mapping[str, float]
    """Noise model -> the highest level that it has [mm, degrees]."""

    def check(self) -> None:
        """Raise an `InputError` unless methods, relations and noise models can be had here."""
        for noise, highest in self.noises.items():
            make_noise(noise, Level(highest, highest))
        for relations in self.relations:
            if relations not in RECOGNISED:
                make_relations(relations)
        for plan in {parsed(method).plan: None for method in self.methods}:
            if plan not in UNCORRECTED:
                checked_corrector(with_simulated(plan))

    def hashes(self) -> dict[str, str]:
        """Of noise files and of the modules of `module:name`, as they are here: what it is -> its hash."""
        return {
            **noise_content(*self.noises),
            **own_content("relations", *self.relations),
            **own_content("method", *self.methods),
            **own_content("arm", self.arm),
        }


@final
@dataclass(frozen=True)
class EnvironmentLock:
    """Stated by the process that starts a sweep; a worker that finds anything else where it is refuses to work."""

    content: Mapping[str, str]
    """What was given for a scenario -> its `content_hash`."""
    versions: Mapping[str, str]
    """Package -> version, of the packages that a result depends on."""
    names: Names | None = None
    """None where everything is on one machine."""
    hashes: Mapping[str, str] = field(default_factory=dict)
    """Of `names`."""

    def check_here(self) -> None:
        """Raise an `InputError` unless trials run on this machine as where the sweep was started."""
        self.check_versions()
        if self.names is None:
            return
        self.names.check()
        here = self.names.hashes()
        for name, content in self.hashes.items():
            require(
                here.get(name) == content, f"the file behind the {name} is another one there; use the same everywhere."
            )
        arm = find_arm(self.names.arm)
        for source in self.names.scenarios:
            self.check_content(source, content_hash(load_scenario(source), source, arm.files))

    def check_content(self, source: str, content: str) -> None:
        """Raise an `InputError` unless a scenario, and the code that runs it, are the same here."""
        require(
            content == self.content[source],
            f"a worker on '{platform.node()}' has other code or other files for '{source}' than the process that "
            "started the sweep; install the same everywhere, or start the same command again if a file was changed.",
        )

    def check_versions(self) -> None:
        """Raise an `InputError` unless the packages are the same here."""
        here = versions()
        for package, version in self.versions.items():
            require(
                here.get(package) == version,
                f"a worker on '{platform.node()}' has {package} {here.get(package)}, the process that started the "
                f"sweep {version}; install the same everywhere.",
            )


def environment_lock(
    names: Names,
    loaded: Mapping[str, Scenario],
    arm_files: Path | tuple[Path, ...],
) -> EnvironmentLock:
    """The lock of a sweep that is started here.

    Args:
        loaded: Every scenario by what was given for it.
    """
    content = {source: content_hash(scenario, source, arm_files) for source, scenario in loaded.items()}
    return EnvironmentLock(content, versions(), names, names.hashes())


def versions() -> dict[str, str]:
    """Package -> version, as installed here; `none` of an optional one that is not."""
    return {package: metadata.version(package) for package in _PACKAGES} | {
        package: metadata.version(package) if find_spec(package) else "none" for package in _OPTIONAL
    }


Message = tuple[Any, ...]


@final
@dataclass(frozen=True)
class Unit:
    """Trials of one scenario, clearance, seed, carelessness and eye: they share layout and demonstration."""

    trials: tuple[TrialSettings, ...]


def last_message(error: Exception) -> Message:
    """What a worker says that cannot go on."""
    if isinstance(error, InputError):
        return "refused", str(error)
    return "failed", f"a trial could not be run:\n{''.join(traceback.format_exception(error))}"


def checked(message: Message) -> Message:
    """The message, unless it is one after which nothing follows.

    Raises:
        InputError: The request cannot be honoured.
        RuntimeError: A trial could not be run.
    """
    kind, *content = message
    if kind == "refused":
        raise InputError(*content)
    if kind == "failed":
        raise RuntimeError(*content)
    return message


SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
Check = Callable[[], None]
"""Raises `Stopped` if this process was asked to stop; to be called where stopping is clean."""


@final
class Stopped(KeyboardInterrupt):
    """A signal asked this process to stop."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


def never() -> None:
    """Nobody asks."""


@contextmanager
def listening() -> Iterator[Check]:
    """Take note of signals that ask for an end; what is yielded raises `Stopped` once one came.

    A second signal raises at once, wherever the program is. Signals that were ignored or had a handler of the caller's
    own before stay as they are, and so do all of them outside the main thread.
    """
    came: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        came.append(number)
        if len(came) > 1:
            raise Stopped(number)

    def check() -> None:
        if came:
            raise Stopped(came[0])

    ours = SIGNALS if threading.current_thread() is threading.main_thread() else ()
    usual = (signal.SIG_DFL, signal.default_int_handler)
    before: dict[int, Any] = {number: found for number in ours if (found := signal.getsignal(number)) in usual}
    for number in before:
        signal.signal(number, note)
    try:
        yield check
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
