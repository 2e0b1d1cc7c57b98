"""Make a scenario file from part files and the final poses of the parts."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from apo_bench.errors import require
from apo_bench.importers.assembly.choices import AssemblyChoices
from apo_bench.importers.assembly.new_scenario import NewScenario
from apo_bench.importers.assembly.posed_parts import UPS, read_posed
from apo_bench.importers.assembly.scenario_writer import write_scenario
from apo_bench.importers.assembly.up_axis import new_upright_scenario


def scenario_from_poses(
    poses: Path,
    parts: Sequence[str],
    out: Path,
    source: str,
    choices: AssemblyChoices,
    notes: Sequence[str] = (),
) -> NewScenario:
    """Choose base, order, starts and grasps of an assembly, write the scenario file, and return the scenario.

    Args:
        poses: A file of `[[pose]]` entries.
        parts: Part files; empty: part files next to the file of poses.
        source: Names of the files of the poses, for the header of the scenario file.
        notes: Sentences about the import of the parts, for comments of the scenario file.
    """
    require(choices.up is None or choices.up in UPS, f"up must be one of {', '.join(UPS)}, got {choices.up}.")
    # The parts are checked when the scenario is loaded.
    made = new_upright_scenario(read_posed(poses, list(parts), checked=False), choices)
    write_scenario(replace(made, notes=(*notes, *made.notes)), out, f"Assembly of {out.stem}", source)
    return made
