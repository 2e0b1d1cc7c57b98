"""The page of all keys in scenario, part, noise, arm and sweep files, read from the types of the package.

The fields of a type are the keys of a table. This file has their meanings; a key without a meaning, or a meaning
without a key, is an error.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Mapping

import msgspec
from fields import sentences

from apo_bench.benchmark.sweeps.grid import AXES, SHARED
from apo_bench.benchmark.sweeps.sweep_file import SweepTable
from apo_bench.cli.shared.setting_options import format_default
from apo_bench.importers.assembly.scenario_writer import THRESHOLDS
from apo_bench.perception.observation import noise_file
from apo_bench.records import SETTINGS, SettingInfo
from apo_bench.scenario import tables as scenario_tables
from apo_bench.scenario.parts import stated_properties
from apo_bench.scenario.values import Pose
from apo_bench.simulation.arms.arm import Arm

POSE = {"at_mm": "position of the part's frame, x, y, z", "turn_deg": "angles about x, y, z; default `[0, 0, 0]`"}
FIT = "`true`: it recedes by the clearance"
AXIS = {
    "at_mm": "a point of its axis",
    "axis": "direction of its axis",
    "span_mm": "from where to where along the axis, from that point",
    "hole": "`true`: the wall of a hole; `false`: that of a shaft",
}
AROUND = {
    "fit": FIT,
    "extent_deg": "how far it reaches around the axis; default 360",
    "toward": "from the axis to the middle of the face, of one that does not reach all around",
}
SHIFT = "axis of the part: `x`, `+y`, `-z`, ... or three numbers"


def sweep_meanings() -> dict[str, str]:
    """Return what each setting of a trial means as a key of a sweep file."""
    several = [*AXES, SETTINGS["noise_mm"], SETTINGS["noise_deg"]]
    meanings = {
        info.name: f"{info.help}: one value or several; default {default_of(info)}"
        for info in several
        if info.name != "scenario"
    }
    for name in SHARED:
        info = SETTINGS[name]
        meanings[info.keyword] = f"{info.help}: one value for the whole sweep; default {default_of(info)}"
    return meanings


def default_of(info: SettingInfo) -> str:
    """Return the default of a sweep in words."""
    return ", ".join(f"`{value:g}`" if isinstance(value, float) else f"`{value}`" for value in info.swept) or (
        info.usual or f"`{format_default(info)}`"
    )


MEANINGS: Mapping[str, Mapping[str, Mapping[str, str]]] = {
    "Scenario files": {
        "": {
            "schema": "1",
            "title": "the task in a few words",
            "paper": "its place in the paper",
            "human": "what the simulated human does, for the task sheet",
            "success": "the right end, for the task sheet",
            "clearance_mm": "clearance per side of parts that fit, 0 to 5; default 0.25",
            "gap_mm": "below this gap a contact equation counts as solved, up to 5; default 0.1",
            "parts": "one table per part: `[parts.NAME]`",
            "operations": "one table per operation, in order: `[[operations]]`",
            "site": "where the assembly stands; default at the origin of the table",
            "human_error": "the error of the human; default none",
            "judge": "thresholds of the verdict",
        },
        "parts.NAME": {
            "file": "a part of the package by name, or a part file relative to this file",
            "fixed": "`true`: the part never moves",
            "follows_site": "`true`: a fixed part that stands where the assembly stands",
            "start": "pose in the world before the first operation; every part that is not fixed needs one",
            "color": "red, green, blue, 0 to 1",
            "fit": "faces that recede by the clearance although the part file does not say so: FACE = how far it lies "
            "inside of where the file has it, 0 to 1 mm",
        },
        "pose: start, goal": POSE,
        "operations": {
            "move": "the part that is moved",
            "carries": "parts that go with it",
            "goal": "pose of the moved part in the frame of the assembly when the operation is over",
            "contacts": "pairs `[face of what moves, part.face of what rests]`, or tables",
            "attach": "a preference for the way to the goal; default it is found",
            "grasp": "where the gripper takes the part; default above the middle of boxes, or as its shape offers",
            "clamp": "whether the part is fixed once it presses on its seat, as by screws; default false",
            "vary": "a shift or a turn that each trial draws, or a list of them (20 in a scenario at most)",
        },
        "operations, contacts": {
            "faces": "the pair of faces",
            "kind": "`centred` (else), `contact` or `clearance`",
            "gap_mm": "of `clearance`: lowest and highest distance; default the play",
        },
        "operations, attach": {
            "along": f"direction of the last motion, {SHIFT}",
            "travel_mm": "length of the last motion",
        },
        "operations, grasp": {
            "at_mm": "point between the fingers, frame of the part, at most 10 mm over it: pads reach so far down",
            "across": f"axis along which the fingers close, level when the part is picked; {SHIFT}",
            "ahead": "axis along which the fingers point, of a tilted hand, up to 45 degrees from straight down; "
            "it needs both others",
        },
        "operations, vary": {
            "along": f"of a shift, with `mm`: its direction, {SHIFT}",
            "mm": "lowest and highest shift",
            "about": f"of a turn, with `deg`: its axis, {SHIFT}",
            "deg": "lowest and highest turn",
            "at_mm": "a point of that axis, frame of the part; default its origin",
        },
        "site": {
            "center_mm": "middle of the places, x and y in the world",
            "spread_mm": "how far from it in x and y, to either side",
            "yaw_deg": "lowest and highest turn about the vertical",
        },
        "human_error": {
            "operation": "number of the operation that goes wrong, from 1",
            "along": f"direction of the error, level at the goal; {SHIFT}",
            "size_mm": "lowest and highest size, to either side; `human_error_scale` of a trial scales it",
        },
        "judge": {
            "success": "`assembled` (else) or `as_demonstrated`: which verdict counts as success",
            **THRESHOLDS,
        },
    },
    "Noise files": {
        "": {
            "schema": "`apo-bench/noise/2`",
            "source": "whose errors these are",
            "missed_rate": "share of parts that were not found, 0 to 1",
            "outlier_rate": "share of outliers among those that were found, 0 to 1",
            "outlier_farthest_mm": "outliers are off by `limit_mm` to this",
            "shift": "errors of the position",
            "turn": "errors of the turn",
            "camera": "pose of the camera in the world, `{ at_mm, turn_deg }`; default the default one",
        },
        "shift": {
            "limit_mm": "no error of an inlier is longer",
            "across_scale_mm": "scale of the Student t across the ray",
            "across_degrees_of_freedom": "its degrees of freedom, `inf` for a Gaussian",
            "along_scale_mm": "scale of the Student t along the ray",
            "along_degrees_of_freedom": "its degrees of freedom",
        },
        "turn": {
            "limit_deg": "no turn of an inlier is larger",
            "across_scale_deg": "scale of the Student t of turns about axes across the ray",
            "across_degrees_of_freedom": "its degrees of freedom, `inf` for a Gaussian",
            "along_scale_deg": "scale of the Student t of turns about the ray",
            "along_degrees_of_freedom": "its degrees of freedom",
        },
    },
    "TOML files of parts": {
        "": {
            "schema": "`apo-bench/part/1`",
            "title": "name of the part for people",
            "source": "source of the shape",
            "licence": "its licence",
            "density": "in kg/m^3, 1 to 25000; default 1000",
            "friction": "sliding, or sliding, turning and rolling, as in MJCF; default MJCF's own",
            "volume_mm3": "of the exact solid",
            "centroid_mm": "of the exact solid",
            "inertia_mm5": "xx, yy, zz, xy, xz, yz of the exact solid of density 1 about its centroid",
            "faces": "one table per face: `[faces.NAME]`",
        },
        "faces.NAME, a plane": {
            "kind": '`"plane"`',
            "outline_mm": "corners, counter-clockwise as seen from outside",
            "holes_mm": "a list of such lists, clockwise as seen from outside",
            "fit": FIT,
        },
        "faces.NAME, a cylinder": {"kind": '`"cylinder"`', "radius_mm": "its radius", **AXIS, **AROUND},
        "faces.NAME, a cone": {
            "kind": '`"cone"`',
            "radii_mm": "at the start and at the end of the span",
            **AXIS,
            **AROUND,
        },
        "faces.NAME, a rim": {
            "kind": '`"rim"`',
            "at_mm": "its middle",
            "axis": "out of the part",
            "radius_mm": "its radius",
            "hole": "`true`: of a hole; `false`: of a shaft",
        },
    },
    "Sweep files": {
        "": {
            "scenario": "name or scenario file: one or several",
            **sweep_meanings(),
            "trials": "seeds per condition, 1 to 1000000; default 100",
            "seed": "the first seed; default 0",
            "independent_seeds": "whether each condition has other seeds, the same for every method; default false",
            "also": "further grids, one table each: `[[also]]`; keys that a grid lacks are those above",
        },
    },
}
"""File -> table -> key -> what it means."""
HEAD = """# File keys

All keys of the files that you can write. In TOML files lengths are in mm and angles in degrees; in part files, as
always in MJCF, lengths are in metres. The reader rejects a key that is not listed, with the nearest one. *Needed*: the
reader rejects a file without it.
"""
TYPES: Mapping[str, Mapping[str, type[msgspec.Struct]]] = {
    "Scenario files": {
        "": scenario_tables.ScenarioTable,
        "parts.NAME": scenario_tables.PartTable,
        "pose: start, goal": Pose,
        "operations": scenario_tables.OperationTable,
        "operations, contacts": scenario_tables.ContactTable,
        "operations, attach": scenario_tables.AttachTable,
        "operations, grasp": scenario_tables.GraspTable,
        "operations, vary": scenario_tables.VaryTable,
        "site": scenario_tables.SiteTable,
        "human_error": scenario_tables.HumanErrorTable,
        "judge": scenario_tables.JudgeTable,
    },
    "Noise files": {"": noise_file.NoiseFileTable, "shift": noise_file.ShiftTable, "turn": noise_file.TurnTable},
    "TOML files of parts": {
        "": stated_properties.MatterTable,
        "faces.NAME, a plane": stated_properties.PlaneTable,
        "faces.NAME, a cylinder": stated_properties.CylinderTable,
        "faces.NAME, a cone": stated_properties.ConeTable,
        "faces.NAME, a rim": stated_properties.RimTable,
    },
    "Sweep files": {"": SweepTable},
}
"""File -> table -> the type whose fields are its keys."""


def page() -> str:
    """The page, as Markdown."""
    lines = [HEAD]
    for file, tables in MEANINGS.items():
        lines += ["", f"## {file}"]
        for table, meanings in tables.items():
            lines += ["", f"### `{table}`" if table else "### At the top", "", *key_lines(TYPES[file][table], meanings)]
    return "\n".join([*lines, PART_LINES.rstrip(), ARM_LINES.rstrip(), *arm_lines()]) + "\n"


def key_lines(table: type[msgspec.Struct], meanings: Mapping[str, str]) -> list[str]:
    """The keys of a table and what they mean, in Markdown."""
    fields = msgspec.structs.fields(table)
    tag = table.__struct_config__.tag_field
    kind = set() if tag is None else {tag}
    needed = {field.encode_name for field in fields if field.required} | kind
    known = {field.encode_name for field in fields} | kind
    if meanings.keys() != known:
        raise ValueError(f"docs/file_keys.py explains {set(meanings)}, but {table.__name__} has {known}.")
    lines = (f"| `{key}` | {'yes' if key in needed else ''} | {means} |" for key, means in meanings.items())
    return ["| key | needed | meaning |", "|---|---|---|", *lines]


PART_LINES = """
## Part files

A part file is MJCF with one `<body>` that MuJoCo reads; the body holds all pieces and sites. These attributes count,
also as `<default>`:

| element | attributes |
|---|---|
| `<geom type="box">` | `name`, `pos`, `size`; of parts of boxes alone also `density` |
| `<geom type="cylinder">` | `name`, `pos`, `size`, `zaxis` |
| `<geom type="mesh">` | `name`, `mesh`: each mesh is one convex piece |
| all of them | `friction` of parts of boxes alone, `rgba` |
| `<geom>` with `contype="0" conaffinity="0"` | `name`, `mesh`, `rgba`: the picture, which is shown and never collides |
| `<site>` | of parts of boxes alone: `name` of the face on which it lies, `pos`; `class="fit"`: the face recedes |
| `<mesh>` | `name`, and `vertex`, or `file` of a picture in the folder of the part |

A part has no joints, actuators, sensors, included files or plugins, no second body, and no stated pose or inertia.
"""


ARM_LINES = """
## Arms

[A file](../guide/arm.md#a-file-that-describes-an-arm) describes any arm. An arm is data also in Python: `--arm
mymodule:my_arm`, where `my_arm` is an `apo_bench.Arm` or a function that returns one. The site `tip` lies between the
fingertips: z points ahead, x along the closing direction. `assets/arms/six_axis.xml` is an example.

| field | meaning |
|---|---|
"""


def arm_lines() -> list[str]:
    """The fields of `Arm`, with the sentences below them."""
    explained = OBVIOUS | sentences(Arm)
    return [f"| `{field.name}` | {explained[field.name]} |" for field in dataclasses.fields(Arm)]


OBVIOUS = {
    "mjcf": "The file that describes the arm.",
    "tip": "Name of the site between the fingertips.",
}
"""Fields of an arm without a sentence in the code."""

if __name__ == "__main__":
    sys.stdout.write(page())
