"""One error of a plan, its limit, and the sentence of the failure if it exceeds that."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple

from apo_bench.geometry import Array

MeasureKind = Literal["falls", "fit", "side", "leans", "on_way", "from_above", "gripper", "own", "tip"]
MeasureCode = Literal["residual", "interference", "unstable_goal", "gripper_room", "tip_error"]
_CONTACTS_OFF = "its contacts are planned {:.2f} mm off, {:g} mm are allowed"
_SENTENCES: Mapping[MeasureKind, tuple[MeasureCode, str]] = MappingProxyType(
    {
        "falls": ("unstable_goal", "the part would fall there"),
        "fit": ("residual", _CONTACTS_OFF),
        "side": ("residual", _CONTACTS_OFF),
        "leans": (
            "residual",
            "the part would lean against what lies above it, as far as both clearances let it",
        ),
        "on_way": ("interference", "it would be {:.2f} mm deep in another part, {:g} mm are allowed"),
        "from_above": ("interference", "its way in begins {:.2f} mm deep in another part"),
        "gripper": (
            "gripper_room",
            "the open gripper would be {:.2f} mm deep in '{what}', {:g} mm are allowed",
        ),
        "own": ("tip_error", "the arm holds its way to {:.3f} mm only, and the play is {:g} mm"),
        "tip": (
            "tip_error",
            "with the error of the arm's tip its contacts are {:.2f} mm off, {:g} mm are allowed",
        ),
    }
)
"""Kind of measure -> failure code, and its sentence with size and limit."""


class Measure(NamedTuple):
    """One error of a plan, and its limit."""

    operation: int
    """Counted from 0."""
    kind: MeasureKind
    size: float
    """[mm]; negative for parts that are apart. `falls`, `leans`: the unbalanced share of the weight and of its moments
    on a 10 mm arm."""
    allowed: float
    """Largest size without a failure."""
    what: str = ""
    """`gripper`: the part that the gripper would strike."""

    @property
    def exceeded(self) -> bool:
        return self.size > self.allowed

    @property
    def code(self) -> MeasureCode:
        """The failure code if the size exceeds the limit."""
        return _SENTENCES[self.kind][0]

    @property
    def why(self) -> str:
        """The sentence of the failure, such as `it would be 7.59 mm deep in another part, 1 mm are allowed`."""
        return _SENTENCES[self.kind][1].format(self.size, self.allowed, what=self.what)


class DrawnMeasure(NamedTuple):
    """One error of a plan for r draws of the robot's errors, with the limits."""

    operation: int
    kind: MeasureKind
    size: Array
    """(r,), as in `Measure`."""
    allowed: Array
    """(r,)."""
    what: str = ""

    def first_draw(self) -> Measure:
        """The `Measure` of the first draw, which is the only one."""
        return Measure(self.operation, self.kind, float(self.size[0]), float(self.allowed[0]), self.what)
