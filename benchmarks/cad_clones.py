"""Files that public repositories contain, tried with `part import` and not shipped: repository, licence, path."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import NamedTuple


class Foreign(NamedTuple):
    """A file in a clone."""

    repository: str
    licence: str
    path: str
    what: str
    options: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Two cells of a table."""
        how = f" `{' '.join(self.options)}`" if self.options else ""
        return f"`{PurePosixPath(self.path).name}`{how}, {self.what} | {self.repository}, {self.licence}"


_TRIMESH = ("mikedh/trimesh", "MIT")
_OCCT = ("kovacsv/occt-import-js", "LGPL 2.1")
_PRUSA = ("prusa3d/Original-Prusa-i3", "GPL 2")
_SO = ("TheRobotStudio/SO-ARM100", "Apache 2.0")
_ODRI = ("open-dynamic-robot-initiative/open_robot_actuator_hardware", "BSD 3")
_ROBOTIQ = ("ros-industrial/robotiq", "BSD 2")
_IN = ("--unit", "in")

FILES = (
    Foreign(*_OCCT, "test/testfiles/cax-if/as1-oc-214.stp", "assembly: plate, brackets, bolts, nuts, rod"),
    Foreign(*_OCCT, "test/testfiles/cax-if/dm1-id-214.stp", "assembly: bracket, bolts, nuts"),
    Foreign(*_OCCT, "test/testfiles/cax-if/as1_pe_203.stp", "the first assembly, which says inches"),
    Foreign(*_OCCT, "test/testfiles/cax-if/io1-cm-214.stp", "flange with a thread relief"),
    Foreign(*_TRIMESH, "models/box_sides.STEP", "assembly: a box of slotted sheets"),
    Foreign(*_TRIMESH, "models/BREP/base_interface_AP203.STEP", "interface plate"),
    Foreign(*_TRIMESH, "models/featuretype.STEP", "plate with engraved text and many holes"),
    Foreign(*_TRIMESH, "models/plate_holes.STL", "plate with holes"),
    Foreign(*_TRIMESH, "models/idler_riser.STL", "riser of an idler", _IN),
    Foreign(*_TRIMESH, "models/idler_riser.STL", "the same, unit not said"),
    Foreign(*_TRIMESH, "models/1002_tray_bottom.STL", "tray"),
    Foreign(*_TRIMESH, "models/counterXP.3MF", "two parts with cut letters"),
    Foreign(*_TRIMESH, "models/busted.STL", "a broken mesh"),
    Foreign(*_PRUSA, "Printed-Parts/STEP/y-belt-idler.stp", "printed bracket"),
    Foreign(*_PRUSA, "Printed-Parts/STEP/y-rod-holder.stp", "printed rod holder"),
    Foreign(*_PRUSA, "Printed-Parts/STEP/fs-lever.stp", "printed lever"),
    Foreign(*_PRUSA, "Printed-Parts/STEP/plug-aligner.stp", "printed jig"),
    Foreign(*_PRUSA, "Printed-Parts/STEP/LCD-knob.stp", "knob"),
    Foreign(*_PRUSA, "Printed-Parts/STEP/extruder-idler.stp", "printed lever"),
    Foreign(*_PRUSA, "Printed-Parts/STEP/extruder-body.stp", "printed body of an extruder"),
    Foreign(*_PRUSA, "Printed-Parts/STL/fs-lever.stl", "printed lever"),
    Foreign(*_PRUSA, "Printed-Parts/STL/z-axis-top.stl", "two printed brackets"),
    Foreign(*_SO, "STEP/SO100/Base_attachment.step", "bracket of an arm"),
    Foreign(*_SO, "STEP/SO100/Passive_Horn_01.step", "horn of a servo"),
    Foreign(*_SO, "STEP/SO100/Motor1_holder.step", "holder of a motor"),
    Foreign(*_SO, "STEP/SO101/Follower_Specific/Moving_Jaw_SO101.step", "jaw of a gripper"),
    Foreign(*_SO, "STL/Gauges/Gauge_0.STL", "gauge of a printer"),
    Foreign(
        *_ODRI, "mechanics/actuator_module_v1/step_files/transmission_pulley_at3_t10_center.STEP", "toothed pulley"
    ),
    Foreign(
        *_ODRI, "mechanics/actuator_module_v1/step_files/motor_antigravity_4004_custom_shaft.STEP", "shaft of a motor"
    ),
    Foreign(*_ODRI, "mechanics/finger_edu_v1/stl_files/structure_bottom_plate.STL", "plate of a finger"),
    Foreign(*_ODRI, "mechanics/general/stl_files/pin_spacer_4mm.STL", "spacer"),
    Foreign(
        *_ROBOTIQ,
        "robotiq_2f_140_gripper_visualization/meshes/collision/robotiq_arg2f_coupling.stl",
        "coupling of a gripper, coarse",
    ),
    Foreign("bernhard-42/three-cad-viewer", "MIT", "examples/profile4040.step", "slotted profile"),
)
