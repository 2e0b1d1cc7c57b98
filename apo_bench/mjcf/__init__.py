"""Files in MuJoCo's own format, read by MuJoCo, as plain data."""

from apo_bench.mjcf.lazy_graphics import import_mujoco

import_mujoco()
