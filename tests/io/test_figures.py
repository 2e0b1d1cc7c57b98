"""Pictures do not depend on the settings of matplotlib of the person who draws."""

from __future__ import annotations

import matplotlib

from apo_bench.io.figures import use_figure_style


def test_figures_have_default_settings_and_those_of_before_come_back() -> None:
    with matplotlib.rc_context({"font.size": 33.0}):
        with use_figure_style({"lines.linewidth": 7.0}) as inside:
            assert inside.rcParams["font.size"] == 10.0
            assert inside.rcParams["lines.linewidth"] == 7.0
        assert matplotlib.rcParams["font.size"] == 33.0
