"""The command `apo-bench inspect scene`: the scene of a scenario as one file of MuJoCo."""

from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.shared import ScenarioArgument, add_options, check_output, make_path_option, make_trial_options
from apo_bench.records import check, convert_to_python_units


@add_options(make_trial_options("clearance_mm", "grasp", "arm", "timestep_s"))
def scene_command(
    scenario: ScenarioArgument,
    out: Annotated[Path, make_path_option("Write the MJCF file: .xml.")],
    **options: Any,
) -> None:
    """Write the scene of a scenario as one MJCF file that opens in MuJoCo's viewer.

    Examples:
      apo-bench inspect scene stick_in_tower --out tower.xml
      apo-bench inspect scene peg_in_hole --arm panda_primitive --clearance-mm 0.4 --out peg.xml
    """
    from apo_bench import load_scenario
    from apo_bench.io import write_file
    from apo_bench.simulation.scene.scene import scene_xml

    check_output(out, "--out", ".xml")
    settings = convert_to_python_units({name: value for name, value in options.items() if value is not None})
    for name, value in settings.items():
        check(name, value)
    write_file(out, scene_xml(load_scenario(scenario), **settings))
    typer.echo(f"Wrote {out}; open it with: python -m mujoco.viewer --mjcf={out}")
