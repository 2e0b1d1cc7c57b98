"""The scene: room, parts and arm as MuJoCo models, and pictures of them."""

from __future__ import annotations

from apo_bench.moved import moved_names

__getattr__ = moved_names(__name__, {name: f"scene.{name}" for name in ("Scene", "build_scene", "scene_xml")})
