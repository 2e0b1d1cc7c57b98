"""The MJCF files of an arm as one tree: with what it includes, by the list of what it may say, without pictures.

Every file is opened as one that somebody else wrote. MuJoCo reads no other MJCF file than this tree.
"""

from collections import Counter
from pathlib import Path, PurePosixPath
from typing import NamedTuple, NoReturn, final
from xml.etree.ElementTree import Element, TreeBuilder, tostring
from xml.parsers import expat

from apo_bench.errors import InputError, one_line, require
from apo_bench.io import opened, read_bytes
from apo_bench.simulation.arms.allowed import (
    ARM_REMEDIES,
    ATTRIBUTES,
    IGNORED_ELEMENTS,
    IGNORED_FLAGS,
    IGNORED_OPTIONS,
    INSIDE,
    LARGEST_MESH_BYTES,
    LARGEST_MJCF_BYTES,
    LONGEST_VALUE,
    MESHES,
    MOST_ELEMENTS,
    MOST_FILES,
    MOST_MESH_BYTES,
    MOST_NESTED,
    MOST_OF,
    WRAPPED,
    wrong_value,
)

_LONGEST = 200


class ModelTree(NamedTuple):
    """An arm or a gripper as its files say it."""

    root: Element
    files: tuple[Path, ...]
    """The MJCF file and those that it includes; then the meshes that it names."""

    @property
    def text(self) -> str:
        return tostring(self.root, encoding="unicode")


def read_model_tree(path: Path, kind: str) -> ModelTree:
    """Read an MJCF file and what it includes.

    Meshes have their whole paths. Of assets that have one name the first is taken, as robosuite takes them.

    Args:
        kind: What the file should be, for messages: `arm`, `gripper`.

    Raises:
        InputError: A file cannot be read, is no XML, or says what an arm may not say; a mesh is missing.
    """
    reading = _Reading(path, kind)
    root = reading.tree(path, 0)
    return ModelTree(root, (*reading.files, *_meshes(root, path, kind)))


@final
class _Reading:
    """Counts what all files say together."""

    def __init__(self, path: Path, kind: str) -> None:
        self.main = path
        self.kind = kind
        self.files: list[Path] = []
        self.counts: Counter[str] = Counter()

    def tree(self, path: Path, deep: int) -> Element:
        """A file, with what it includes in the places of that."""
        require(
            len(self.files) < MOST_FILES and deep <= MOST_NESTED,
            f"{self.main}: more than {MOST_FILES} files are included; write them into fewer.",
        )
        require(
            not any(path.exists() and path.samefile(each) for each in self.files),
            f"{path}: the file is included twice; include it once.",
        )
        self.files.append(path)
        raw = read_bytes(path, f"MJCF file of the {self.kind}", LARGEST_MJCF_BYTES)
        reader = _Parser(path, self)
        try:
            reader.parser.Parse(raw, True)
        except InputError:
            raise
        except (expat.ExpatError, ValueError) as error:
            raise InputError(
                f"{path}: MuJoCo cannot read this MJCF file of the {self.kind}: not well-formed XML ({error})."
            ) from error
        root = reader.builder.close()
        self._include(root, path, deep)
        if not deep:
            _check_element(path, root, None)
        return root

    def _include(self, element: Element, path: Path, deep: int) -> None:
        inside: list[Element] = []
        for child in element:
            if child.tag != "include":
                self._include(child, path, deep)
                inside.append(child)
                continue
            require(
                set(child.attrib) == {"file"} and not len(child),
                f"{path}: an <include> has a file= and nothing else; mend it.",
            )
            beside = (self.main.parent / child.attrib["file"], path.parent / child.attrib["file"])
            there = next((each for each in beside if each.exists()), beside[0])
            inside.extend(self.tree(there, deep + 1))
        element[:] = inside


@final
class _Parser:
    """Elements and attributes, and nothing else."""

    def __init__(self, path: Path, reading: _Reading) -> None:
        self.path = path
        self._reading = reading
        self._deep = 0
        self.builder = TreeBuilder()
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.StartDoctypeDeclHandler = self._doctype

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        counts = self._reading.counts
        counts[tag] += 1
        counts[""] += 1
        self._deep += 1
        where = f"{self.path}, line {self.parser.CurrentLineNumber}"
        if counts[""] > MOST_ELEMENTS or counts[tag] > MOST_OF.get(tag, MOST_ELEMENTS):
            most = MOST_OF.get(tag, MOST_ELEMENTS)
            raise InputError(f"{where}: there are more than {most:,} <{tag[:60]}>, the most that an arm may have.")
        require(
            self._deep <= MOST_NESTED, f"{where}: elements stand in each other {MOST_NESTED} deep; that is the most."
        )
        for key, text in attributes.items():
            require(
                len(text) <= LONGEST_VALUE,
                f"{where}: {key[:60]}= has more than {LONGEST_VALUE:,} letters, which is the most.",
            )
        self.builder.start(tag, attributes)

    def _end(self, tag: str) -> None:
        self._deep -= 1
        self.builder.end(tag)

    def _doctype(self, *_: object) -> None:
        raise InputError(f"{self.path}: <!DOCTYPE> is given, which an arm may not say; remove it.")


def _check_element(path: Path, element: Element, outer: Element | None) -> None:
    """Refuse what may not be said, and take out what a scene has of its own."""
    tag = element.tag
    around = "" if outer is None else outer.tag
    require(
        outer is not None or tag == "mujoco",
        f"{path}: the outermost element is <{tag[:60]}>; an MJCF file begins with <mujoco>.",
    )
    allowed = WRAPPED.get((around, tag), ATTRIBUTES[tag])
    element.attrib.pop("material", None)
    if tag == "default":
        element.attrib.pop("group", None)  # says nothing there, and stands in files of robosuite
    for key, text in element.attrib.items():
        if key not in allowed:
            _refuse(path, f"{_called(element)} has {key[:60]}=, which an arm may not say", key)
        if wrong := wrong_value(tag, key, text):
            _refuse(path, f'{_called(element)} has {key}="{text[:60]}"; {wrong}')
    kept = []
    for child in element:
        if child.tag == "option":
            _check_option(path, child)
        elif child.tag not in IGNORED_ELEMENTS:
            if child.tag not in INSIDE.get(tag, ()):
                _refuse(path, f"<{child.tag[:60]}> stands in <{tag}>, which an arm may not say", child.tag)
            _check_element(path, child, element)
            kept.append(child)
    element[:] = kept


def _check_option(path: Path, option: Element) -> None:
    """A scene says how it is simulated; what would be another physics is not passed over."""
    flags = {key for child in option for key in child.attrib}
    for key in (*sorted(set(option.attrib) - IGNORED_OPTIONS), *sorted(flags - IGNORED_FLAGS)):
        _refuse(path, f"<option> has {key[:60]}, which an arm may not say: the scene says how it is simulated")
    for key in ("density", "viscosity", "wind"):
        if any(word.strip("0.+-") for word in option.get(key, "").split()):
            _refuse(path, f"<option> has {key}=, which an arm may not say: it stands in still air")


def _meshes(root: Element, path: Path, kind: str) -> list[Path]:
    """The files of meshes that are named, each set to its whole path; what is not there is said where it is used."""
    files = []
    size = 0
    compilers = [element.attrib for element in root.iter("compiler")]
    beside = next((each[key] for key in ("meshdir", "assetdir") for each in compilers[::-1] if key in each), "")
    strip = any(each.get("strippath") == "true" for each in compilers)
    for attributes in compilers:
        for key in ("meshdir", "texturedir", "assetdir", "strippath"):
            attributes.pop(key, None)
    for assets in root.iter("asset"):
        names: set[str] = set()
        for mesh in list(assets):
            name = mesh.get("name") or PurePosixPath(mesh.get("file", "")).stem
            if name in names:
                assets.remove(mesh)
                continue
            names.add(name)
            if "file" not in mesh.attrib:
                continue
            stated = PurePosixPath(mesh.attrib["file"]).name if strip else mesh.attrib["file"]
            file = path.parent / beside / stated
            mesh.set("name", name)
            mesh.set("file", str(file.absolute()))
            if file.suffix.lower() not in MESHES:
                _refuse(path, f"the mesh file {one_line(stated, _LONGEST)} is none of {', '.join(MESHES)}")
            if file.exists():
                size += checked_size(file, kind)
                files.append(file)
    if size > MOST_MESH_BYTES * 5:
        _refuse(path, f"its meshes have {size / 1e6:.0f} MB; {MOST_MESH_BYTES * 5 / 1e6:g} are the most")
    return files


def checked_size(file: Path, kind: str) -> int:
    """How large a mesh is, in bytes.

    Raises:
        InputError: It is no ordinary file, or too large.
    """
    with opened(file, f"mesh of the {kind}") as mesh:
        size = mesh.seek(0, 2)
    require(
        size <= LARGEST_MESH_BYTES,
        f"{file}: the mesh has {size / 1e6:.0f} MB; {LARGEST_MESH_BYTES / 1e6:g} are the most.",
    )
    return size


def _called(element: Element) -> str:
    name = element.get("name") or element.get("class")
    return f"<{element.tag}> '{name[:60]}'" if name else f"<{element.tag}>"


def _refuse(path: Path, sentence: str, name: str = "") -> NoReturn:
    remedy = ARM_REMEDIES.get(name, "remove it, or mend the file")
    raise InputError(f"{path}: {sentence}; {remedy}.")
