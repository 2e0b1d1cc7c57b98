"""Write the task cards and draw the relation graphs of all scenarios: `python docs/cards.py` (seconds)."""

from __future__ import annotations

from pathlib import Path

from apo_bench.assembly.graph import relation_graph
from apo_bench.scenario.file import load_scenario, scenario_names
from apo_bench.show.card import cards
from apo_bench.show.graph.drawing import draw_graph
from apo_bench.show.graph.text import graph_title

HERE = Path(__file__).parent
PAGE = HERE / "reference" / "scenarios.md"
PICTURE = "../pictures/graph_{}.png"


def main() -> None:
    scenarios = [load_scenario(name) for name in scenario_names()]
    PAGE.write_text(cards(scenarios, "python docs/cards.py", PICTURE), encoding="utf-8")
    for scenario in scenarios:
        graph = relation_graph(scenario.assembly)
        draw_graph(
            graph,
            PAGE.parent / PICTURE.format(scenario.name),
            title=graph_title(scenario.name, graph),
            colors=scenario.colors,
        )


if __name__ == "__main__":
    main()
