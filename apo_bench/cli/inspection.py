"""The command group `apo-bench inspect`."""

from collections.abc import Callable, Mapping

from apo_bench.cli.inspect_depth import depth_command
from apo_bench.cli.inspect_dof import dof_command
from apo_bench.cli.inspect_graph import graph_command
from apo_bench.cli.inspect_plan import plan_command
from apo_bench.cli.inspect_poses import poses_command
from apo_bench.cli.inspect_scene import scene_command
from apo_bench.cli.shared import Command, make_group

_HELP = """
Inspect one assembly: free directions, motions, relations, scene, poses, depth images.

Examples:
  apo-bench inspect dof stick_in_tower
  apo-bench inspect graph stick_in_tower --out graph.svg
"""
_COMMANDS: Mapping[str, Callable[..., None]] = {
    "dof": dof_command,
    "plan": plan_command,
    "graph": graph_command,
    "scene": scene_command,
    "poses": poses_command,
    "depth": depth_command,
}
commands = make_group("inspect", _HELP)
for _name, _command in _COMMANDS.items():
    commands.command(_name, cls=Command)(_command)
