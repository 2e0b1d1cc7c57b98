"""A built package is tried with the programs of README."""

from __future__ import annotations

from benchmarks.empty_environment import readme_programs


def test_the_programs_of_readme_make_an_environment_and_evaluate_a_function() -> None:
    loop, function = readme_programs()
    assert "gymnasium.make" in loop
    assert "apo_bench.evaluate" in function
    compile(f"{loop}\n{function}", "README.md", "exec")
