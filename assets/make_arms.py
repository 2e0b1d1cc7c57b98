"""Make the MJCF files of arms and grippers of primitives that have the published kinematics of real ones.

    python assets/make_arms.py

UR5e: Denavit-Hartenberg parameters, masses, centres of mass and torques as Universal Robots publishes them ("DH
Parameters for calculations of kinematics and dynamics"; "Max. joint torques"). Panda: parameters (Craig's convention),
joint limits and torques of the Franka Control Interface documentation; masses as identified by Gaz et al., "Dynamic
Identification of the Franka Emika Panda Robot", RA-L 2019. The linkage gripper: pivots, link and pad of the public
description of the Robotiq 2F-85 (ROS-Industrial). What is not published, the thickness of links, their inertia and what
the motors add to it, is that of plain cylinders and of the arm that comes with the benchmark.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

ARMS = Path(__file__).resolve().parent / "arms"
_HALF = np.pi / 2
_ARMATURE, _DAMPING = "0.1", "1"

# theta is the joint; d, a, alpha; limit [rad]; torque [Nm]; mass [kg]; centre of mass in the frame of the link; radius
UR5E = (
    (0.1625, 0.0, _HALF, 2 * np.pi, 150, 3.761, (0.0, -0.02561, 0.00193), 0.060),
    (0.0, -0.425, 0.0, 2 * np.pi, 150, 8.058, (0.2125, 0.0, 0.11336), 0.050),
    (0.0, -0.3922, 0.0, np.pi, 150, 2.846, (0.15, 0.0, 0.0265), 0.040),
    (0.1333, 0.0, _HALF, 2 * np.pi, 28, 1.37, (0.0, -0.0018, 0.01634), 0.036),
    (0.0997, 0.0, -_HALF, 2 * np.pi, 28, 1.3, (0.0, 0.0018, 0.01634), 0.036),
    (0.0996, 0.0, 0.0, 2 * np.pi, 28, 0.365, (0.0, 0.0, -0.001159), 0.032),
)
# a, alpha before the joint; d behind it; lowest, highest angle [rad]; torque [Nm]; mass [kg]; radius
PANDA = (
    (0.0, 0.0, 0.333, -2.8973, 2.8973, 87, 4.970684, 0.060),
    (0.0, -_HALF, 0.0, -1.7628, 1.7628, 87, 0.646926, 0.060),
    (0.0, _HALF, 0.316, -2.8973, 2.8973, 87, 3.228604, 0.055),
    (0.0825, _HALF, 0.0, -3.0718, -0.0698, 87, 3.587895, 0.055),
    (-0.0825, -_HALF, 0.384, -2.8973, 2.8973, 12, 1.225946, 0.050),
    (0.0, _HALF, 0.0, -0.0175, 3.7525, 12, 1.666555, 0.045),
    (0.088, _HALF, 0.0, -2.8973, 2.8973, 12, 0.735522, 0.040),
)
_PANDA_FLANGE_M = 0.107


def main() -> None:
    """Write all of them."""
    _write("ur5e_primitive", ur5e())
    _write("panda_primitive", panda())
    _write("linkage_gripper", linkage_gripper())
    _write("parallel_gripper", parallel_gripper())


def ur5e() -> ElementTree.Element:
    """Six hinges in the frames of Denavit and Hartenberg, and the site `flange`."""
    root, body = _begin("ur5e_primitive", 0.075)
    actuators = ElementTree.SubElement(root, "actuator")
    T = np.eye(4)
    for i, (d, a, alpha, limit, torque, mass, com, radius) in enumerate(UR5E, start=1):
        link = _shift(z=d) @ _shift(x=a) @ _turn_x(alpha)
        body = _link(body, actuators, i, T, (-limit, limit), torque)
        _inertial(body, mass, (link @ [*com, 1.0])[:3], radius, max(abs(a), d, 0.08))
        _capsules(body, ((0, 0, 0), (0, 0, d), (a, 0, d)), radius)
        T = link
    ElementTree.SubElement(body, "site", {"name": "flange", **_place(T)})
    return root


def panda() -> ElementTree.Element:
    """Seven hinges in the frames of Craig, and the site `flange`."""
    root, body = _begin("panda_primitive", 0.09)
    _capsules(body, ((0, 0, 0.06), (0, 0, 0.333)), 0.06)
    actuators = ElementTree.SubElement(root, "actuator")
    for i, (a, alpha, d, low, high, torque, mass, radius) in enumerate(PANDA, start=1):
        body = _link(body, actuators, i, _turn_x(alpha) @ _shift(x=a) @ _shift(z=d), (low, high), torque)
        after = PANDA[i] if i < len(PANDA) else (0.0, 0.0, _PANDA_FLANGE_M)
        ahead = (_turn_x(after[1]) @ _shift(x=after[0]) @ _shift(z=after[2]))[:3, 3]
        _inertial(body, mass, ahead / 2, radius, max(float(np.linalg.norm(ahead)), 0.1))
        _capsules(body, ((0, 0, 0), (after[0], 0, 0), ahead), radius)
    ElementTree.SubElement(body, "site", {"name": "flange", **_place(_shift(z=_PANDA_FLANGE_M))})
    return root


def linkage_gripper() -> ElementTree.Element:
    """Two parallel linkages that a tendon closes: pads stay parallel and go ahead by 14 mm as they close from 85 mm."""
    root, base = _begin("linkage_gripper", None)
    _inertial(base, 0.8, (0, 0, 0.045), 0.05, 0.09)
    _shape(base, "palm", "box", (0, 0, 0.032), (0.037, 0.028, 0.030))
    tendon = ElementTree.SubElement(ElementTree.SubElement(root, "tendon"), "fixed", {"name": "grip"})
    equality = ElementTree.SubElement(root, "equality")
    stiff = {"solref": "0.004 1", "solimp": "0.98 0.999 0.0001 0.5 2"}
    for side, s in (("left", -1.0), ("right", 1.0)):
        driver = _body(base, f"{side}_driver", (s * 0.0306, 0, 0.0549))
        axis = {"axis": f"0 {-s:g} 0"}
        hinge = {"name": f"{side}_driver", "range": "0 0.82", "armature": "0.005", "damping": "0.1", **axis}
        ElementTree.SubElement(driver, "joint", hinge)
        _inertial(driver, 0.06, (s * 0.0188, 0, 0.0215), 0.008, 0.057)
        ends = f"0 0 0 {s * 0.0376:g} 0 0.043"
        ElementTree.SubElement(
            driver, "geom", {"class": "link", "name": f"{side}_link", "fromto": ends, "size": "0.008"}
        )
        finger = _body(driver, f"{side}_finger", (s * 0.0376, 0, 0.043))
        parallel = {"name": f"{side}_finger", "range": "-0.9 0.1", "armature": "0.001", "damping": "0.02", **axis}
        ElementTree.SubElement(finger, "joint", parallel)
        _inertial(finger, 0.05, (-s * 0.012, 0, 0.025), 0.01, 0.04)
        _shape(finger, f"{side}_finger", "box", (-s * 0.012, 0, 0.012), (0.009, 0.011, 0.012))
        _shape(finger, f"{side}_pad", "box", (-s * 0.0219, 0, 0.0324), (0.0035, 0.011, 0.01875), "pad")
        ElementTree.SubElement(tendon, "joint", {"joint": f"{side}_driver", "coef": "0.5"})
        keep = {"joint1": f"{side}_finger", "joint2": f"{side}_driver", "polycoef": "0 -1 0 0 0", **stiff}
        ElementTree.SubElement(equality, "joint", keep)
    both = {"joint1": "left_driver", "joint2": "right_driver", "polycoef": "0 1 0 0 0", **stiff}
    ElementTree.SubElement(equality, "joint", both)
    drive = {"name": "grip", "tendon": "grip", "kp": "100", "dampratio": "1", "ctrlrange": "0 0.82"}
    ElementTree.SubElement(ElementTree.SubElement(root, "actuator"), "position", {**drive, "forcerange": "-5 5"})
    return root


def parallel_gripper() -> ElementTree.Element:
    """Two slides, 80 mm wide open, of the size and force of the hand that a Panda has, and one drive for both alike."""
    root, base = _begin("parallel_gripper", None)
    _inertial(base, 0.73, (0, 0, 0.03), 0.05, 0.1)
    _shape(base, "palm", "box", (0, 0, 0.032), (0.1, 0.025, 0.032))
    tendon = ElementTree.SubElement(ElementTree.SubElement(root, "tendon"), "fixed", {"name": "grip"})
    equality = ElementTree.SubElement(root, "equality")
    actuators = ElementTree.SubElement(root, "actuator")
    for side, s in (("left", -1.0), ("right", 1.0)):
        finger = _body(base, f"{side}_finger", (0, 0, 0.0584))
        slide = {"name": f"{side}_finger", "type": "slide", "axis": f"{s:g} 0 0", "range": "0 0.04"}
        ElementTree.SubElement(finger, "joint", {**slide, "armature": "0.05", "damping": "5"})
        ElementTree.SubElement(tendon, "joint", {"joint": f"{side}_finger", "coef": "0.5"})
        _inertial(finger, 0.015, (s * 0.006, 0, 0.025), 0.01, 0.04)
        _shape(finger, f"{side}_finger", "box", (s * 0.009, 0, 0.016), (0.006, 0.0105, 0.017))
        _shape(finger, f"{side}_pad", "box", (s * 0.006, 0, 0.0445), (0.006, 0.0105, 0.0105), "pad")
    stiff = {"solref": "0.004 1", "solimp": "0.98 0.999 0.0001 0.5 2"}
    both = {"joint1": "left_finger", "joint2": "right_finger", "polycoef": "0 1 0 0 0", **stiff}
    ElementTree.SubElement(equality, "joint", both)
    drive = {"name": "grip", "tendon": "grip", "kp": "4000", "dampratio": "1", "ctrlrange": "-0.03 0.04"}
    ElementTree.SubElement(actuators, "position", {**drive, "forcerange": "-70 70"})
    return root


def _begin(name: str, foot: float | None) -> tuple[ElementTree.Element, ElementTree.Element]:
    root = ElementTree.Element("mujoco", {"model": name})
    ElementTree.SubElement(root, "compiler", {"angle": "radian", "autolimits": "true"})
    default = ElementTree.SubElement(root, "default")
    touching = {"contype": "1", "conaffinity": "0", "group": "2", "mass": "0"}
    for kind, more in (
        ("link", {"type": "capsule", "rgba": "0.80 0.82 0.85 1"}),
        ("shell", {"rgba": "0.27 0.29 0.33 1"}),
        ("pad", {"rgba": "0.13 0.13 0.14 1", "friction": "1.2 0.02 0.0005", "condim": "4", "priority": "1"}),
    ):
        one = ElementTree.SubElement(default, "default", {"class": kind})
        ElementTree.SubElement(one, "geom", {**touching, **more})
    base = _body(ElementTree.SubElement(root, "worldbody"), "base", (0, 0, 0))
    if foot is not None:
        _shape(base, "foot", "cylinder", (0, 0, 0.02), (foot, 0.02))
    return root, base


def _link(
    body: ElementTree.Element,
    actuators: ElementTree.Element,
    i: int,
    T: np.ndarray,
    limit: tuple[float, float],
    torque: int,
) -> ElementTree.Element:
    """The next body behind a hinge about its z axis, and its motor."""
    link = ElementTree.SubElement(body, "body", {"name": f"link{i}", **_place(T)})
    hinge = {"name": f"joint{i}", "axis": "0 0 1", "range": _text(limit), "armature": _ARMATURE, "damping": _DAMPING}
    ElementTree.SubElement(link, "joint", hinge)
    ElementTree.SubElement(
        actuators, "motor", {"name": f"joint{i}", "joint": f"joint{i}", "ctrlrange": f"{-torque} {torque}"}
    )
    return link


def _capsules(body: ElementTree.Element, corners: tuple[object, ...], radius: float) -> None:
    points = [np.asarray(corner, dtype=float) for corner in corners]
    for k, (a, b) in enumerate(pairwise(points)):
        if np.linalg.norm(b - a) > 1e-6:
            name = f"{body.get('name')}_{k}"
            said = {"class": "link", "name": name, "fromto": _text((*a, *b)), "size": f"{radius:g}"}
            ElementTree.SubElement(body, "geom", said)


def _shape(body: ElementTree.Element, name: str, kind: str, at: object, size: object, look: str = "shell") -> None:
    said = {"class": look, "name": name, "type": kind, "pos": _text(at), "size": _text(size)}
    ElementTree.SubElement(body, "geom", said)


def _inertial(body: ElementTree.Element, mass: float, at: object, radius: float, length: float) -> None:
    """A cylinder lying in any direction: the larger of its moments for all three."""
    moment = mass * (3 * radius**2 + length**2) / 12
    said = {"mass": f"{mass:g}", "pos": _text(at), "diaginertia": _text([moment] * 3)}
    body.insert(0, ElementTree.Element("inertial", said))


def _body(parent: ElementTree.Element, name: str, at: object) -> ElementTree.Element:
    return ElementTree.SubElement(parent, "body", {"name": name, "pos": _text(at)})


def _place(T: np.ndarray) -> dict[str, str]:
    half = np.arctan2(T[2, 1], T[1, 1]) / 2
    return {"pos": _text(T[:3, 3]), "quat": _text((np.cos(half), np.sin(half), 0.0, 0.0))}


def _shift(x: float = 0.0, z: float = 0.0) -> np.ndarray:
    T = np.eye(4)
    T[0, 3], T[2, 3] = x, z
    return T


def _turn_x(angle: float) -> np.ndarray:
    T = np.eye(4)
    T[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return T


def _text(numbers: object) -> str:
    return " ".join(f"{x + 0.0:.9g}" for x in np.round(np.asarray(numbers, dtype=float), 12))


def _write(name: str, root: ElementTree.Element) -> None:
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    (ARMS / f"{name}.xml").write_text(
        f"<!-- Made by assets/make_arms.py; change it there. -->\n{text}\n", encoding="utf-8"
    )


if __name__ == "__main__":
    main()
