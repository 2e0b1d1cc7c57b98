"""The command `apo-bench inspect scene`: the scene of a scenario as one file of MuJoCo."""

from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.arguments import ScenarioArgument
from apo_bench.cli.outputs import check_outputs
from apo_bench.cli.setting_options import takes, trial_options
from apo_bench.io import write_file
from apo_bench.records import check, in_python
from apo_bench.scenario.file import load_scenario


@takes(trial_options("clearance_mm", "grasp", "arm", "timestep_s"))
def scene_command(
    scenario: ScenarioArgument, out: Annotated[Path, typer.Option(help="The MJCF file to write.")], **options: Any
) -> None:
    """Write the scene of a scenario as one MJCF file that opens in MuJoCo's viewer."""
    from apo_bench.simulation.scene.scene import scene_xml

    settings = in_python({name: value for name, value in options.items() if value is not None})
    for name, value in settings.items():
        check(name, value)
    loaded = load_scenario(scenario)
    check_outputs([(out, "--out", (".xml",))])
    write_file(out, scene_xml(loaded, **settings))
    typer.echo(f"Wrote {out}; open it with: python -m mujoco.viewer --mjcf={out}")
