"""The command `apo-bench method list`."""

import typer

from apo_bench.cli.shared import Command, make_group, print_columns

_HELP = """
Methods: what makes the robot's plan from the observation.

Examples:
  apo-bench method list
  apo-bench run stick_in_tower --method contact+probe --robot-error hand_eye:0.5/0.1
"""
METHODS = {
    "uncorrected": "replays the observed poses as they are",
    "nominal": "fits the scenario's own poses to the observed ones, and ignores contacts",
    "oracle": "replays the true poses",
    "paper": "corrects the operations of violated contacts, as the paper does",
    "paper-track": "corrects after each operation, and undoes and repeats operations, as the paper does",
    "contact": "finds the most probable poses that make all contacts; warns if the noise does not explain them",
    "contact-refuse": "is `contact`, and refuses a correction that the noise does not explain",
    "contact-drop": "is `contact`, and drops the relation that is probably wrong",
    "contact-robust": "is `contact` for outliers, long tails and errors that operations share (default)",
    "least-squares": "minimises squared contact gaps plus squared deviations from the observed poses",
    "penalty": "descends on contact gaps, penetration and deviations from the observed poses",
    "snap": "moves each part onto its contacts, one operation after the other",
    "physics-settle": "drops each part where it was observed and takes the pose at which physics brings it to rest",
    "spiral-search": "is uncorrected+spiral",
}
"""Name -> description."""
commands = make_group("method", _HELP)


@commands.command("list", cls=Command)
def method_list() -> None:
    """List the methods.

    Examples:
      apo-bench method list
      apo-bench sweep stick_in_tower --method uncorrected,contact --out runs/mine
    """
    print_columns(list(METHODS.items()))
    typer.echo("\nOthers: package.module:name. After any of them, +spiral searches for holes in a spiral, and +probe")
    typer.echo("probes fixed surfaces to estimate the robot's own error.")
