"""Compose the room, the parts and the hands or the arm into an `MjSpec`.

Attached files keep their names behind a prefix: part `stick` is the body `stick/`, which holds the joint. Its child is
the body of the part file, `stick/stick`, with geoms and faces (sites) such as `stick/bar`, `stick/px`.
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
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.arms.loading import load_model
from apo_bench.simulation.physics import Physics, set_contact, set_options
from apo_bench.simulation.scene.clamps import list_clamps
from apo_bench.simulation.scene.contact_bits import OF_PARTS, Bits, meetings
from apo_bench.simulation.scene.geoms import dress
from apo_bench.simulation.scene.walls import simulated_pieces
from apo_bench.simulation.scene.world import CLAMP, WRIST_SENSORS
from apo_bench.simulation.scene.wrist_camera import add_wrist_camera

HANDS = ("hand0", "hand1")
_HAND_SOLREF = (0.01, 1.0)
_HAND_SOLIMP = (0.95, 0.99, 0.001, 0.5, 2.0)
"""Soft welds of a hand: a held part yields a little and is not pulled through its neighbours."""
# Welds of the ideal gripper.
_ARM_SOLREF = (0.004, 1.0)
_ARM_SOLIMP = (0.98, 0.999, 0.0005, 0.5, 2.0)
_MEMORY = 64 << 20
"""Memory of MuJoCo's stack for many simultaneous contacts; its default is too small for falling rings of wedges."""
_PAD_CONDIM = 4
"""For all geoms of an arm: pads have torsional friction."""
_NEAREST_M = 1e-10
"""Tolerance of the distance between pieces that are no boxes.

With MuJoCo's 1e-6, flat faces that graze each other by less sometimes seem to penetrate by millimetres and jump apart.
"""
_NET_FORCE = (1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), 3, 1)
"""`intprm` of a contact sensor: data field, reduction (3: net force), number of results."""
_WRIST_SITE = "wrist"  # does not collide with names of arm and parts, which have a slash
_BEHIND_PICTURE = 3
"""Geom group of pieces behind a picture; MuJoCo shows groups 0 to 2."""
_HIDDEN_GROUP = 5
"""Site group of the wrist sensors, which no picture shows."""


def with_hands(room: Any, scenario: Scenario) -> Any:
    """The world of the demonstration: the room with parts, and two hands that can each hold any movable part."""
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
    _add_clamps(spec, scenario)
    return spec


def with_arm(room: Any, scenario: Scenario, settings: Physics, arm: Arm, grasp: str, kinematics: Kinematics) -> Any:
    """The world of the replay: the room with parts, the arm, its camera and sensors, and welds for the ideal gripper.

    The wrist sensors come last; they stay off until a replay needs them (`switch_wrist_sensors_on`).

    Args:
        grasp: `friction` or `weld`.
        kinematics: Those of the arm.
    """
    spec = room.copy()
    if grasp == "weld":
        for part, body in _movable_bodies(scenario, spec).items():
            _add_weld(spec, f"grasp_{part}", f"arm/{arm.mount}", body, _ARM_SOLREF, _ARM_SOLIMP)
    _add_clamps(spec, scenario)
    _add_arm(spec, arm, settings)
    _add_force_sensors(spec, scenario, f"arm/{kinematics.first_link}")
    _add_wrist_sensors(spec, f"arm/{arm.mount}")
    add_wrist_camera(spec, kinematics)
    return spec


def room_with_parts(scenario: Scenario, clearance_mm: float, settings: Physics) -> Any:
    """The room and every part at its start pose.

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
    """Attach a part at its start pose T, (4, 4), with its fit faces receded by the clearance.

    Args:
        bits: Contact bits by the name of a piece.
    """
    solid = scenario.assembly.solids[part]
    # Pieces thinner than the depth by which fit faces recede are no longer part of the solid.
    names = [piece.name for piece in file.pieces]
    left = [piece.name for piece in solid.pieces]
    require(
        [name for name in names if name in left] == left,
        f"{file.path}: the pieces are others than those of part '{part}'; load the scenario again.",
    )
    own = _bare_part(file.model)
    pieces = {**dict.fromkeys(names, ()), **simulated_pieces(solid, clearance_mm * 1e-3)}
    dress(own, solid, pieces, file.density, bits)
    set_contact(own.geoms, settings)
    if part in scenario.colors:
        for geom in own.geoms:
            geom.rgba = (*scenario.colors[part], 1.0)
    body = spec.worldbody.add_body(name=f"{part}/", pos=T[:3, 3])
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_XYAXES
    body.alt.xyaxes = (*T[:3, 0], *T[:3, 1])  # rotation by the directions of x and y
    if part not in scenario.assembly.fixed:
        body.add_freejoint(name=f"{part}/")
    spec.attach(own, frame=body.add_frame(), prefix=f"{part}/")


def _bare_part(model: PartModel) -> Any:
    """A part with its sites and picture, whose geoms have no shape yet; a picture hides its pieces."""
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
    """The movable parts, in the order of the scenario."""
    return tuple(part for part in scenario.assembly.solids if part not in scenario.assembly.fixed)


def fixed_parts(scenario: Scenario) -> tuple[str, ...]:
    """The fixed parts, in the order of the scenario."""
    return tuple(part for part in scenario.assembly.solids if part in scenario.assembly.fixed)


def _movable_bodies(scenario: Scenario, spec: Any) -> Mapping[str, str]:
    """Movable part -> the inner body, which has its mass; the outer body with the joint has none."""
    return {part: spec.body(f"{part}/").bodies[0].name for part in movable_parts(scenario)}


def _add_clamps(spec: Any, scenario: Scenario) -> None:
    """Add the inactive welds of the parts that operations clamp."""
    for part, other in list_clamps(scenario).items():
        _add_weld(spec, f"{CLAMP}{part}", f"{other}/", f"{part}/", _ARM_SOLREF, _ARM_SOLIMP)


def _add_weld(spec: Any, name: str, first: str, second: str, solref: Iterable[float], solimp: Iterable[float]) -> None:
    """Add an inactive weld; its relative pose is set when it is activated."""
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
    weld.data[10] = 1.0  # `torquescale`: weight of rotation against translation, MuJoCo's default


def _add_arm(spec: Any, arm: Arm, settings: Physics) -> None:
    """Attach the arm at its base, and let it collide with parts."""
    own = load_model(arm.mjcf, "arm") if arm.model is None else mujoco.MjSpec.from_string(arm.model)
    set_contact(own.geoms, settings)
    if arm.hand is not None:
        for geom in own.geoms:
            geom.condim = _PAD_CONDIM
            geom.priority = 1  # the pads' friction counts, not the larger of both
    for geom in own.geoms:
        if geom.conaffinity & 1:  # in its own file it collides with bit 1, so let it collide with parts
            geom.conaffinity |= OF_PARTS
    stand = spec.worldbody.add_body(name="arm/", pos=arm.base, quat=arm.turn)
    spec.attach(own, frame=stand.add_frame(), prefix="arm/")


def _add_force_sensors(spec: Any, scenario: Scenario, arm: str) -> None:
    """Add contact force sensors: of every movable part on everything it touches, then of every part on the arm.

    MuJoCo computes such a sensor only while one of its two bodies is awake, and a body that cannot move never is. So
    the arm is named by its first moving link. By its base, a fixed part and the arm would have no sensor while sleep is
    allowed.

    Args:
        arm: The first moving link.
    """
    for part in movable_parts(scenario):
        _add_force_sensor(spec, f"all_{part}", f"{part}/", None)
    for part in (*movable_parts(scenario), *fixed_parts(scenario)):
        _add_force_sensor(spec, f"arm_{part}", f"{part}/", arm)


def _add_force_sensor(spec: Any, name: str, subtree: str, other: str | None) -> None:
    """Add a sensor of the net contact force of a subtree, on `other` or (None) on everything."""
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
    """Add sensors of force and torque between arm and hand, in the frame of the mount.

    They include weight and inertia of the hand and of all that it holds or touches.
    """
    spec.body(mount).add_site(name=_WRIST_SITE, group=_HIDDEN_GROUP)
    for name, kind in zip(WRIST_SENSORS, (mujoco.mjtSensor.mjSENS_FORCE, mujoco.mjtSensor.mjSENS_TORQUE), strict=True):
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=_WRIST_SITE)
