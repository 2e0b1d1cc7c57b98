"""Compose the room, the parts and the hands or the arm, as MuJoCo's `MjSpec`.

Everything that is attached keeps its names behind a prefix: part `stick` is the body `stick/`, which holds the joint,
and in it the body of its file, `stick/stick`, with its geoms and faces (sites) `stick/bar`, `stick/px`.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import mujoco

from apo_bench.errors import require
from apo_bench.geometry import Array, all_boxes
from apo_bench.mjcf.part_file import PartModel, add_picture
from apo_bench.resources import folder
from apo_bench.scenario import Scenario, place_layout
from apo_bench.scenario.parts import PartFile, read_part
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.loading import load_model
from apo_bench.simulation.physics import Physics, set_contact, set_options
from apo_bench.simulation.scene.contact_bits import OF_PARTS, Bits, meetings
from apo_bench.simulation.scene.geoms import dress
from apo_bench.simulation.scene.walls import simulated_pieces
from apo_bench.simulation.scene.world import WRIST_SENSORS

HANDS = ("hand0", "hand1")
_HAND_SOLREF = (0.01, 1.0)
_HAND_SOLIMP = (0.95, 0.99, 0.001, 0.5, 2.0)
"""Soft like a hand: a part held by it yields a little and is not torn through its neighbours."""
_ARM_SOLREF = (0.004, 1.0)
_ARM_SOLIMP = (0.98, 0.999, 0.0005, 0.5, 2.0)
_MEMORY = 64 << 20
"""For the contacts of many pieces at once: what MuJoCo takes by itself is too little for rings of wedges that fall."""
_PAD_CONDIM = 4
"""Of all that an arm touches by: pads resist turning."""
_NEAREST_M = 1e-10
"""How exactly the distance of pieces that are no boxes is found. With MuJoCo's 1e-6, flat faces that graze each other
by less are at times found to be millimetres inside of each other, and leap apart."""
_NET_FORCE = (1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), 3, 1)
"""Of a contact sensor: its data field, how contacts are put together (3: one net force), how many it gives."""
_WRIST_SITE = "wrist"
_BEHIND_PICTURE = 3
"""Of MuJoCo's groups of geoms, 0 to 2 are shown."""
_HIDDEN_GROUP = 5
"""The site of the wrist's sensors, in a group that no picture shows; names of arms and parts have a slash."""


def with_hands(room: Any, scenario: Scenario) -> Any:
    """Where the human demonstrates: a room with parts, and two hands that each may hold any movable one."""
    spec = room.copy()
    for i, hand in enumerate(HANDS):
        mocap = spec.worldbody.add_body(name=hand, mocap=True, pos=(0.0, 0.5 + 0.1 * i, 0.3))
        mocap.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=(0.012, 0.0, 0.0),
            contype=0,
            conaffinity=0,
            rgba=(0.90, 0.70, 0.60, 0.7),
        )
        for part, body in _movable_bodies(scenario, spec).items():
            _add_weld(spec, f"{hand}_{part}", hand, body, _HAND_SOLREF, _HAND_SOLIMP)
    return spec


def with_arm(room: Any, scenario: Scenario, settings: Physics, arm: Arm, grasp: str, first_link: str) -> Any:
    """Where the robot replays: a room with parts, the arm, sensors of force, and welds where it grasps by them.

    Last come the sensors of the wrist, which stay off until a replay needs them (`switch_wrist_sensors_on`).

    Args:
        first_link: The first body of the arm that moves.
    """
    spec = room.copy()
    if grasp == "weld":
        for part, body in _movable_bodies(scenario, spec).items():
            _add_weld(spec, f"grasp_{part}", f"arm/{arm.mount}", body, _ARM_SOLREF, _ARM_SOLIMP)
    _add_arm(spec, arm, settings)
    _add_force_sensors(spec, scenario, f"arm/{first_link}")
    _add_wrist_sensors(spec, f"arm/{arm.mount}")
    return spec


def room_with_parts(scenario: Scenario, clearance_mm: float, settings: Physics) -> Any:
    """The room and every part at its start.

    Raises:
        InputError: The file of a part has changed since the scenario was loaded.
    """
    spec = mujoco.MjSpec.from_file(str(folder("assets") / "room.xml"))
    spec.modelname = scenario.name
    if not all(all_boxes(solid.pieces) for solid in scenario.assembly.solids.values()):
        spec.memory = _MEMORY
        spec.option.ccd_tolerance = _NEAREST_M
    set_options(spec.option, settings)
    start = place_layout(scenario, 0.0, 0.0, 0.0, clearance_mm=clearance_mm).start
    files = {path: read_part(path) for path in dict.fromkeys(scenario.part_files.values())}
    bits = meetings(scenario.assembly.solids, clearance_mm * 1e-3)
    for part in scenario.assembly.solids:
        file = files[scenario.part_files[part]]
        _add_part(spec, scenario, part, file, start[part], clearance_mm, settings, bits[part])
    return spec


def _add_part(
    spec: Any,
    scenario: Scenario,
    part: str,
    file: PartFile,
    T: Array,
    clearance_mm: float,
    settings: Physics,
    bits: Mapping[str, Bits],
) -> None:
    """Attach a part's file at T, its fit faces receded."""
    solid = scenario.assembly.solids[part]
    require(
        [piece.name for piece in file.pieces] == [piece.name for piece in solid.pieces],
        f"{file.path}: the pieces are others than those of part '{part}'; load the scenario again.",
    )
    own = _bare_part(file.model)
    dress(own, solid, simulated_pieces(solid, clearance_mm * 1e-3), file.density, bits)
    set_contact(own.geoms, settings)
    if part in scenario.colors:
        for geom in own.geoms:
            geom.rgba = (*scenario.colors[part], 1.0)
    body = spec.worldbody.add_body(name=f"{part}/", pos=T[:3, 3])
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_XYAXES
    body.alt.xyaxes = (*T[:3, 0], *T[:3, 1])
    if part not in scenario.assembly.fixed:
        body.add_freejoint(name=f"{part}/")
    spec.attach(own, frame=body.add_frame(), prefix=f"{part}/")


def _bare_part(model: PartModel) -> Any:
    """A part whose geoms have no shape yet, with its sites and its picture; with a picture its pieces are hidden."""
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name=model.body)
    group = 0 if model.picture is None else _BEHIND_PICTURE
    for geom in model.geoms:
        body.add_geom(name=geom.name, density=geom.density, friction=geom.friction, rgba=geom.rgba, group=group)
    for site in model.sites:
        body.add_site(name=site.name, pos=site.pos, size=site.size, group=site.group, rgba=site.rgba)
    if model.picture is not None:
        add_picture(spec, body, model.picture)
    return spec


def movable_parts(scenario: Scenario) -> tuple[str, ...]:
    """In the order of the scenario."""
    return tuple(part for part in scenario.assembly.solids if part not in scenario.assembly.fixed)


def fixed_parts(scenario: Scenario) -> tuple[str, ...]:
    """In the order of the scenario."""
    return tuple(part for part in scenario.assembly.solids if part in scenario.assembly.fixed)


def _movable_bodies(scenario: Scenario, spec: Any) -> Mapping[str, str]:
    """Movable part -> the body that has its mass; the one around it has none."""
    return {part: spec.body(f"{part}/").bodies[0].name for part in movable_parts(scenario)}


def _add_weld(spec: Any, name: str, first: str, second: str, solref: Iterable[float], solimp: Iterable[float]) -> None:
    """Add a weld that is off; who switches it on sets where it holds."""
    weld = spec.add_equality(
        name=name,
        type=mujoco.mjtEq.mjEQ_WELD,
        objtype=mujoco.mjtObj.mjOBJ_BODY,
        name1=first,
        name2=second,
        active=False,
        solref=solref,
        solimp=solimp,
    )
    weld.data[:] = 0.0
    weld.data[10] = 1.0  # how much a turn counts against a shift, MuJoCo's own


def _add_arm(spec: Any, arm: Arm, settings: Physics) -> None:
    own = load_model(arm.mjcf, "arm") if arm.model is None else mujoco.MjSpec.from_string(arm.model)
    set_contact(own.geoms, settings)
    if arm.hand is not None:
        for geom in own.geoms:
            geom.condim = _PAD_CONDIM
            geom.priority = 1
    for geom in own.geoms:
        if geom.conaffinity & 1:  # it met parts, by the bit that they had
            geom.conaffinity |= OF_PARTS
    stand = spec.worldbody.add_body(name="arm/", pos=arm.base, quat=arm.turn)
    spec.attach(own, frame=stand.add_frame(), prefix="arm/")


def _add_force_sensors(spec: Any, scenario: Scenario, arm: str) -> None:
    """What every movable part exerts on all it touches; then, of every part, what it exerts on the arm.

    MuJoCo computes a sensor while one of the two bodies that it names is awake, and a body that cannot move never is.
    So the arm is named by its first link that moves: by its base, a fixed part and the arm would have no sensor of each
    other while sleep is on.
    """
    for part in movable_parts(scenario):
        _add_force_sensor(spec, f"all_{part}", f"{part}/", None)
    for part in (*movable_parts(scenario), *fixed_parts(scenario)):
        _add_force_sensor(spec, f"arm_{part}", f"{part}/", arm)


def _add_force_sensor(spec: Any, name: str, subtree: str, other: str | None) -> None:
    sensor = spec.add_sensor(
        name=name,
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_XBODY,
        objname=subtree,
        intprm=_NET_FORCE,
    )
    if other is not None:
        sensor.reftype = mujoco.mjtObj.mjOBJ_XBODY
        sensor.refname = other


def _add_wrist_sensors(spec: Any, mount: str) -> None:
    """What the arm exerts on its hand where that is mounted: force and torque, in the frame of the mount.

    MuJoCo has weight and inertia of the hand in it, and all that is held or touched by it, welded or by friction.
    """
    spec.body(mount).add_site(name=_WRIST_SITE, group=_HIDDEN_GROUP)
    for name, kind in zip(WRIST_SENSORS, (mujoco.mjtSensor.mjSENS_FORCE, mujoco.mjtSensor.mjSENS_TORQUE), strict=True):
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=_WRIST_SITE)
