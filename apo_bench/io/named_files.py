"""The files that an MJCF file is made of."""

from collections.abc import Iterable
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree

from apo_bench.errors import InputError
from apo_bench.io.safe_io import read_bytes

_FOLDERS = ("meshdir", "texturedir", "assetdir")
_MODELS = ("include", "model")
"""Elements whose file is MJCF again."""
_LARGEST_BYTES = 100_000_000


def list_named_files(mjcf: Path) -> tuple[Path, ...]:
    """An MJCF file and every file that it names, as far as they are there, in the order in which they are named.

    MuJoCo looks for a file in one folder only; a file of that name in another stated folder counts as well.
    """
    models = {mjcf.resolve(): mjcf}
    folders = {mjcf.parent: None}
    names: dict[str, None] = {}
    todo = [mjcf]
    while todo:
        model = todo.pop(0)
        folders[model.parent] = None
        for element in _elements(model):
            folders |= {mjcf.parent / text: None for key in _FOLDERS if (text := element.get(key))}
            named = [text for key, text in element.attrib.items() if key.startswith("file")]
            if element.tag not in _MODELS:
                names |= dict.fromkeys(named)
                continue
            for file in _found(named, (mjcf.parent, model.parent)):
                if file.resolve() not in models:
                    models[file.resolve()] = file
                    todo.append(file)
    # With strippath only the last part of a name counts.
    both = (each for name in names for each in (name, PurePosixPath(name).name))
    return tuple(dict.fromkeys([*models.values(), *_found(both, folders)]))


def _elements(model: Path) -> Iterable[ElementTree.Element]:
    """All elements of a file; none of one that cannot be read, which its reader refuses."""
    try:
        return ElementTree.fromstring(read_bytes(model, "MJCF file", _LARGEST_BYTES)).iter()
    except (ElementTree.ParseError, InputError, ValueError):
        return ()


def _found(names: Iterable[str], folders: Iterable[Path]) -> list[Path]:
    places = tuple(folders)
    return [place / name for name in names for place in places if name and (place / name).is_file()]
