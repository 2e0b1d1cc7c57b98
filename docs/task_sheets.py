"""Write the task sheets of all scenarios and draw their relation graphs: `python docs/task_sheets.py` (seconds).

The table of how far nominal poses go, in docs/how/judge.md, is written too.
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
from benchmarks.baselines import HEAD, describe, describe_nominal, read_counts

HERE = Path(__file__).parent
PAGE = HERE / "reference" / "scenarios.md"
PICTURE = "../pictures/graph_{}.png"
JUDGE = HERE / "how" / "judge.md"
FIRST = "<!-- nominal -->"
LAST = "<!-- end of nominal -->"


def main() -> None:
    scenarios = [load_scenario(name) for name in scenario_names()]
    counts = read_counts()
    measured = {scenario.name: describe(scenario, counts) for scenario in scenarios}
    PAGE.write_text(cards(scenarios, "python docs/task_sheets.py", PICTURE, HEAD, measured), encoding="utf-8")
    before, _, rest = JUDGE.read_text(encoding="utf-8").partition(FIRST)
    table = f"{FIRST}\n{describe_nominal(scenarios, counts)}\n{LAST}"
    JUDGE.write_text(before + table + rest.partition(LAST)[2], encoding="utf-8")
    for scenario in scenarios:
        graph = relation_graph(scenario.assembly)
        path = PAGE.parent / PICTURE.format(scenario.name)
        draw_graph(graph, path, title=graph_title(scenario.name, graph), colors=scenario.colors)


if __name__ == "__main__":
    main()
