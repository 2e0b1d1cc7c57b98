"""The audit of the judge: what it says of states whose verdict a person gave before."""

from __future__ import annotations

import pytest

from tests.audited_states import LOOSE, STATES, Loose, Seen
from tests.end_states import verdict


@pytest.mark.parametrize("seen", STATES, ids=lambda seen: seen.what)
def test_a_person_says_the_same(seen: Seen) -> None:
    assert verdict(seen.scene(), seen.edits).success == seen.right


@pytest.mark.parametrize("seen", LOOSE, ids=lambda seen: seen.what)
def test_a_person_says_nearly(seen: Loose) -> None:
    found = verdict(seen.scene(), seen.edits)
    assert (found.success, found.loose_success) == (False, seen.nearly)
