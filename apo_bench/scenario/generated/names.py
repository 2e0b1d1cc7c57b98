"""Generate and write an assembly from its name: `generated:SEED` or `generated:FAMILY:SEED`."""

import re
import tempfile
from functools import lru_cache
from pathlib import Path

import numpy as np

from apo_bench.errors import InputError, require_known
from apo_bench.scenario.generated.assembly import GeneratedAssembly
from apo_bench.scenario.generated.families import FAMILIES
from apo_bench.scenario.generated.table_layout import lay_out_table
from apo_bench.scenario.generated.writing import write_assembly

_PREFIX = "generated:"
_FAMILY_STREAM = 40
"""Added to a seed for the generator that draws the family."""
_ASSEMBLY_STREAM = 41
"""Added to a seed for the generator that draws the assembly."""
_NAME = re.compile(r"generated:(?:([a-z-]+):)?(\d{1,15})")


def is_generated(name: object) -> bool:
    """Return True if a name begins with `generated:`."""
    return isinstance(name, str) and name.startswith(_PREFIX)


def complete_name(name: str) -> str:
    """Return the name with its family; for `generated:SEED` the seed draws the family.

    Raises:
        InputError: The family is unknown, or the name has another form.
    """
    match = _NAME.fullmatch(name)
    if match is None:
        raise InputError(
            f"the scenario '{name}' is not of the form generated:SEED or generated:FAMILY:SEED; give a whole number "
            "from 0 as seed."
        )
    family, seed = match.groups()
    if family is None:
        weights = np.array([each.weight for each in FAMILIES.values()], dtype=np.float64)
        rng = np.random.default_rng([int(seed), _FAMILY_STREAM])
        family = str(rng.choice(list(FAMILIES), p=weights / weights.sum()))
    require_known("family of generated assemblies", family, FAMILIES)
    return f"{_PREFIX}{family}:{int(seed)}"


def make_generated_file(name: str) -> Path:
    """Return the path of the scenario file of a generated assembly, in a folder that is deleted with this process.

    Raises:
        InputError: The family is unknown, or the name has another form.
    """
    return _write_once(complete_name(name))


@lru_cache(maxsize=1024)
def _write_once(name: str) -> Path:
    """Write the files of a complete name at the first call, and return the path of the scenario file."""
    folder = Path(_get_temporary_folder().name) / name.replace(":", "_")
    folder.mkdir()
    return write_generated(name, folder)


@lru_cache(maxsize=1)
def _get_temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """The temporary folder of this process."""
    return tempfile.TemporaryDirectory(prefix="apo_bench_")


def write_generated(name: str, folder: Path) -> Path:
    """Write the files of a generated assembly, and return the path of the scenario file."""
    assembly, rng = generate_assembly(name)
    return write_assembly(assembly, lay_out_table(assembly, rng), folder, "_".join(complete_name(name).split(":")[1:]))


def generate_assembly(name: str) -> tuple[GeneratedAssembly, np.random.Generator]:
    """Generate an assembly without the layout of its table.

    Returns:
        The assembly, and the generator in the state from which it draws the layout.

    Raises:
        InputError: The family is unknown, or the name has another form.
    """
    _, family, seed = complete_name(name).split(":")
    rng = np.random.default_rng([int(seed), _ASSEMBLY_STREAM, *family.encode()])
    return FAMILIES[family].draw(rng), rng
