"""Name the columns of Motive and Vicon files, whose objects, kinds and axes stand in several header lines."""

from collections.abc import Sequence

_KINDS_OF_BODIES = ("rigid body", "bone", "rigid body marker", "marker")  # the second header line of Motive
_UNITS = (("millimeters", "mm"), ("centimeters", "cm"), ("meters", "m"))
_ANGLES = {"x": "roll", "y": "pitch", "z": "yaw"}


def name_motive_columns(heads: Sequence[Sequence[str]], axes: Sequence[str]) -> list[str]:
    """Return a name such as `stick.position.x_m` for each column of Motive, empty for those that are ignored.

    Args:
        heads: The cells of the lines before that with the axes, as long as that one.
        axes: The cells of the line that begins with `Frame`.
    """
    lower = [[cell.lower() for cell in head] for head in heads]
    unit = next((short for long, short in _UNITS for head in lower if long in head), "m")
    kinds = next((head for head in lower if {"rotation", "position"} <= {*head}), [""] * len(axes))
    row = next((i for i, head in enumerate(lower[:-1]) if {*head[2:]} & {*_KINDS_OF_BODIES}), 0)
    objects = heads[row + 1]
    has_w = {of for of, axis in zip(objects, axes, strict=True) if axis == "w"}
    names = ["frame", axes[1]]
    for body, of, kind, axis in list(zip(lower[row], objects, kinds, axes, strict=True))[2:]:
        if body != "rigid body" or kind not in ("rotation", "position"):
            names.append("")
        elif kind == "rotation" and of not in has_w:
            names.append(f"{of}.{_ANGLES[axis]}_deg")
        else:
            names.append(f"{of}.{kind}.{axis}_{unit}")
    return names


def name_vicon_columns(objects: Sequence[str], axes: Sequence[str], units: Sequence[str]) -> list[str]:
    """Return a name such as `stick.tx_mm` for each column of Vicon, empty for those that are ignored.

    Args:
        objects: The cells above the axes: `Global Angle stick:stick` above the first axis of each object.
        axes: The cells of the line that begins with `Frame`.
        units: The cells below the axes.
    """
    names, of = ["frame", ""], ""
    for above, axis, unit in list(zip(objects, axes, units, strict=True))[2:]:
        of = above.split()[-1].split(":")[0] if above else of
        is_quaternion = axis[:1] == "r" and "rw" in axes
        name = f"{of}.q{axis[1:]}" if is_quaternion else f"{of}.{axis}"
        names.append(f"{name}_{unit}" if unit and of else name if of else "")
    return names


def find_rate(heads: Sequence[Sequence[str]]) -> float:
    """Return the rate of images that stands alone in a header line, or behind its name, [1/s]; 0 if none does."""
    cells = [cell.lower() for head in heads for cell in head]
    alone = [filled[0] for head in heads if len(filled := [cell for cell in head if cell]) == 1]
    stated = [cells[cells.index(name) + 1] for name in ("export frame rate", "capture frame rate") if name in cells]
    return next((float(cell) for cell in (*stated, *alone) if cell.replace(".", "", 1).isdigit()), 0.0)
