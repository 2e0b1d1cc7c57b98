"""Names of what a user brings: short, `module:name`, or the object itself."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from apo_bench import InputError
from apo_bench.names import folder_of_own_modules, own_modules_in, resolve


def test_only_a_module_that_is_named_and_what_it_imports_are_found_in_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "modules", sys.modules.copy())
    (tmp_path / "named_one.py").write_text("import named_beside\n\ndef thing():\n    return named_beside.__name__\n")
    (tmp_path / "named_beside.py").write_text("")
    (tmp_path / "stranger_one.py").write_text("")
    with own_modules_in(str(tmp_path)):
        assert folder_of_own_modules() == str(tmp_path)
        assert resolve("named_one:thing", {}, "thing")() == "named_beside"
        with pytest.raises(ImportError):
            __import__("stranger_one")
    assert folder_of_own_modules() == ""
    assert str(tmp_path) not in sys.path


def test_what_cannot_be_resolved_is_one_sentence() -> None:
    for given, words in (
        ("papr", "unknown corrector 'papr'; did you mean 'paper'"),
        ("no_such_module:thing", "cannot be imported"),
        ("apo_bench.names:resolv", "unknown corrector in module apo_bench.names 'resolv'; did you mean 'resolve'"),
        (":thing", "is not of the form 'package.module:name'"),
    ):
        with pytest.raises(InputError, match=words):
            resolve(given, {"paper": "apo_bench.names:resolve"}, "corrector")
    assert resolve(len, {}, "corrector") is len
