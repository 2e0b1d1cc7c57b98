"""Compose the room, the parts and the arm into MuJoCo models, once per scenario, clearance and grasp."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, final
from xml.etree import ElementTree

import mujoco

from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.clearance import physical_pieces
from apo_bench.geometry.convex import all_boxes
from apo_bench.geometry.solid import Piece
from apo_bench.parts import PartFile, read_part
from apo_bench.records.settings import check
from apo_bench.records.thresholds import Criteria
from apo_bench.resources import folder
from apo_bench.scenario.checks import check_clearance
from apo_bench.scenario.layout import layout_at
from apo_bench.scenario.scenario import Scenario
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.physics import Physics, physics
from apo_bench.simulation.scene.geoms import dress
from apo_bench.simulation.scene.graphics import import_mjcf
from apo_bench.simulation.scene.holdable import check_holdable
from apo_bench.simulation.scene.walls import simulated_pieces
from apo_bench.simulation.scene.world import World, world

_Grasp = Literal["friction", "weld"]
HANDS = ("hand0", "hand1")
_HAND_WELD = {"solref": (0.01, 1.0), "solimp": (0.95, 0.99, 0.001, 0.5, 2.0)}
"""Soft like a hand: a part held by it yields a little and is not torn through its neighbours."""
_DROWSY_M_S = 5e-5
"""What moves slower for ten steps, and against nothing that moves, sleeps while a human demonstrates: parts that settle
end within 2 micrometres of where they would."""
_MEMORY = "64M"
"""For the contacts of many pieces at once: what MuJoCo takes by itself is too little for rings of wedges that fall."""
_PAD_CONDIM = 4
"""Of all that an arm touches by: pads resist turning."""
_NEAREST_M = 1e-10
"""How exactly the distance of pieces that are no boxes is found. With MuJoCo's 1e-6, flat faces that graze each other
by less are at times found to be millimetres inside of each other, and leap apart."""
_ARM_WELD = {"solref": (0.004, 1.0), "solimp": (0.98, 0.999, 0.0005, 0.5, 2.0)}


@final
@dataclass(frozen=True, eq=False)
class Scene:
    """Everything compiled: reusable for any number of trials, which leave nothing behind in it."""

    scenario: Scenario
    clearance_mm: float
    grasp: _Grasp
    arm: Arm
    physics: Physics
    pieces: Mapping[str, tuple[Piece, ...]]
    """Part -> its pieces as it is made, with clearance."""
    shown: World
    """Parts and hands: where the human demonstrates."""
    work: World
    """Parts and arm: where the robot replays."""
    kinematics: Kinematics

    @property
    def criteria(self) -> Criteria:
        """What the judge decides by."""
        return Criteria(self.scenario.thresholds, self.clearance_mm, self.scenario.success_means)


def build_scene(
    scenario: Scenario,
    *,
    clearance_mm: float | None = None,
    grasp: str = "friction",
    arm: str | Arm = "six_axis",
    timestep_s: float = 0.001,
) -> Scene:
    """Compile a scenario.

    Raises:
        InputError: Unknown grasp or arm, a clearance that a part cannot have or that leaves a shaft no play, an
            unchecked time step, a part that the gripper cannot hold.
    """
    check("grasp", grasp)
    clearance = scenario.clearance_mm if clearance_mm is None else clearance_mm
    check_clearance(scenario, clearance)
    found = find_arm(arm)
    settings = physics(timestep_s)
    kinematics = Kinematics(found)
    with_hands, with_arm = _compose(scenario, clearance, settings, found, grasp, kinematics.first_link)
    shown = _compiled(scenario, with_hands)
    shown.model.opt.sleep_tolerance = _DROWSY_M_S
    measured = found.hand is not None
    work = _with_measured_arm(scenario, with_arm, found, settings) if measured else _compiled(scenario, with_arm)
    if grasp == "friction":
        check_holdable(scenario, work, found)
    return Scene(
        scenario=scenario,
        clearance_mm=clearance,
        grasp="weld" if grasp == "weld" else "friction",
        arm=found,
        physics=settings,
        pieces={name: physical_pieces(s, clearance * 1e-3) for name, s in scenario.assembly.solids.items()},
        shown=shown,
        work=work,
        kinematics=kinematics,
    )


def scene_xml(
    scenario: Scenario,
    *,
    clearance_mm: float | None = None,
    grasp: str = "friction",
    arm: str | Arm = "six_axis",
    timestep_s: float = 0.001,
) -> str:
    """The replay scene as one MJCF text that opens in MuJoCo's viewer, every part at its start."""
    return build_scene(scenario, clearance_mm=clearance_mm, grasp=grasp, arm=arm, timestep_s=timestep_s).work.xml


def _compiled(scenario: Scenario, xml: str) -> World:
    model = mujoco.MjModel.from_xml_string(xml)
    return _world(scenario, model, xml)


def _world(scenario: Scenario, model: Any, xml: str) -> World:
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return world(model, xml, _movable(scenario), _fixed(scenario))


def _with_measured_arm(scenario: Scenario, room: str, arm: Arm, settings: Physics) -> World:
    """Put an arm whose gripper was measured into a finished room, which names it already."""
    spec = mujoco.MjSpec.from_string(room)
    own = mujoco.MjSpec.from_string(arm.model)
    for geom in own.geoms:
        geom.solref[:2] = settings.solref
        geom.solimp = settings.solimp
        geom.condim = _PAD_CONDIM
        geom.priority = 1
    stand = spec.worldbody.add_body(name="arm/", pos=arm.base, quat=arm.turn)
    spec.attach(own, frame=stand.add_frame(), prefix="arm/")
    return _world(scenario, spec.compile(), spec.to_xml())


def _movable(scenario: Scenario) -> tuple[str, ...]:
    return tuple(part for part in scenario.assembly.solids if part not in scenario.assembly.fixed)


def _fixed(scenario: Scenario) -> tuple[str, ...]:
    return tuple(part for part in scenario.assembly.solids if part in scenario.assembly.fixed)


def _compose(
    scenario: Scenario, clearance_mm: float, settings: Physics, arm: Arm, grasp: str, first_link: str
) -> tuple[str, str]:
    """Parts and hands, then parts and arm; the parts are put together once for both."""
    mjcf = import_mjcf()
    room = mjcf.from_path(str(folder("assets") / "room.xml"))
    room.model = scenario.name
    if not all(all_boxes(solid.pieces) for solid in scenario.assembly.solids.values()):
        room.size.memory = _MEMORY
        room.option.ccd_tolerance = _NEAREST_M
    _set_physics(room, settings)
    start = layout_at(scenario, 0.0, 0.0, 0.0, clearance_mm=clearance_mm).start
    files = {path: read_part(path) for path in dict.fromkeys(scenario.part_files.values())}
    bodies = {
        part: _add_part(
            mjcf, room, scenario, part, files[scenario.part_files[part]], start[part], clearance_mm, settings
        )
        for part in scenario.assembly.solids
    }
    movable = {part: body for part, body in bodies.items() if part not in scenario.assembly.fixed}
    hands = _add_hands(room, movable)
    shown = room.to_xml_string()
    for element in reversed(hands):
        element.remove()
    if arm.hand is None:
        _add_arm(mjcf, room, arm, movable if grasp == "weld" else {}, settings)
    text = _with_force_sensors(room.to_xml_string(), scenario, f"arm/{first_link}")
    return shown, text if arm.hand is None or grasp != "weld" else _with_welds(text, arm, movable)


def _set_physics(room: Any, s: Physics) -> None:
    option = room.option
    option.timestep = s.timestep_s
    option.integrator = "implicitfast"
    option.cone = "elliptic"
    option.impratio = s.impratio
    option.solver = "Newton"
    option.tolerance = s.tolerance
    option.iterations = s.iterations


def _set_contact(model: Any, s: Physics) -> None:
    """Contact parameters of a file about to be attached: PyMJCF's default classes do not inherit from the room's."""
    geom = model.default.geom
    geom.solref = s.solref
    geom.solimp = s.solimp
    geom.condim = s.condim


def _add_part(
    mjcf: Any,
    room: Any,
    scenario: Scenario,
    part: str,
    file: PartFile,
    T: Array,
    clearance_mm: float,
    settings: Physics,
) -> Any:
    """Attach a part's file at T, its fit faces receded; returns the body that has the mass (its frame has none)."""
    solid = scenario.assembly.solids[part]
    if [piece.name for piece in file.pieces] != [piece.name for piece in solid.pieces]:
        raise InputError(f"{file.path}: the pieces are others than those of part '{part}'; load the scenario again.")
    model = mjcf.from_xml_string(file.xml)
    model.model = part
    _set_contact(model, settings)
    dress(model, solid, simulated_pieces(solid, clearance_mm * 1e-3), file.density)
    if part in scenario.colors:
        for geom in model.find_all("geom"):
            geom.rgba = (*scenario.colors[part], 1.0)
    frame = room.attach(model)
    frame.pos = T[:3, 3]
    frame.xyaxes = (*T[:3, 0], *T[:3, 1])
    if part not in scenario.assembly.fixed:
        frame.add("freejoint")
    return model.worldbody.body[0]


def _add_hands(room: Any, movable: Mapping[str, Any]) -> list[Any]:
    """Returns what was added, in its order."""
    added = []
    for i, hand in enumerate(HANDS):
        mocap = room.worldbody.add("body", name=hand, mocap=True, pos=(0.0, 0.5 + 0.1 * i, 0.3))
        mocap.add("geom", type="sphere", size=(0.012,), contype=0, conaffinity=0, rgba=(0.90, 0.70, 0.60, 0.7))
        added.append(mocap)
        for part, body in movable.items():
            name = f"{hand}_{part}"
            added.append(room.equality.add("weld", name=name, body1=mocap, body2=body, active=False, **_HAND_WELD))
    return added


def _add_arm(mjcf: Any, room: Any, arm: Arm, welded: Mapping[str, Any], settings: Physics) -> None:
    model = mjcf.from_path(str(arm.mjcf)) if arm.model is None else mjcf.from_xml_string(arm.model)
    model.model = "arm"
    _set_contact(model, settings)
    stand = room.attach(model)
    stand.pos = arm.base
    stand.quat = arm.turn
    mount = model.find("body", arm.mount)
    for part, body in welded.items():
        room.equality.add("weld", name=f"grasp_{part}", body1=mount, body2=body, active=False, **_ARM_WELD)


def _with_welds(xml: str, arm: Arm, welded: Mapping[str, Any]) -> str:
    """The ideal grasp of an arm that is put into the room later."""
    root = ElementTree.fromstring(xml)
    equality = root.find("equality")
    equality = ElementTree.SubElement(root, "equality") if equality is None else equality
    soft = {key: " ".join(map(str, value)) for key, value in _ARM_WELD.items()}
    for part, body in welded.items():
        bodies = {"body1": f"arm/{arm.mount}", "body2": body.full_identifier}
        ElementTree.SubElement(equality, "weld", {"name": f"grasp_{part}", "active": "false", **bodies, **soft})
    return ElementTree.tostring(root, encoding="unicode")


def _with_force_sensors(xml: str, scenario: Scenario, arm: str) -> str:
    """What every movable part exerts on all it touches; then, of every part, what it exerts on the arm.

    MuJoCo computes a sensor while one of the two bodies that it names is awake, and a body that cannot move never is.
    So the arm is named by its first link that moves: by its base, a fixed part and the arm would feel nothing of each
    other while sleep is on.

    PyMJCF's schema does not know contact sensors, so they are written into the finished text.
    """
    root = ElementTree.fromstring(xml)
    sensors = ElementTree.SubElement(root, "sensor")
    net = {"num": "1", "data": "force", "reduce": "netforce"}
    for part in _movable(scenario):
        ElementTree.SubElement(sensors, "contact", {"name": f"all_{part}", "subtree1": f"{part}/", **net})
    for part in (*_movable(scenario), *_fixed(scenario)):
        names = {"name": f"arm_{part}", "subtree1": f"{part}/", "subtree2": arm}
        ElementTree.SubElement(sensors, "contact", {**names, **net})
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"
