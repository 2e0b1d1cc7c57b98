"""The list of foreign assemblies is whole, and what became of one is counted where it belongs."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from benchmarks.foreign import HALVES, read_list
from benchmarks.foreign_table import came_to, page, table

LIST = Path(__file__).parents[2] / "benchmarks" / "foreign.json"
FILE = {"file": "a.stl", "solids": 1, "flat": 6, "round": 2, "no_contact": 0}


def test_the_list_has_forty_assemblies_of_eight_repositories_and_no_file_in_both_halves() -> None:
    listed = read_list(LIST)
    assert len({each.name for each in listed}) == len(listed) >= 40
    assert len({each.repository for each in listed}) >= 8
    halves = Counter(each.half for each in listed)
    assert set(halves) == set(HALVES)
    assert min(halves.values()) >= 20
    files = [
        {(each.repository, file.path) for each in listed if each.half == half for file in each.files} for half in HALVES
    ]
    assert not files[0] & files[1]
    poses = [T for each in listed for file in each.files for T in file.places]
    assert all(np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3)) for T in poses)
    assert all(len(file.sha256) == 64 for each in listed for file in each.files)


def test_an_assembly_is_counted_by_what_stopped_it() -> None:
    drawn = {"draft": "", "contacts": {"flat on flat": 3}}
    well = [FILE, drawn, {"wrong": []}, {"method": "oracle", "seed": 0, "success": True}]
    ends = {
        "failed": [FILE, {"failed": "stopped"}],
        "import": [FILE, {"file": "b.stl", "refused": "b.stl: the shell is open"}],
        "overlap": [FILE, {"draft": "'a' and 'b' are 1 mm inside each other"}],
        "turning": [
            FILE,
            drawn,
            {"wrong": ["parts, a, start: 'a' needs turning over", "that of 'a' spans 120 mm; the gripper"]},
        ],
        "grasp": [FILE, drawn, {"wrong": ["operation 1, grasp: that of 'a' spans 120 mm; the gripper opens to 92 mm"]}],
        "check": [FILE, drawn, {"wrong": ["operation 1, contacts: no straight way leads 'a' to its goal"]}],
        "scenario": well,
    }
    for end, own in ends.items():
        assert came_to(own) == end
    tried = [(end, "open", [*own, {"ended": 1, "code": "c0de"}]) for end, own in ends.items()]
    said = table(tried)
    assert said.count("| c0de |") == len(ends)
    assert page(tried, {"open": 1}).startswith("# Assemblies that others drew")
    assert said.rstrip() in page(tried, {"open": 1})
    assert "scenarios, of those not refused for a grasp or for turning over: 1 of 5" in said
    assert "files imported: 7 of 8" in said
    assert "| scenario | 1 of 1, 6, 2, 0" not in said
    assert "| scenario | 1 of 1 | 6, 2, 0 | 3 flat on flat | scenario | 1 of 1 |" in said
    assert "Run, of those of the list: " in page(tried, {"open": 9})
    assert came_to([{"wrong": []}, {"success": None}, {"success": None}]) == "human"
    assert came_to([{"wrong": []}, {"success": None}, {"success": False}]) == "scenario"
