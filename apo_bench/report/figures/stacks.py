"""Where trials ended: for every method and level a bar of shares, success first, then the stages that failed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from apo_bench.records.method import knows_truth
from apo_bench.report.figures.chart import WIDTH, Entry, Panel, patch
from apo_bench.report.figures.paint import stage_paint, stages_in_order
from apo_bench.report.page.markup import Html, html
from apo_bench.statistics.rate_text import percent
from apo_bench.statistics.rates import Cell
from apo_bench.statistics.settings import Setting, level_of, level_words

LEFT, RIGHT, HIGH, STEP, APART = 138, 46, 11, 14, 5
"""Where bars begin and end, their height, from one to the next, and between methods, px."""
LETTER, SMALL = 6.4, 5.4
"""How wide letters of names and of levels are, px."""


def stages_of(cell: Cell) -> Counter[str]:
    """Stage -> failures."""
    found: Counter[str] = Counter()
    for why, count in cell.failures.items():
        found[why.partition(":")[0]] += count
    return found


def stage_entries(cells: Iterable[Cell]) -> list[Entry]:
    """The legend: success, and every stage at which a trial failed."""
    found = stages_in_order({stage for cell in cells for stage in stages_of(cell)})
    return [Entry(patch("var(--ok)"), "success"), *(Entry(patch(stage_paint(stage)), stage) for stage in found)]


def stack_panels(grouped: Mapping[Setting, Sequence[Cell]]) -> list[Panel]:
    """A panel per setting that has a trial that counts."""
    return [_panel(s, [c for c in cells if c.trials]) for s, cells in grouped.items() if any(c.trials for c in cells)]


def _panel(setting: Setting, cells: Sequence[Cell]) -> Panel:
    y, said, before = 6.0, [], ""
    above = any(_beside(cell, setting) > LEFT - 12 for cell in cells)
    for cell in cells:
        if cell.method != before:
            y += APART
            name = _short(cell.method, 48 if above else 16)
            said.append(f'<text x="0" y="{y + HIGH - 2:.0f}">{html(name)}</text>')
            y += STEP if above else 0.0
            before = cell.method
        said.append(_bar(cell, setting, y))
        y += STEP
    ends = "".join(
        f'<text class="soft" x="{_x(share):.1f}" y="{y + 12:.0f}" text-anchor="middle">{100 * share:.0f} %</text>'
        for share in (0.0, 0.5, 1.0)
    )
    middle = (LEFT + WIDTH - RIGHT) / 2
    what = f'<text class="soft" x="{middle}" y="{y + 26:.0f}" text-anchor="middle">share of trials</text>'
    return Panel(setting.title(), Html("".join(said) + ends + what), int(y + 32))


def _bar(cell: Cell, setting: Setting, y: float) -> str:
    level = _level(cell, setting)
    said = [f'<text class="soft" x="{LEFT - 6}" y="{y + HIGH - 2:.0f}" text-anchor="end">{html(level)}</text>']
    found, done = stages_of(cell), 0
    pieces = [("success", cell.successes, "var(--ok)")]
    pieces += [(stage, found[stage], stage_paint(stage)) for stage in stages_in_order(found)]
    for stage, count, paint in pieces:
        if count:
            left, right = _x(done / cell.trials), _x((done + count) / cell.trials)
            at = f"{cell.method}{f', level {level}' if level else ''}"
            tip = f"{at}: {stage} {count} of {cell.trials} ({percent(count / cell.trials)})"
            said.append(
                f'<rect x="{left:.1f}" y="{y:.0f}" width="{right - left:.1f}" height="{HIGH}" '
                f'style="fill:{paint}"><title>{html(tip)}</title></rect>'
            )
            done += count
    said.append(f'<text class="soft" x="{WIDTH - RIGHT + 5}" y="{y + HIGH - 2:.0f}">n {cell.trials}</text>')
    return "".join(said)


def _beside(cell: Cell, setting: Setting) -> float:
    """How much room a method's name and its level take beside each other, px; more than there is: it stands above."""
    return LETTER * len(_short(cell.method)) + SMALL * len(_level(cell, setting))


def _level(cell: Cell, setting: Setting) -> str:
    return "" if knows_truth(cell.method) else level_words(level_of(cell), setting.noise)


def _x(share: float) -> float:
    return LEFT + (WIDTH - LEFT - RIGHT) * share


def _short(name: str, letters: int = 16) -> str:
    """A name that fits beside its bars."""
    return name if len(name) <= letters else name[: letters - 1] + "…"
