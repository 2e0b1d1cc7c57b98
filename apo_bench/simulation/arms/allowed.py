"""All that the MJCF file of an arm or gripper may say: which elements, with which attributes, in which range.

It is one table, longer than other files: whoever asks whether something is allowed looks in one place.
"""

import re
from collections.abc import Mapping
from types import MappingProxyType

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
LARGEST_MJCF_BYTES = 5_000_000
LARGEST_MESH_BYTES = 20_000_000
MOST_MESH_BYTES = 100_000_000
"""Of an MJCF file, of a mesh, of all meshes that something touches by."""
MOST_FILES = 50
MOST_NESTED = 64
MOST_ELEMENTS = 20_000
LONGEST_VALUE = 1_000_000
"""Files that are included; levels of nesting; elements in all; letters of an attribute."""
MOST_OF = MappingProxyType({"geom": 1000, "body": 200, "joint": 100, "site": 1000, "general": 64, "mesh": 1000})
MESHES = (".stl", ".obj", ".msh")

_TURN = "quat axisangle xyaxes zaxis euler"
_GEOM = (
    f"name class type contype conaffinity condim group priority size rgba friction mass density shellinertia solmix "
    f"solref solimp margin gap fromto pos {_TURN} mesh fitscale user"
)
_JOINT = (
    "name class type group springdamper pos axis range limited ref springref stiffness damping frictionloss armature "
    "margin actuatorfrclimited actuatorfrcrange actuatorgravcomp solreflimit solimplimit solreffriction "
    "solimpfriction user"
)
_TENDON = (
    "name class group limited range solreflimit solimplimit solreffriction solimpfriction margin frictionloss "
    "springlength width rgba stiffness damping armature actuatorfrclimited actuatorfrcrange user"
)
_ACTUATOR = (
    "name class group joint jointinparent tendon site refsite ctrllimited ctrlrange forcelimited forcerange actlimited "
    "actrange lengthrange gear cranklength actdim actearly inheritrange delay nsample interp user"
)
_EQUALITY = "name class active solref solimp"
_DRIVES = MappingProxyType(
    {
        "general": f"{_ACTUATOR} dyntype gaintype biastype dynprm gainprm biasprm",
        "motor": _ACTUATOR,
        "position": f"{_ACTUATOR} kp kv dampratio timeconst",
        "velocity": f"{_ACTUATOR} kv",
        "intvelocity": f"{_ACTUATOR} kp kv dampratio",
        "damper": f"{_ACTUATOR} kv",
    }
)
ATTRIBUTES: Mapping[str, frozenset[str]] = MappingProxyType(
    {
        tag: frozenset(words.split())
        for tag, words in {
            "mujoco": "model",
            "compiler": "angle autolimits eulerseq meshdir texturedir assetdir strippath balanceinertia boundmass "
            "boundinertia inertiafromgeom inertiagrouprange discardvisual fusestatic usethread alignfree saveinertial "
            "convexhull coordinate",
            "default": "class",
            "worldbody": "",
            "body": f"name childclass pos {_TURN} gravcomp user",
            "frame": f"name childclass pos {_TURN}",
            "inertial": f"pos {_TURN} mass diaginertia fullinertia",
            "joint": _JOINT,
            "geom": _GEOM,
            "site": f"name class type group size fromto rgba pos {_TURN} user",
            "asset": "",
            "mesh": "name class content_type file vertex face normal texcoord scale refpos refquat inertia "
            "smoothnormal maxhullvert",
            "contact": "",
            "exclude": "name class body1 body2",
            "equality": _EQUALITY,
            "connect": f"{_EQUALITY} body1 body2 anchor site1 site2",
            "weld": f"{_EQUALITY} body1 body2 anchor relpose torquescale site1 site2",
            "tendon": _TENDON,
            "fixed": _TENDON,
            "spatial": f"{_TENDON}",
            "pulley": "divisor",
            "actuator": "",
            **_DRIVES,
        }.items()
    }
)
"""Element -> what it may say, wherever it stands."""
INSIDE: Mapping[str, frozenset[str]] = MappingProxyType(
    {
        outer: frozenset(words.split())
        for outer, words in {
            "mujoco": "compiler default worldbody asset contact equality tendon actuator",
            "default": "default geom joint site mesh tendon equality general motor position velocity intvelocity "
            "damper",
            "worldbody": "body frame geom site",
            "body": "body frame geom site joint inertial",
            "frame": "body frame geom site joint",
            "asset": "mesh",
            "contact": "exclude",
            "equality": "connect weld joint tendon",
            "tendon": "fixed spatial",
            "fixed": "joint",
            "spatial": "site geom pulley",
            "actuator": " ".join(_DRIVES),
        }.items()
    }
)
WRAPPED: Mapping[tuple[str, str], frozenset[str]] = MappingProxyType(
    {
        ("equality", "joint"): frozenset(f"{_EQUALITY} joint1 joint2 polycoef".split()),
        ("equality", "tendon"): frozenset(f"{_EQUALITY} tendon1 tendon2 polycoef".split()),
        ("fixed", "joint"): frozenset(("joint", "coef")),
        ("spatial", "site"): frozenset(("site",)),
        ("spatial", "geom"): frozenset(("geom", "sidesite")),
    }
)
"""Where an element of that name is another one."""
IGNORED_ELEMENTS = frozenset(
    [
        "sensor",
        "keyframe",
        "visual",
        "statistic",
        "custom",
        "size",
        "camera",
        "light",
        "material",
        "texture",
        "pair",
        "skin",
        "text",
        "numeric",
        "tuple",
    ]
)
"""A scene has its own, or needs none."""
IGNORED_OPTIONS = frozenset(
    [
        "timestep",
        "gravity",
        "integrator",
        "cone",
        "impratio",
        "iterations",
        "solver",
        "tolerance",
        "ls_iterations",
        "ls_tolerance",
        "noslip_iterations",
        "noslip_tolerance",
        "ccd_iterations",
        "ccd_tolerance",
        "jacobian",
        "sdf_iterations",
        "sdf_initpoints",
        "actuatorgroupdisable",
        "density",
        "viscosity",
        "wind",
        "magnetic",
    ]
)
"""Of <option> and of <flag>: how something is simulated, which a scene and the measuring of a gripper say alike."""
IGNORED_FLAGS = frozenset(
    [
        "midphase",
        "multiccd",
        "nativeccd",
        "eulerdamp",
        "autoreset",
        "energy",
        "fwdinv",
        "island",
        "warmstart",
        "filterparent",
        "invdiscrete",
        "sleep",
        "refsafe",
        "sensor",
    ]
)
ARM_REMEDIES: Mapping[str, str] = MappingProxyType(
    {
        "freejoint": "an arm stands fast",
        "mocap": "an arm stands fast",
        "replicate": "write out what it repeats",
        "composite": "arms are rigid bodies",
        "flexcomp": "arms are rigid bodies",
        "deformable": "arms are rigid bodies",
        "hfield": "the table belongs to the scenario",
        "attach": "write all bodies into one file, or <include> it",
        "model": "write all bodies into one file, or <include> it",
        "extension": "plugins are code",
        "plugin": "plugins are code",
        "material": "colours are words by rgba=",
    }
)
"""What to do instead."""
_ANY = (-1e6, 1e6)
_PLACE = (-10.0, 10.0)
_FEW = (0.0, 1e5)
_GAINS = (-1e7, 1e7)
RANGES: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        **dict.fromkeys(("pos", "fromto", "refpos", "anchor", "zaxis", "xyaxes", "axis"), _PLACE),
        "size": (-1.0, 10.0),
        "mass": (0.0, 1000.0),
        "density": (0.0, 25_000.0),
        **dict.fromkeys(("diaginertia", "fullinertia"), (-1000.0, 1000.0)),
        "friction": (0.0, 10.0),
        **dict.fromkeys(("margin", "gap"), (0.0, 0.01)),
        "gravcomp": (0.0, 1.0),
        "condim": (1.0, 6.0),
        **dict.fromkeys(("boundmass", "boundinertia"), (0.0, 10.0)),
        "range": (-1e4, 1e4),
        **dict.fromkeys(("stiffness", "damping", "frictionloss", "armature"), _FEW),
        **dict.fromkeys(("gainprm", "biasprm", "kp", "kv", "forcerange", "ctrlrange", "actuatorfrcrange"), _GAINS),
        **dict.fromkeys(("contype", "conaffinity"), (0.0, 2147483647.0)),
        **dict.fromkeys(("vertex", "normal", "texcoord", "scale"), (-1e4, 1e4)),
        "face": (0.0, 1e6),
        **dict.fromkeys(
            [
                "quat",
                "axisangle",
                "euler",
                "refquat",
                "rgba",
                "solref",
                "solimp",
                "solmix",
                "group",
                "priority",
                "springdamper",
                "ref",
                "springref",
                "solreflimit",
                "solimplimit",
                "solreffriction",
                "solimpfriction",
                "user",
                "coef",
                "polycoef",
                "gear",
                "dynprm",
                "springlength",
                "width",
                "relpose",
                "torquescale",
                "divisor",
                "actrange",
                "lengthrange",
                "cranklength",
                "dampratio",
                "timeconst",
                "maxhullvert",
                "fitscale",
                "actdim",
                "inheritrange",
                "inertiagrouprange",
                "delay",
                "nsample",
            ],
            _ANY,
        ),
    }
)
"""Attribute -> least and largest of its numbers, in the file's own units."""


def wrong_value(tag: str, key: str, text: str) -> str:
    """What is allowed in place of a value; empty where it is allowed."""
    if key == "user" or (tag, key) == ("texture", "gridsize"):
        return ""
    if key not in RANGES:
        return "" if len(text) <= 500 and text.isprintable() else "500 letters are the most"
    low, high = RANGES[key]
    if all(_NUMBER.fullmatch(word) and low <= float(word) <= high for word in text.split()):
        return ""
    return f"numbers of {low:g} to {high:g} are allowed"
