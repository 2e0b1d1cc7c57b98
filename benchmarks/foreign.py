"""What becomes of assemblies that others drew: `python benchmarks/foreign.py benchmarks/foreign.json FOLDER`.

FOLDER holds the repositories of the list as git has them, each at OWNER+NAME/repo, OWNER+NAME or OWNER/NAME; nothing is
loaded from elsewhere, and every file must have the hash of the list. Each assembly has a process of its own: its files
are imported together, so that pieces are fine where parts come near; a scenario is drafted from the poses without a
hand and checked; `oracle`, `contact`, `snap` and `none` are run at 1 mm and 1 degree. Lines are kept in --out; what is
there is not done again. The table is printed; --page writes what --out has as a page.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import multiprocessing
import re
import resource
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from apo_bench.assembly import contact_kind
from apo_bench.errors import InputError
from apo_bench.geometry import pose
from apo_bench.importers.assembly.checking import check_file
from apo_bench.importers.assembly.from_cad import import_solid, solids_at
from apo_bench.importers.assembly.posed import read_posed
from apo_bench.importers.assembly.upright import new_upright_scenario
from apo_bench.importers.assembly.writing import write_scenario
from apo_bench.importers.cad.assembled import coming_near
from apo_bench.importers.cad.places import named_places, write_places
from apo_bench.importers.cad.solids.raw_solid import RawSolid, SolidPlace
from apo_bench.records import TrialConfig
from apo_bench.scenario.file import load_scenario
from apo_bench.scenario.parts import load_part
from apo_bench.trial.stages import scene_of
from apo_bench.trial.trial import run_trial
from benchmarks.foreign_table import METHODS, came_to, page, table

HALVES = ("open", "held out")


class ForeignFile(NamedTuple):
    """A file of a repository, and where the assembly has it."""

    path: str
    sha256: str
    unit: str | None
    places: tuple[np.ndarray, ...]
    """(4, 4) each, of the frame of the file, [m]."""


class Foreign(NamedTuple):
    """One assembly of the list."""

    name: str
    repository: str
    commit: str
    half: str
    files: tuple[ForeignFile, ...]


def read_list(path: Path) -> tuple[Foreign, ...]:
    """The assemblies of a list, in its order."""
    listed = json.loads(path.read_text(encoding="utf-8"))["assemblies"]
    return tuple(
        Foreign(
            each["name"],
            each["repository"],
            each["commit"],
            each["half"],
            tuple(
                ForeignFile(
                    file["path"],
                    file["sha256"],
                    file.get("unit"),
                    tuple(
                        pose.unpack(np.array([*np.multiply(1e-3, place["at_mm"]), *place["quaternion_wxyz"]]))
                        for place in file["places"]
                    ),
                )
                for file in each["files"]
            ),
        )
        for each in listed
    )


def taken_out(folder: Path, each: Foreign, to: Path) -> list[Path]:
    """Write the files of an assembly out of its repository.

    Raises:
        InputError: The repository is not there, or a file is not that of the list.
    """
    both = each.repository.replace("/", "+")
    places = (folder / both / "repo", folder / both, folder / each.repository / ".git", folder / each.repository)
    git = next((place for place in places if (place / "HEAD").exists()), None)
    if git is None:
        raise InputError(f"{folder}: {each.repository} is not there; put its git directory at {places[0]}.")
    to.mkdir(parents=True, exist_ok=True)
    paths = []
    for file in each.files:
        command = ["git", f"--git-dir={git}", "cat-file", "blob", f"{each.commit}:{file.path}"]
        raw = subprocess.run(command, capture_output=True, check=False).stdout
        if hashlib.sha256(raw).hexdigest() != file.sha256:
            raise InputError(f"{git}: {file.path} at {each.commit} is not the file of the list.")
        paths.append(to / re.sub(r"[^A-Za-z0-9_.]+", "_", Path(file.path).name))
        paths[-1].write_bytes(raw)
    return paths


def imported(each: Foreign, paths: Sequence[Path], folder: Path) -> tuple[list[dict[str, Any]], Path | None]:
    """What became of each file, and where all parts are; None if a file was refused."""
    lines: list[dict[str, Any]] = [
        {"file": path.name, "solids": 0, "flat": 0, "round": 0, "no_contact": 0, "seconds": 0.0} for path in paths
    ]
    found: list[tuple[int, RawSolid]] = []
    for k, file in enumerate(each.files):
        places = [np.concatenate([T[:3] * [1.0, 1.0, 1.0, 1e3], T[3:]]) for T in file.places]
        with _said_of(lines[k], paths[k]):
            found += [(k, raw) for raw in solids_at(paths[k], file.unit, places)]
    raws = [raw for _, raw in found]
    made: dict[str, list[SolidPlace]] = {}
    for (k, raw), others in zip(found, coming_near(raws), strict=True):
        with _said_of(lines[k], paths[k]):
            part = import_solid(raw, others, folder, paths[k].name, made)
            made[part.name] = part.places
            solid = load_part(folder / f"{part.name}.xml", checked=False)  # as it has just been
            for key, more in (("solids", 1), ("flat", len(solid.faces)), ("round", len(solid.rounds))):
                lines[k][key] += more
            lines[k]["no_contact"] += sum("can make no contact" in sentence for sentence in part.said)
    if any("refused" in line for line in lines):
        return lines, None
    return lines, write_places(named_places(made), folder, each.repository)


@contextmanager
def _said_of(line: dict[str, Any], path: Path) -> Iterator[None]:
    begin = time.process_time()
    try:
        yield
    except InputError as error:
        line["refused"] = str(error).replace(f"{path.parent}/", "")
    except Exception as error:  # a failure of ours, and said as one
        line["refused"] = f"{type(error).__name__}: {error}"
    line["seconds"] = round(line["seconds"] + time.process_time() - begin, 1)


def became(each: Foreign, mirror: Path, folder: Path, seeds: int) -> Iterator[dict[str, Any]]:
    """All that is tried with one assembly, line after line, until it ends."""
    paths = taken_out(mirror, each, folder / "files")
    lines, poses = imported(each, paths, folder)
    yield from lines
    if poses is None:
        return
    begin = time.process_time()
    path = folder / f"{each.name}.toml"
    try:
        made = new_upright_scenario(read_posed(poses))
        write_scenario(made, path, each.name, each.repository)
        scenario = load_scenario(path)
    except (InputError, RuntimeError) as error:
        yield {"draft": str(error), "seconds": round(time.process_time() - begin, 1)}
        return
    contacts = [
        str(contact_kind(*map(scenario.assembly.face_of, contact)))
        for operation in scenario.assembly.operations
        for contact in operation.contacts
    ]
    yield {
        "draft": "",
        "up": made.up,
        "parts": len(made.parts),
        "contacts": {kind: contacts.count(kind) for kind in sorted(set(contacts))},
        "notes": list(made.notes),
        "seconds": round(time.process_time() - begin, 1),
    }
    found = tuple(check_file(path, 0))
    yield {"wrong": [finding.sentence for finding in found if not finding.ok]}
    # What has no way or no grasp is not run; a part that may not stand is, so that it is known whether that is true.
    if any(finding.what in ("file", "gripper") and not finding.ok for finding in found):
        return
    asked = [TrialConfig(str(path), method=method, seed=seed) for seed in range(seeds) for method in METHODS]
    scene = scene_of(asked[0]) if asked else None
    for settings in asked:
        row = run_trial(settings, scene)
        yield {
            "method": settings.method,
            "seed": settings.seed,
            "success": row["success"],
            "code": row["failure_code"],
            "sentence": row["sentence"],
        }


def _alone(each: Foreign, mirror: Path, folder: Path, seeds: int, limit_s: int, out: Path) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s))
    with out.open("a", encoding="utf-8") as file:
        try:
            for line in became(each, mirror, folder, seeds):
                file.write(json.dumps({"assembly": each.name, **line}) + "\n")
                file.flush()
        except Exception as error:  # a failure of ours, and said as one
            said = f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}"
            file.write(json.dumps({"assembly": each.name, "failed": said}) + "\n")


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("list", type=Path)
    asked.add_argument("folder", type=Path, help="where the repositories are")
    asked.add_argument("--half", choices=HALVES, help="only this half")
    asked.add_argument("--only", nargs="*", help="only these assemblies")
    asked.add_argument("--out", type=Path, default=Path("foreign.jsonl"), help="lines; parts and scenarios lie beside")
    asked.add_argument("--seeds", type=int, default=5)
    asked.add_argument("--limit", type=int, default=900, help="time of the processor of one assembly, s")
    asked.add_argument("--page", type=Path, help="write the table as this page, of what --out has; nothing is run")
    given = asked.parse_args()
    chosen = [
        each
        for each in read_list(given.list)
        if given.half in (None, each.half) and (not given.only or each.name in given.only)
    ]
    if given.page:
        there = [(each.name, each.half, own) for each in chosen if (own := _own(given.out, each.name))]
        given.page.write_text(page(there, Counter(each.half for each in chosen)), encoding="utf-8")
        return
    ended = {line["assembly"] for line in _lines(given.out) if line.get("ended", -1) >= given.seeds}
    for each in chosen:
        if each.name in ended:
            continue
        folder = given.out.with_suffix("") / each.name
        # A line that ends an assembly says that those before it are whole; what was begun is begun again.
        kept = [line for line in _lines(given.out) if line["assembly"] != each.name]
        given.out.write_text("".join(json.dumps(line) + "\n" for line in kept), encoding="utf-8")
        rest = (each, given.folder, folder, given.seeds, given.limit, given.out)
        child = multiprocessing.get_context("fork").Process(target=_alone, args=rest)
        child.start()
        child.join()
        with given.out.open("a", encoding="utf-8") as file:
            if child.exitcode:
                stopped = f"stopped after {given.limit} s of the processor" if child.exitcode < 0 else "it ended"
                file.write(json.dumps({"assembly": each.name, "failed": stopped}) + "\n")
            file.write(json.dumps({"assembly": each.name, "ended": given.seeds, "code": _code()}) + "\n")
        print(f"{each.name}: {came_to(_own(given.out, each.name))}", file=sys.stderr, flush=True)
    print(table([(each.name, each.half, _own(given.out, each.name)) for each in chosen]))


def _code() -> str:
    """The commit that is run."""
    asked = ["git", "-C", str(Path(__file__).parent), "rev-parse", "--short=8", "HEAD"]
    return subprocess.run(asked, capture_output=True, check=False, text=True).stdout.strip()


def _lines(path: Path) -> list[Mapping[str, Any]]:
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []


def _own(path: Path, name: str) -> list[Mapping[str, Any]]:
    return [line for line in _lines(path) if line["assembly"] == name]


if __name__ == "__main__":
    main()
