"""Conventions in which the log of a pose tracker may be written, with what the camera file has to say about them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from apo_bench.geometry import Array, pose


class Tracked(NamedTuple):
    """What a tracker reports of one model."""

    id: str
    T_model_part: Array
    t: Array
    T: Array
    """(n, 4, 4), camera from model, [m]."""


class Form(NamedTuple):
    """A way to write a log."""

    format: str
    file: str
    log: str
    """What the camera file has to say about it."""
    write: Callable[[Mapping[str, Tracked], Path], None]


def _rows(found: Mapping[str, Tracked]) -> list[tuple[float, str, Array]]:
    return sorted(
        ((t, one.id, T) for one in found.values() for t, T in zip(one.t, one.T, strict=True)), key=lambda r: r[:2]
    )


def _csv(
    head: str, numbers: Callable[[Array], Array], clock: str = "t_s", per_s: float = 1.0
) -> Callable[[Mapping[str, Tracked], Path], None]:
    def write(found: Mapping[str, Tracked], path: Path) -> None:
        rows = [f"{per_s * t:.6f},{name}," + ",".join(f"{x:.7g}" for x in numbers(T)) for t, name, T in _rows(found)]
        path.write_text("\n".join([f"{clock},id,{head}", *rows]) + "\n", encoding="utf-8")

    return write


def _with(scale: float, rotation: Callable[[Rotation], Array]) -> Callable[[Array], Array]:
    return lambda T: np.concatenate([T[:3, 3] * scale, np.ravel(rotation(Rotation.from_matrix(T[:3, :3])))])


def _ros_csv(found: Mapping[str, Tracked], path: Path) -> None:
    names = [f"transform.translation.{a}" for a in "xyz"] + [f"transform.rotation.{a}" for a in "xyzw"]
    rows = [
        f"{int(t)},{round(t % 1 * 1e9)},camera,{name},"
        + ",".join(f"{x:.9g}" for x in pose.pack(T)[[0, 1, 2, 4, 5, 6, 3]])
        for t, name, T in _rows(found)
    ]
    head = "header.stamp.sec,header.stamp.nanosec,header.frame_id,child_frame_id," + ",".join(names)
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")


def _stamp(t: float) -> dict[str, object]:
    return {"stamp": {"sec": int(t), "nanosec": round(t % 1 * 1e9)}, "frame_id": "camera"}


def _ros_json(found: Mapping[str, Tracked], path: Path) -> None:
    lines = []
    for t, name, T in _rows(found):
        packed = pose.pack(T).tolist()
        at = dict(zip("xyz", packed[:3], strict=True))
        turn = dict(zip("wxyz", packed[3:], strict=True))
        message = {"header": _stamp(t), "pose": {"position": at, "orientation": turn}}
        lines.append(json.dumps({"topic": f"/tracker/{name}", "msg": message}))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _ros_tf(found: Mapping[str, Tracked], path: Path) -> None:
    messages = []
    for t, name, T in _rows(found):
        packed = pose.pack(T).tolist()
        at = dict(zip("xyz", packed[:3], strict=True))
        turn = dict(zip("wxyz", packed[3:], strict=True))
        transform = {"translation": at, "rotation": turn}
        messages.append({"transforms": [{"header": _stamp(t), "child_frame_id": name, "transform": transform}]})
    path.write_text(json.dumps(messages), encoding="utf-8")


_MM = 1e3
_M = 1.0
_CM = 1e2
_WXYZ = _with(_MM, lambda R: R.as_quat(scalar_first=True))
FORMS: Mapping[str, Form] = {
    "csv-wxyz": Form("csv", "log.csv", "", _csv("x_mm,y_mm,z_mm,qw,qx,qy,qz", _WXYZ)),
    "csv-xyzw": Form(
        "csv", "log.csv", 'quaternion = "xyzw"', _csv("x_m,y_m,z_m,q0,q1,q2,q3", _with(_M, lambda R: R.as_quat()))
    ),
    "csv-rotvec": Form(
        "csv",
        "log.csv",
        "",
        _csv("x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg", _with(_MM, lambda R: np.degrees(R.as_rotvec()))),
    ),
    "csv-axis": Form("csv", "log.csv", "", _csv("x_cm,y_cm,z_cm,ax,ay,az,angle_deg", _with(_CM, lambda R: _axis(R)))),
    "csv-euler": Form(
        "csv",
        "log.csv",
        'euler = "ZYX"\nangle = "rad"\nlength = "m"',
        _csv("x,y,z,e1,e2,e3", _with(_M, lambda R: R.as_euler("ZYX"))),
    ),
    "csv-rpy": Form(
        "csv",
        "log.csv",
        'euler = "xyz"',
        _csv("x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg", _with(_MM, lambda R: R.as_euler("xyz", degrees=True))),
    ),
    "csv-matrix": Form(
        "csv",
        "log.csv",
        "",
        _csv(
            "x_mm,y_mm,z_mm," + ",".join(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)),
            _with(_MM, lambda R: R.as_matrix()),
        ),
    ),
    "csv-ms": Form(
        "csv",
        "log.csv",
        "",
        _csv(
            "x_m,y_m,z_m," + ",".join(f"m{i}{j}" for i in (0, 1, 2) for j in (0, 1, 2)),
            _with(_M, lambda R: R.as_matrix()),
            "t_ms",
            1e3,
        ),
    ),
    "ros-csv": Form("ros-csv", "log.csv", "", _ros_csv),
    "ros-json": Form("ros-json", "log.jsonl", "", _ros_json),
    "ros-tf": Form("ros-json", "log.json", "", _ros_tf),
}


def _axis(R: Rotation) -> Array:
    """Unit axis and angle in degrees."""
    vector = R.as_rotvec()
    angle = float(np.linalg.norm(vector))
    return np.array([*(vector / angle if angle else (1.0, 0.0, 0.0)), np.degrees(angle)])
