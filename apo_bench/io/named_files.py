"""Find the files that an MJCF file consists of."""

from collections.abc import Iterable
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree

from apo_bench.errors import InputError
from apo_bench.io.safe_io import read_bytes

_FOLDERS = ("meshdir", "texturedir", "assetdir")  # attributes that name folders of files
_MODELS = ("include", "model")
"""Elements whose file is MJCF too."""
_LARGEST_BYTES = 100_000_000


def list_named_files(mjcf: Path) -> tuple[Path, ...]:
    """Return an MJCF file and all existing files that it names, in the order in which they are named.

    MuJoCo searches one folder only; here a file of that name in any other stated folder counts as well.
    """
    models = {mjcf.resolve(): mjcf}  # resolved path -> path, of MJCF files
    folders = {mjcf.parent: None}
    names: dict[str, None] = {}
    todo = [mjcf]
    while todo:
        model = todo.pop(0)
        folders[model.parent] = None
        for element in _list_elements(model):
            folders |= {mjcf.parent / text: None for key in _FOLDERS if (text := element.get(key))}
            named = [text for key, text in element.attrib.items() if key.startswith("file")]
            if element.tag not in _MODELS:
                names |= dict.fromkeys(named)
                continue
            for file in _find_file(named, (mjcf.parent, model.parent)):
                if file.resolve() not in models:
                    models[file.resolve()] = file
                    todo.append(file)
    # with MuJoCo's option strippath only the last part of a name counts
    both = (each for name in names for each in (name, PurePosixPath(name).name))
    return tuple(dict.fromkeys([*models.values(), *_find_file(both, folders)]))


def _list_elements(model: Path) -> Iterable[ElementTree.Element]:
    """Return all elements of an MJCF file; none of an unreadable file, which MuJoCo reports."""
    try:
        return ElementTree.fromstring(read_bytes(model, "MJCF file", _LARGEST_BYTES)).iter()
    except (ElementTree.ParseError, InputError, ValueError):
        return ()


def _find_file(names: Iterable[str], folders: Iterable[Path]) -> list[Path]:
    """Return the existing files of these names in these folders."""
    places = tuple(folders)
    return [place / name for name in names for place in places if name and (place / name).is_file()]
