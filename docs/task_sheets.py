"""Write the page of scenarios and draw their relation graphs: `python docs/task_sheets.py` (seconds)."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.assembly import build_relation_graph
from apo_bench.scenario import Scenario
from apo_bench.scenario.scenario_file import list_scenario_names, load_scenario
from apo_bench.viz.graph_picture import draw_graph
from apo_bench.viz.task_sheet import write_task_sheet
from benchmarks.baselines import difficulty, read_counts

PAGE = Path(__file__).parent / "reference" / "scenarios.md"
PICTURE = "../pictures/graph_{}.png"
HEAD = """\
<!-- Written by `python docs/task_sheets.py`; change the scenarios, not this page. -->

# Scenarios

Choose a scenario here: how hard it is, then what happens in it. `apo-bench scenario show NAME` prints a task sheet,
`apo-bench view NAME` opens it. [Generated assemblies](generated.md) are further scenarios.

## Difficulty

Successes of the [methods](methods.md): no human error, noise of 2 mm and 2 degrees (1 sigma per axis; `nominal` also
at 4), the same seeds for every method.

{table}

- Where `snap` succeeds, neither loops of contacts nor history matter. Elsewhere parts that were placed before have to
  move.
- Where `nominal` succeeds at 4 mm, the assembly stands on the plain table alone, and layouts move its parts by less
  than half of a face. Elsewhere fixed parts determine where it stands.

`apo-bench sweep benchmarks/baselines.toml --out FOLDER`, `python benchmarks/baselines.py FOLDER` and `python
docs/task_sheets.py` make the numbers.

## Reading a task sheet

The numbered lines are the operations: the moved part, then each relation with its pairs of faces, then the relations
that end. *Human error* holds at `human_error_scale` 1, to either side; the human adjusts it at the last operation,
unobserved. *Layout* is where the assembly stands on the table, and what each trial draws. The
[judge](../how/judge.md) explains success and fixtures.
"""


def page(scenarios: Sequence[Scenario]) -> str:
    """Return the page of all task sheets."""
    lines = [HEAD.format(table=difficulty(scenarios, read_counts()))]
    for s in scenarios:
        head, _, rest = write_task_sheet(s, 2).partition("\n\n")
        graph = f"![Relations of {s.name} after its last operation]({PICTURE.format(s.name)})"
        lines += [f'<a id="{s.name}"></a>', "", head, "", graph, "", rest]
    return "\n".join(lines)


def main() -> None:
    scenarios = [load_scenario(name) for name in list_scenario_names()]
    PAGE.write_text(page(scenarios), encoding="utf-8")
    for scenario in scenarios:
        graph = build_relation_graph(scenario.assembly)
        path = PAGE.parent / PICTURE.format(scenario.name)
        draw_graph(graph, path, f"{scenario.name} after operation {graph.step}", colors=scenario.colors)


if __name__ == "__main__":
    main()
