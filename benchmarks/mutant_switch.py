"""Switch the mutants of a copy on, one at a time: a module of the copy and a plugin of pytest.

The copy says `expression if not on(k) else mutant` at each place, so it is imported once for all mutants. First a fork
runs every test and notes which mutants each reaches; what a cache or a fixture computed for one test counts for all
that use it. Then a fork for each mutant, with it on, runs the tests that reach it, up to the first that fails.
"""

import json
import os
import signal
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property, wraps
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).parent
LOG = HERE / "reached.log"
LONGEST_S = 300  # tests that have not ended by then count as noticing: most such mutants never end
PACKAGE_S, ALL_S = 20.0, 30.0
"""What the tests run for one mutant took together, quickest first: those of its package, then of all packages."""

active = int(os.environ.get("MUTANT", "0"))
reader = os.environ.get("MUTANT_READER", "import")
"""The test, fixture or cache that code runs for, or import."""
noting = "MUTANT_NOTES" in os.environ
noted: set[tuple[str, str, str]] = set()
reports: list[pytest.TestReport] = []


def on(number: int) -> bool:
    """Whether a mutant is on; numbers count from 1."""
    if noting:
        note("reaches", reader, str(number))
    return number == active


def note(*what: str) -> None:
    if what not in noted:
        noted.add(what)  # type: ignore[arg-type]
        with LOG.open("a") as file:
            file.write("\t".join(what) + "\n")


@contextmanager
def reading(name: str) -> Iterator[None]:
    """What runs meanwhile is computed for all that read `name`."""
    global reader
    if noting:
        note("uses", reader, name)
    before, reader = reader, name
    try:
        yield
    finally:
        reader = before


def shared(cached: Any) -> Any:
    """A cached function or property of which every use is noted."""
    name = f"cache {getattr(cached, 'func', cached).__module__}.{getattr(cached, 'func', cached).__qualname__}"
    if isinstance(cached, cached_property):
        return SharedProperty(cached, name)

    @wraps(cached)
    def call(*arguments: Any, **options: Any) -> Any:
        with reading(name):
            return cached(*arguments, **options)

    call.__dict__.update(cache_clear=cached.cache_clear, cache_info=cached.cache_info)
    return call


class SharedProperty:
    """It has `__set__`, so that Python asks it although the value is kept in the object."""

    def __init__(self, cached: Any, name: str) -> None:
        self.cached = cached
        self.name = name
        self.__doc__ = cached.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self.cached.__set_name__(owner, name)

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        if instance is None:
            return self
        with reading(self.name):
            return self.cached.__get__(instance, owner)

    def __set__(self, instance: Any, value: Any) -> None:
        raise AttributeError(f"{self.name} cannot be set")


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    reports.append(report)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: Any) -> Iterator[None]:
    global reader
    os.environ["MUTANT_READER"] = reader = item.nodeid
    try:
        for fixtures in item._fixtureinfo.name2fixturedefs.values() if noting else ():
            note("uses", item.nodeid, name_of(fixtures[-1]))
        return (yield)
    finally:
        reader = "import"


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef: Any) -> Iterator[Any]:
    with reading(name_of(fixturedef)):
        return (yield)


def name_of(fixture: Any) -> str:
    return f"fixture {fixture.baseid} {fixture.argname}"


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """A mutant that is on while tests are imported has its tests from a file."""
    if active or not noting:
        numbers = {test: n for n, test in enumerate(json.loads((HERE / "chosen.json").read_text()))}
        items[:] = sorted((item for item in items if item.nodeid in numbers), key=lambda item: numbers[item.nodeid])


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> bool | None:
    """In the process that imports without any mutant: which tests reach which, and what comes of each."""
    global noting
    if not noting:
        return None
    forked(lambda: every_test(session.items), None)
    noting = False
    del os.environ["MUTANT_NOTES"]
    seconds = json.loads((HERE / "seconds.json").read_text())
    print(f"{len(seconds)} of {len(session.items)} tests pass, in {sum(seconds.values()):.0f} s", flush=True)
    reached = tests_of(LOG.read_text().splitlines())
    by_id = {item.nodeid: item for item in session.items}
    with (HERE / "outcomes.jsonl").open("w") as file:
        for number, package in json.loads((HERE / "mutants.json").read_text()):
            tests = {test for test in reached[str(number)] if test in seconds}
            early = "import" in reached[str(number)]
            if early:
                tests |= {test for test in seconds if test.startswith(f"tests/{package}/")}
            chosen = quickest(tests, seconds, package)
            outcome: dict[str, Any] = {"number": number, "tests": chosen, "early": early}
            if not early and chosen:
                items = [by_id[test] for test in chosen]
                outcome |= forked(lambda n=number, items=items: alone(n, items), LONGEST_S)  # type: ignore[misc]
            file.write(json.dumps(outcome) + "\n")
            file.flush()
    return True


def tests_of(lines: Sequence[str]) -> defaultdict[str, set[str]]:
    """Who reaches each mutant: those that run it, and those that use what they compute."""
    users: defaultdict[str, set[str]] = defaultdict(set)
    direct: defaultdict[str, set[str]] = defaultdict(set)
    for kind, by, what in (line.split("\t") for line in lines):
        (users if kind == "uses" else direct)[what].add(by)
    for readers in direct.values():
        fringe = list(readers)
        while fringe:
            more = users[fringe.pop()] - readers
            readers |= more
            fringe += more
    return direct


def quickest(tests: set[str], seconds: dict[str, float], package: str) -> list[str]:
    """Those of the package first, each group from the quickest on, for as long as there is time."""
    chosen: list[str] = []
    took = 0.0
    for of_package, limit in ((True, PACKAGE_S), (False, ALL_S)):
        group = [test for test in tests if test.startswith(f"tests/{package}/") == of_package]
        for test in sorted(group, key=lambda test: (seconds[test], test)):
            if chosen and took + seconds[test] > limit:
                break
            took += seconds[test]
            chosen.append(test)
    return chosen


def every_test(items: Sequence[pytest.Item]) -> int:
    """Write how long each test takes that passes."""
    for item, following in zip(items, [*items[1:], None], strict=True):
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
    seconds: defaultdict[str, float] = defaultdict(float)
    for report in reports:
        seconds[report.nodeid] += report.duration
    for report in reports:
        if not report.passed:
            seconds.pop(report.nodeid, None)
    (HERE / "seconds.json").write_text(json.dumps(seconds))
    return 0


def alone(number: int, items: Sequence[pytest.Item]) -> int:
    """Run tests with a mutant on; 1 when the first fails."""
    global active
    active = number
    os.environ["MUTANT"] = str(number)
    for item, following in zip(items, [*items[1:], None], strict=True):
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        if any(report.failed for report in reports):
            (HERE / "by").write_text(item.nodeid)
            return 1
    return 0


def forked(work: Callable[[], int], longest_s: float | None) -> dict[str, Any]:
    """Run a function in a fork, with all that it starts; return whether it returned 0."""
    (HERE / "by").write_text("")
    began = time.monotonic()
    process = os.fork()
    if not process:
        code = 2
        try:
            os.setsid()
            quiet = os.open(os.devnull, os.O_WRONLY)
            os.dup2(quiet, 1)
            os.dup2(quiet, 2)
            code = work()
        finally:
            os._exit(code)
    status = None
    while status is None:
        ended, code = os.waitpid(process, os.WNOHANG if longest_s else 0)
        if ended:
            status = code
        elif time.monotonic() - began > (longest_s or 0):
            os.killpg(process, signal.SIGKILL)
            status = os.waitpid(process, 0)[1]
            (HERE / "by").write_text(f"no end within {longest_s:g} s")
        else:
            time.sleep(0.02)
    seconds = round(time.monotonic() - began, 2)
    return {"passed": status == 0, "by": (HERE / "by").read_text(), "seconds": seconds}
