"""The commands `apo-bench scenario list | card`: the scenarios that there are, and what one asks for."""

from __future__ import annotations

from typing import Annotated

import typer

from apo_bench.cli.setting_options import ScenarioArgument

scenario = typer.Typer(add_completion=False, rich_markup_mode=None, help="Scenarios: list, task cards.")


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.add_typer(scenario, name="scenario")
    app.command()(scenarios)


@scenario.callback(invoke_without_command=True)
def _without_command(context: typer.Context) -> None:
    """List the scenarios, or read the card of one."""
    if context.invoked_subcommand is None:
        list_scenarios()


@scenario.command("list")
def list_scenarios() -> None:
    """List the scenarios that come with the package."""
    from apo_bench.cli.terminal import print_scenarios
    from apo_bench.scenario.file import load_scenario, scenario_names

    print_scenarios([load_scenario(name) for name in scenario_names()])


@scenario.command()
def card(scenario: ScenarioArgument) -> None:
    """Print the task card of a scenario; the file is checked."""
    from apo_bench.scenario.file import load_scenario
    from apo_bench.show.card import scenario_card

    typer.echo(scenario_card(load_scenario(scenario)), nl=False)


def scenarios(
    scenario: Annotated[str | None, typer.Argument(help="Print the task card of this one; a name or a file.")] = None,
) -> None:
    """List the scenarios that come with the package, or print the task card of one."""
    if scenario is None:
        list_scenarios()
    else:
        card(scenario)
