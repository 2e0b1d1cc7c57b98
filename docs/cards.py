"""Write the task cards, draw the relation graphs of all scenarios, and write what memory is worth into judge.md:
`python docs/cards.py` (seconds).
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.assembly import relation_graph
from apo_bench.scenario.file import load_scenario, scenario_names
from apo_bench.viz.card import cards
from apo_bench.viz.graph.drawing import draw_graph
from apo_bench.viz.graph.text import graph_title
from benchmarks.asks import HEAD, asks, by_heart
from benchmarks.baselines import kept

HERE = Path(__file__).parent
PAGE = HERE / "reference" / "scenarios.md"
PICTURE = "../pictures/graph_{}.png"
JUDGE = HERE / "how" / "judge.md"
FIRST = "<!-- by heart -->"
LAST = "<!-- end of by heart -->"
"""The page with what memory is worth, and the marks around that."""


def main() -> None:
    scenarios = [load_scenario(name) for name in scenario_names()]
    counts = kept()
    measured = {scenario.name: asks(scenario, counts) for scenario in scenarios}
    PAGE.write_text(cards(scenarios, "python docs/cards.py", PICTURE, HEAD, measured), encoding="utf-8")
    before, _, rest = JUDGE.read_text(encoding="utf-8").partition(FIRST)
    told = f"{before}{FIRST}\n{by_heart(scenarios, counts)}\n{LAST}{rest.partition(LAST)[2]}"
    JUDGE.write_text(told, encoding="utf-8")
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
