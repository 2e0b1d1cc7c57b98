"""Predicted against real failure, as squares whose shade is a share: one for each method."""

from __future__ import annotations

from collections.abc import Sequence

from apo_bench.report.figures.chart import Panel
from apo_bench.report.page.markup import Html
from apo_bench.statistics.confusion import ALL, Confusion

SIDE, TOP, LEFT = 74, 34, 108
"""Of a square; where the first begins, px."""


def shade_panels(found: Sequence[Confusion]) -> list[Panel]:
    """A panel per method of which something was predicted, over all scenarios, and one of all methods."""
    groups: dict[str, list[Confusion]] = {}
    for one in found:
        groups.setdefault("all methods" if one.method == ALL else one.method, []).append(one)
    summed = {method: _sum(own) for method, own in groups.items()}
    return [_panel(method, counts) for method, counts in summed.items() if sum(map(sum, counts))]


Counts = tuple[tuple[int, int], tuple[int, int]]
"""Predicted to fit, predicted to fail: each fitted, failed."""


def _sum(own: Sequence[Confusion]) -> Counts:
    fits = sum(c.fit_fitted for c in own), sum(c.fit_failed for c in own)
    fails = sum(c.fail_fitted for c in own), sum(c.fail_failed for c in own)
    return fits, fails


def _panel(method: str, counts: Counts) -> Panel:
    n = sum(map(sum, counts))
    said = [
        f'<text x="{LEFT + SIDE * (j + 0.5)}" y="{TOP - 8}" text-anchor="middle">{word}</text>'
        for j, word in enumerate(("fitted", "failed"))
    ]
    for i, (word, line) in enumerate(zip(("predicted to fit", "predicted to fail"), counts, strict=True)):
        y = TOP + SIDE * i
        said.append(f'<text x="{LEFT - 8}" y="{y + SIDE / 2 + 4}" text-anchor="end">{word}</text>')
        for j, count in enumerate(line):
            x, share = LEFT + SIDE * j, count / n
            paint = "var(--m-right)" if i == j else "var(--m-wrong)"
            box = f'x="{x}" y="{y}" width="{SIDE - 2}" height="{SIDE - 2}"'
            said.append(f'<rect class="shade" {box} style="fill:{paint};fill-opacity:{0.08 + 0.55 * share:.2f}"/>')
            middle = f'x="{x + SIDE / 2 - 1}" text-anchor="middle"'
            said.append(f'<text {middle} y="{y + SIDE / 2}">{count:,}</text>')
            said.append(f'<text class="soft" {middle} y="{y + SIDE / 2 + 14}">{100 * share:.1f} %</text>')
    right = (counts[0][0] + counts[1][1]) / n
    said.append(f'<text class="soft" x="{LEFT + 2 * SIDE + 8}" y="{TOP + SIDE}">{100 * right:.1f} % right</text>')
    drawing = Html("".join(said))
    return Panel(f"{method}; n {n:,}", drawing, TOP + 2 * SIDE + 6)
