"""Find an arm by name: one that comes with the benchmark, a file, an arm of a collection, or a plugin `module:name`.

Collections are MuJoCo Menagerie and robosuite, if installed. Nothing is downloaded.
"""

import importlib.util
import os
from collections.abc import Iterator
from pathlib import Path
from types import MappingProxyType

import mujoco

from apo_bench.errors import RAISED, InputError, require, require_known, unknown
from apo_bench.names import resolve
from apo_bench.records import FOREIGN_ARMS
from apo_bench.resources import folder
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.building import read_arm, read_described
from apo_bench.simulation.arms.description import ArmDescription, GripperDescription
from apo_bench.simulation.arms.loading import load_model

_MENAGERIE = "APO_BENCH_MENAGERIE"
"""Environment variable with the folder of MuJoCo Menagerie."""
_ROBOSUITE = "APO_BENCH_ROBOSUITE"
"""Environment variable with the folder of robosuite."""
_CACHE = Path("robot_descriptions") / "mujoco_menagerie"  # folder of Menagerie in the user's cache
_2F85 = Path("robotiq_2f85") / "2f85.xml"  # Menagerie's gripper for arms without one
# Words by which the name of a joint or body shows that it belongs to a gripper.
_WITH_FINGERS = ("finger", "gripper", "hand", "knuckle", "driver", "jaw")
_GRIPPERS = MappingProxyType(
    {
        "ur5e": ("robotiq_gripper_85", "robosuite_robotiq_85"),
        "panda": ("panda_gripper", "robosuite_panda"),
        "sawyer": ("rethink_gripper", "robosuite_rethink"),
        "iiwa": ("robotiq_gripper_140", "robosuite_robotiq_140"),
        "kinova3": ("robotiq_gripper_85", "robosuite_robotiq_85"),
        "xarm7": ("xarm7_gripper", "robosuite_xarm7"),
    }
)
"""Arm of robosuite -> its usual gripper there, and the gripper file of that."""
_HANDS = MappingProxyType({"franka_emika_panda": "franka_hand"})
"""Arm of Menagerie with a gripper -> its gripper file."""
_NAMES = ("six_axis", "ur5e_primitive", "panda_primitive")
"""Arms that come with the benchmark, as arm files."""


def arm_names() -> tuple[str, ...]:
    """The short names of the arms that come with the benchmark."""
    return _NAMES


def find_arm(name: str | Arm) -> Arm:
    """Find an arm by short name, `FILE.toml`, `menagerie:NAME`, `robosuite:NAME` or `module:name`.

    Args:
        name: The name, or an `Arm`, which is returned as it is.

    Raises:
        InputError: The arm is unknown, its collection is not installed (with the command that fetches it), or it cannot
            be used.
    """
    if isinstance(name, Arm):
        return name
    if name.endswith(".toml"):
        return read_arm(name)
    if name in _NAMES:
        return read_arm(folder("assets") / "arms" / f"{name}.toml")
    if name.startswith(FOREIGN_ARMS):
        collection, _, of_it = name.partition(":")
        return read_described(_of_menagerie(of_it) if collection == "menagerie" else _of_robosuite(of_it))
    if ":" in name:
        arm = resolve(name, {}, "arm")
        try:
            arm = arm() if callable(arm) else arm
        except RAISED as error:
            raise InputError(
                f"the arm '{name}' failed: it raised {error!r}; give a function without arguments."
            ) from error
        require(
            isinstance(arm, Arm),
            f"the arm '{name}' is a {type(arm).__name__}; an `Arm`, or a function that returns one.",
        )
        return arm
    raise InputError(
        f"{unknown('arm', name, _NAMES)} Or give your own as FILE.toml, menagerie:NAME, robosuite:NAME, or "
        "'package.module:name'."
    )


def _of_menagerie(name: str) -> ArmDescription:
    """The description of an arm of MuJoCo Menagerie, with its own gripper or a Robotiq 2F-85."""
    root = next((each for each in _menageries() if each.is_dir()), None)
    if root is None:
        raise InputError(
            f"menagerie:{name}: MuJoCo Menagerie was not found; fetch it with 'git clone --depth 1 "
            f"https://github.com/google-deepmind/mujoco_menagerie' and name its folder in {_MENAGERIE}."
        )
    require_known("arm", name, [each.name for each in sorted(root.iterdir()) if any(each.glob("*.xml"))], place=root)
    plain = name.replace("_", "").lower()  # the file of arm `franka_emika_panda` is `panda.xml`
    files = [f for f in sorted((root / name).glob("*.xml")) if plain.endswith(f.stem.replace("_", "").lower())]
    require(files, f"{root / name}: which of its files is the arm is not known; state it as 'mjcf' in an arm file.")
    if _has_fingers(files[0]):
        require(
            name in _HANDS,
            f"{files[0]}: what the gripper of '{name}' does is not known; state its gripper file in an arm file.",
        )
        return _foreign_arm(files[0], None, _HANDS[name])
    gripper = root / _2F85
    require(gripper.is_file(), f"{root}: the arm '{name}' has no gripper, and {_2F85} is not there; fetch all of it.")
    return _foreign_arm(files[0], gripper, "robotiq_2f85")


def _of_robosuite(name: str) -> ArmDescription:
    """The description of an arm of robosuite with its usual gripper there."""
    root = _robosuite()
    if root is None:
        raise InputError(
            f"robosuite:{name}: robosuite was not found; install it with 'pip install --no-deps robosuite', or name "
            f"the folder of the package in {_ROBOSUITE}."
        )
    robots = root / "models" / "assets" / "robots"
    key = name.lower()
    if key not in _GRIPPERS or not (robots / key / "robot.xml").is_file():
        raise InputError(f"{root}: {unknown('arm', name, _GRIPPERS)}")
    mjcf = robots / key / "robot.xml"
    gripper, hand = _GRIPPERS[key]
    return _foreign_arm(mjcf, robots.parent / "grippers" / f"{gripper}.xml", hand, "right_hand")


def _foreign_arm(mjcf: Path, gripper: Path | None, hand: str, flange: str | None = None) -> ArmDescription:
    """The description of an arm without an arm file.

    Args:
        gripper: Model file of the gripper; None: it is part of the arm's model.
        hand: Name of the gripper file.
    """
    described = GripperDescription(hand=hand, mjcf=None if gripper is None else str(gripper.absolute()))
    return ArmDescription(schema="apo-bench/arm/1", file=mjcf, mjcf=mjcf.name, flange=flange, gripper=described)


def _menageries() -> Iterator[Path]:
    """Folders where MuJoCo Menagerie may be: that of the variable, else that in the cache."""
    if named := os.environ.get(_MENAGERIE):
        yield Path(named)
        return
    yield Path(os.environ.get("ROBOT_DESCRIPTIONS_CACHE", "") or Path.home() / ".cache" / _CACHE.parent) / _CACHE.name


def _robosuite() -> Path | None:
    """The folder of robosuite, from the variable or the installed package; None if there is none."""
    if named := os.environ.get(_ROBOSUITE):
        root = Path(named)
        return root if (root / "models" / "assets").is_dir() else None
    package = importlib.util.find_spec("robosuite")
    return Path(package.origin).parent if package is not None and package.origin else None


def _has_fingers(mjcf: Path) -> bool:
    """Whether a model has a gripper: a slide joint, or a joint or body with a name of a gripper."""
    spec = load_model(mjcf, "arm")
    if any(joint.type == mujoco.mjtJoint.mjJNT_SLIDE for joint in spec.joints):
        return True
    names = (f"{joint.parent.name} {joint.name}" for joint in spec.joints)
    return any(word in name.lower() for name in names for word in _WITH_FINGERS)
