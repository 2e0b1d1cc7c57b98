"""Names of generated assemblies: `generated:SEED` and `generated:FAMILY:SEED`.

A generated assembly as files: a scenario and its parts, as a person would write them.

Families of assemblies: which stations stand on a board, and how many parts each has.
"""

import re
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.errors import InputError, require_known
from apo_bench.generated.assembled import BOARD, Assembled, Station, Table, lay, merged, shifted, split
from apo_bench.generated.bodies import TOP
from apo_bench.generated.linked import bridged, castled, grooved, keyed, pinned, threaded
from apo_bench.generated.stations import carried, corner, covered, peg, post
from apo_bench.io import write_file
from apo_bench.parts.making import Body, extrude, join, rectangle, write_part

_GAP = 10.0
_EDGE = 6.0
_LONGEST = 226.0
"""Of a board, which the arm reaches all over."""


class Kind(NamedTuple):
    """One kind of station."""

    make: Callable[[np.random.Generator, str, int], Station]
    """The station of a number, with so many parts."""
    least: int
    """Parts of it."""
    most: int


class Family(NamedTuple):
    """Assemblies of one kind."""

    title: str
    kinds: tuple[Kind, ...]
    """What may stand on the board."""
    sizes: tuple[int, int]
    """Least and most parts, the board among them."""
    weight: int
    """How often a seed without a family draws it, of the sum of all; 0: it is held out for tests."""
    needs_more: bool
    """Whether laying each part onto its newest contacts is not enough."""

    def draw(self, rng: np.random.Generator) -> Assembled:
        """One assembly of the family."""
        stations = list[Station]()
        while not stations or _length(stations) > _LONGEST:
            size = int(rng.integers(self.sizes[0], self.sizes[1] + 1)) - 1
            count = int(rng.integers(1, _MOST + 1))
            kinds = [self.kinds[int(k)] for k in rng.integers(len(self.kinds), size=count)]
            least = [kind.least for kind in kinds]
            most = [kind.most for kind in kinds]
            if sum(least) <= size <= sum(most):
                parts = split(rng, size, least, most)
                stations = [kind.make(rng, str(i), n) for i, (kind, n) in enumerate(zip(kinds, parts, strict=True), 1)]
        return assembled(self.title, stations, rng)


def _length(stations: Sequence[Station]) -> float:
    """Of the board that stations need."""
    return sum(station.length for station in stations) + _GAP * (len(stations) - 1) + 2 * _EDGE


def assembled(title: str, stations: Sequence[Station], rng: np.random.Generator) -> Assembled:
    """Stations beside each other on one board."""
    length = _length(stations)
    placed = list[Station]()
    x = _EDGE - length / 2
    for station in stations:
        placed.append(shifted(station, x + station.length / 2))
        x += station.length + _GAP
    bodies = [body for station in placed for body in station.bodies]
    ys = [float(np.abs(piece.corners[:, 1]).max()) for body in bodies for piece in body.pieces]
    deep = max(60.0, 2e3 * max(ys, default=0.0) + 2 * _EDGE)
    bores = [bore for station in placed for bore in station.bores]
    board = extrude(rectangle(length, deep), 0, TOP, bores=bores, bottom="bottom", top="top")
    parts: dict[str, Body] = {BOARD: join(board, *bodies) if bodies else board}
    fixed = {BOARD: (0.0, 0.0, 0.0)}
    for station in placed:
        parts |= station.parts
        fixed |= station.fixed
    return Assembled(title, parts, fixed, merged(rng, [station.acts for station in placed]))


_MOST = 4
"""Stations on a board."""
_CORNER = Kind(corner, 1, 3)
_PEG = Kind(peg, 1, 2)
_POST = Kind(post, 1, 3)
_COVERED = Kind(covered, 3, 9)
_PINNED = Kind(pinned, 3, 5)
_BRIDGED = Kind(bridged, 3, 9)
_KEYED = Kind(keyed, 3, 6)
_GROOVED = Kind(grooved, 3, 6)
_CARRIED = Kind(carried, 3, 3)
_CASTLED = Kind(castled, 3, 7)
_THREADED = Kind(threaded, 2, 3)
_EVERY = (_CORNER, _PEG, _POST, _COVERED, _PINNED, _BRIDGED, _KEYED, _GROOVED, _CARRIED)

FAMILIES: Mapping[str, Family] = {
    "corners": Family("Blocks in corners of walls, and piles of blocks", (_CORNER,), (3, 10), 2, False),
    "pegs": Family("Axles with collars in bores, and rings over them", (_PEG,), (3, 9), 2, False),
    "posts": Family("Plates over one post or two", (_POST,), (3, 10), 2, False),
    "covers": Family("A cover over axles, and rings on it", (_COVERED,), (4, 10), 2, False),
    "carried": Family("Axles that carry their rings from a stand", (_CARRIED,), (4, 10), 2, False),
    "pinned": Family("Loose plates that axles join", (_PINNED,), (4, 12), 3, True),
    "bridges": Family("Loose towers that plates join", (_BRIDGED,), (4, 10), 3, True),
    "keys": Family("Keys in a slot that a bar joins", (_KEYED,), (4, 12), 3, True),
    "grooves": Family("Keys with tilted faces that a bar joins", (_GROOVED,), (4, 12), 3, True),
    "mixed": Family("Stations of all kinds", _EVERY, (5, 12), 6, True),
    "castles": Family("Loose blocks that a stick in their slots joins", (_CASTLED,), (4, 8), 0, True),
    "rods": Family("Loose brackets that a level rod joins", (_THREADED,), (3, 4), 0, True),
}
"""Those with weight 0 are held out: no `generated:SEED` is one of them, nor has a kind of station of theirs."""


_DENSITY = 700.0
_FRICTION = (0.8, 0.005, 0.0001)
_SOURCE = "apo_bench.generated"
_LICENCE = "CC0-1.0"
_GREY = (0.45, 0.47, 0.50)
_COLORS = (
    (0.80, 0.36, 0.27),
    (0.27, 0.53, 0.78),
    (0.91, 0.79, 0.33),
    (0.36, 0.62, 0.42),
    (0.60, 0.62, 0.66),
    (0.62, 0.45, 0.70),
    (0.85, 0.58, 0.30),
)


def write(made: Assembled, table: Table, folder: Path, name: str) -> Path:
    """Write the files of an assembly; returns that of the scenario."""
    files = _stems(made.parts)
    for part, stem in files.items():
        if part == stem:
            write_part(
                part, made.parts[part], folder, density=_DENSITY, friction=_FRICTION, source=_SOURCE, licence=_LICENCE
            )
    path = folder / f"{name}.toml"
    write_file(path, "\n".join(_lines(made, table, files)) + "\n")
    return path


def _stems(parts: Mapping[str, Body]) -> Mapping[str, str]:
    """Part -> the first part that is the same body."""
    first: dict[int, str] = {}
    return {name: first.setdefault(id(body), name) for name, body in parts.items()}


def _lines(made: Assembled, table: Table, files: Mapping[str, str]) -> Iterable[str]:
    yield from ("schema = 1", f'title = "{made.title}"', 'paper = "generated"', "clearance_mm = 0.25", "gap_mm = 0.1")
    yield from ("", "[parts.table]", 'file = "table"', "fixed = true")
    for k, part in enumerate(made.parts):
        yield from ("", f"[parts.{part}]", f'file = "{files[part]}.xml"')
        color = _GREY if part in made.fixed else _COLORS[k % len(_COLORS)]
        yield f"color = {_list(color)}"
        if part in made.fixed:
            yield from ("fixed = true", "follows_site = true", f"start = {{ at_mm = {_list(made.fixed[part])} }}")
        else:
            yield f"start = {{ at_mm = {_list(table.starts[part])} }}"
    for act in made.acts:
        yield from ("", "[[operations]]", f'move = "{act.part}"')
        if act.carries:
            yield f"carries = {_names(act.carries)}"
        yield f"goal = {{ at_mm = {_list(act.at)} }}"
        yield f"contacts = [{', '.join(map(_names, act.contacts))}]"
        yield f'grasp = {{ at_mm = {_list(act.grasp)}, across = "{act.across}" }}'
        if act.vary_mm:
            varies = (f'{{ along = "{axis}", mm = [{-far:g}, {far:g}] }}' for axis, far in act.vary_mm)
            yield f"vary = [{', '.join(varies)}]"
    yield from ("", "[site]", f"center_mm = {_list(table.center)}", f"spread_mm = {_list(table.spread)}")
    yield f"yaw_deg = [{-table.yaw_deg:g}, {table.yaw_deg:g}]"


def _list(values: Iterable[float]) -> str:
    return "[" + ", ".join(f"{float(np.round(value, 4)) + 0.0:g}" for value in values) + "]"


def _names(words: Iterable[str]) -> str:
    return "[" + ", ".join(f'"{word}"' for word in words) + "]"


_PREFIX = "generated:"
_FAMILY_STREAM = 40
_ASSEMBLY_STREAM = 41
_NAME = re.compile(r"generated:(?:([a-z-]+):)?(\d{1,15})")


def is_generated(name: object) -> bool:
    """Whether a name is meant as that of a generated assembly."""
    return isinstance(name, str) and name.startswith(_PREFIX)


def whole_name(name: str) -> str:
    """The name with its family: of `generated:SEED` that which the seed draws.

    Raises:
        InputError: No such family, or no such seed.
    """
    match = _NAME.fullmatch(name)
    if match is None:
        raise InputError(
            f"the scenario '{name}' is not of the form generated:SEED or generated:FAMILY:SEED; give a whole number "
            "from 0 as seed."
        )
    family, seed = match.groups()
    if family is None:
        weights = np.array([each.weight for each in FAMILIES.values()], dtype=np.float64)
        rng = np.random.default_rng([int(seed), _FAMILY_STREAM])
        family = str(rng.choice(list(FAMILIES), p=weights / weights.sum()))
    require_known("family of generated assemblies", family, FAMILIES)
    return f"{_PREFIX}{family}:{int(seed)}"


def generated_file(name: str) -> Path:
    """The scenario file of a generated assembly, in a folder that lasts as long as this process.

    Raises:
        InputError: No such family, or no such seed.
    """
    return _written(whole_name(name))


@lru_cache(maxsize=1024)
def _written(name: str) -> Path:
    folder = Path(_folder().name) / name.replace(":", "_")
    folder.mkdir()
    return write_generated(name, folder)


@lru_cache(maxsize=1)
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="apo_bench_")


def write_generated(name: str, folder: Path) -> Path:
    """Write the files of a generated assembly; returns that of the scenario."""
    _, family, seed = whole_name(name).split(":")
    made, rng = _drawn(family, int(seed))
    return write(made, lay(made, rng), folder, f"{family}_{seed}")


def drawn(name: str) -> Assembled:
    """A generated assembly without a table.

    Raises:
        InputError: No such family, or no such seed.
    """
    _, family, seed = whole_name(name).split(":")
    return _drawn(family, int(seed))[0]


def _drawn(family: str, seed: int) -> tuple[Assembled, np.random.Generator]:
    rng = np.random.default_rng([seed, _ASSEMBLY_STREAM, *family.encode()])
    return FAMILIES[family].draw(rng), rng
