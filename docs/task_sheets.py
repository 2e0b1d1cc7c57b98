"""Write the task sheets of all scenarios and draw their relation graphs: `python docs/task_sheets.py` (seconds).

The table of how far nominal poses go, in docs/how/judge.md, is written too.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.assembly import build_relation_graph
from apo_bench.scenario import Scenario
from apo_bench.scenario.file import list_scenario_names, load_scenario
from apo_bench.viz.graph_picture import draw_graph
from apo_bench.viz.task_sheet import task_sheet
from benchmarks.baselines import HEAD, describe, describe_nominal, read_counts

HERE = Path(__file__).parent
PAGE = HERE / "reference" / "scenarios.md"
PICTURE = "../pictures/graph_{}.png"
JUDGE = HERE / "how" / "judge.md"
FIRST = "<!-- nominal -->"
LAST = "<!-- end of nominal -->"


def page(scenarios: Sequence[Scenario], measured: Mapping[str, str]) -> str:
    """The page of all task sheets.

    Args:
        measured: Scenario -> what was measured of it, in Markdown.
    """
    lines = [
        *(
            "<!-- Written by `python docs/task_sheets.py`; change the scenarios, not this page. -->",
            "",
            "# Scenarios",
            "",
        ),
        *(f"- [{s.name}](#{s.name}): {s.title} ({s.paper})" for s in scenarios),
        *("", "*Success* has [two verdicts](../how/judge.md).", "", HEAD),
    ]
    for s in scenarios:
        head, _, rest = task_sheet(s, 2).partition("\n\n")
        graph = f"![Relations of {s.name} after its last operation]({PICTURE.format(s.name)})"
        lines += ["", f'<a id="{s.name}"></a>', "", head, "", graph, "", rest.rstrip("\n")]
        lines += ["", "### Difficulty", "", measured[s.name]]
    return "\n".join(lines) + "\n"


def main() -> None:
    scenarios = [load_scenario(name) for name in list_scenario_names()]
    counts = read_counts()
    measured = {scenario.name: describe(scenario, counts) for scenario in scenarios}
    PAGE.write_text(page(scenarios, measured), encoding="utf-8")
    before, _, rest = JUDGE.read_text(encoding="utf-8").partition(FIRST)
    table = f"{FIRST}\n{describe_nominal(scenarios, counts)}\n{LAST}"
    JUDGE.write_text(before + table + rest.partition(LAST)[2], encoding="utf-8")
    for scenario in scenarios:
        graph = build_relation_graph(scenario.assembly)
        path = PAGE.parent / PICTURE.format(scenario.name)
        draw_graph(graph, path, f"{scenario.name} after operation {graph.step}", colors=scenario.colors)


if __name__ == "__main__":
    main()
