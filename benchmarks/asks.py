"""What a scenario asks for, as its card says it: the counts of benchmarks/results/baselines.csv, and what they mean."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from apo_bench.scenario.scenario import Scenario
from benchmarks.baselines import Count, Place

COLUMNS = (("oracle", 0.0), ("uncorrected", 2.0), ("snap", 2.0), ("snap+spiral", 2.0), ("contact", 2.0))
COLUMNS += (("nominal", 2.0), ("nominal", 4.0))
ENOUGH = 0.95
FEW = 0.5
"""Rates from which `snap` is enough, and up to which a scenario needs more."""
BY_HEART = 0.2
"""Rate up to which memory does not help."""
HEAD = """\
Each card says, under *What it asks for*, how often the [methods](methods.md) succeed: careful humans, a noise of 2 mm
and degrees (`nominal` at 4, too), the same seeds for every method; `apo-bench sweep benchmarks/baselines.toml --out
FOLDER`, then `python benchmarks/baselines.py FOLDER` and `python docs/cards.py`. `snap` puts each part onto its newest
contacts: where it is enough, neither loops of contacts nor history matter. `nominal` builds the assembly of the
scenario's file: where that is enough, no layout asks for more than one assembly that is right in itself.

There are many more: [a seed draws one](generated.md)."""


def asks(scenario: Scenario, counts: Mapping[Place, Count]) -> str:
    """A table, and what it means, in Markdown."""
    of = {(method, noise_level): counts[Place(scenario.name, method, noise_level)] for method, noise_level in COLUMNS}
    heads = [f"`{method}`" + (f" at {noise_level:g}" if noise_level else "") for method, noise_level in COLUMNS]
    lines = [f"| {' | '.join(heads)} |", "|" + "---|" * len(heads), f"| {' | '.join(map(str, of.values()))} |"]
    return "\n".join([*lines, "", f"- {_snap(of['snap', 2.0])}", f"- {_memory(scenario, of['nominal', 4.0])}"])


def _snap(count: Count) -> str:
    if count.rate >= ENOUGH:
        return "`snap` is enough: neither loops of contacts nor history matter."
    if count.rate <= FEW:
        return f"It needs more than `snap` ({count} at level 2): parts that were put down before have to move, too."
    return f"It needs more than `snap` in part of its layouts ({count} at level 2)."


def _memory(scenario: Scenario, count: Count) -> str:
    if count.rate <= BY_HEART:
        return f"Goals by heart fail ({count} at level 4): what is fixed to the table says where it stands."
    why = (
        "a layout moves its parts by less than half of a face, and half is what the judge asks for"
        if scenario.success_means == "as_demonstrated"
        else "it stands on the plain table alone, so whatever is right in itself is right anywhere, and no shift along "
        "faces of its size leaves less than half of the contacts that were shown"
    )
    return f"Goals by heart are enough ({count} at level 4): {why}."


def by_heart(scenarios: Iterable[Scenario], counts: Mapping[Place, Count]) -> str:
    """What memory is worth in each scenario, in Markdown: where it is enough first."""
    noise_level = COLUMNS[-1][1]
    own = {s.name: counts[Place(s.name, "nominal", noise_level)] for s in scenarios}
    found = sorted((-count.rate, name, count) for name, count in own.items())
    few = sum(count.rate <= BY_HEART for _, _, count in found)
    lines = [
        f"At {noise_level:g} mm and degrees, careful humans, memory succeeds in at most {100 * BY_HEART:g} % of the "
        f"trials in {few} of {len(found)} scenarios ([how this was measured](../reference/scenarios.md)):",
        "",
        "| scenario | `nominal` |",
        "|---|---|",
    ]
    return "\n".join([*lines, *(f"| `{name}` | {count} |" for _, name, count in found)])
