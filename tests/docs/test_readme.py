"""README fits its limit, links to files that exist, and leaves the numbers to what writes them."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
MOST_LINES = 140


def test_it_is_short() -> None:
    assert len(README.splitlines()) <= MOST_LINES


def test_its_links_lead_somewhere() -> None:
    targets = re.findall(r"\]\(([^)\s]+)\)", README)
    local = [target for target in targets if not target.startswith(("https:", "../../actions/"))]
    assert len(local) > 30
    assert [target for target in local if not (ROOT / target.split("#")[0]).exists()] == []


def test_the_badge_is_of_a_workflow() -> None:
    (workflow, _) = re.findall(r"\.\./\.\./actions/workflows/([\w.]+)", README)
    assert (ROOT / ".github" / "workflows" / workflow).exists()


def test_rates_stand_only_in_tables_that_a_script_writes() -> None:
    written = re.sub(r"<!-- written by .*?<!-- until here", "", README, flags=re.DOTALL)
    assert re.findall(r"\d+ (?:%|of \d+)", written) == []
