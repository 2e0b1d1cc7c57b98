"""Read files in MuJoCo's format, by MuJoCo, as plain data."""

from apo_bench.mjcf.lazy_graphics import import_mujoco

import_mujoco()
