"""Arms by name: those that come with the benchmark, those of a file, of a collection, of a module."""

from apo_bench.errors import InputError, unknown
from apo_bench.names import resolve
from apo_bench.records.short_names import FOREIGN_ARMS
from apo_bench.resources import folder
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.building import read_arm
from apo_bench.simulation.arms.foreign import find_foreign

NAMES = ("six_axis", "ur5e_primitive", "panda_primitive")
"""Arms that come with the benchmark, as arm files."""


def arm_names() -> tuple[str, ...]:
    """The short names of arms."""
    return NAMES


def find_arm(given: str | Arm) -> Arm:
    """An arm by short name, `module:name`, or as the object itself."""
    if isinstance(given, Arm):
        return given
    if given.endswith(".toml"):
        return read_arm(given)
    if given in NAMES:
        return read_arm(folder("assets") / "arms" / f"{given}.toml")
    if given.startswith(FOREIGN_ARMS):
        return find_foreign(given)
    if ":" in given:
        made = resolve(given, {}, "arm")
        try:
            made = made() if callable(made) else made
        except Exception as error:
            raise InputError(
                f"the arm '{given}' failed: it raised {error!r}; give a function without arguments."
            ) from error
        if not isinstance(made, Arm):
            raise InputError(f"the arm '{given}' is a {type(made).__name__}; an `Arm`, or a function that returns one.")
        return made
    known = unknown("arm", given, NAMES)
    raise InputError(
        f"{known} Or give your own as FILE.toml, menagerie:NAME, robosuite:NAME, or 'package.module:name'."
    )
