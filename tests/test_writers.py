"""Result files are written by `apo_bench.io.replace_file`: no other call in the package can write one."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "apo_bench"
EXCEPTIONS = {
    "io/streams.py": {"os.open": 1},  # /dev/null
    "io/result_files.py": {"open": 2, "os.replace": 1},  # the function
    "records/secret_seed.py": {"open": 1, "os.open": 1},  # a file that only its owner can read
    "records/run/run_folder.py": {"open": 1, "os.write": 1},  # records are appended; half of a last line is cut off
    "benchmark/scoring/program.py": {"TemporaryFile": 2},  # request and answer of a program; no result
    "benchmark/sweeps/cluster.py": {"copyfile": 1, "touch": 1},  # a temporary folder
}
"""File -> calls that write something else than a result file, and how many."""
WRITERS = {
    "write_text",
    "write_bytes",
    "savetxt",
    "tofile",
    "to_csv",
    "to_parquet",
    "rename",
    "symlink_to",
    "hardlink_to",
}
WRITERS |= {"mkstemp", "NamedTemporaryFile", "TemporaryFile"}
OF_OS = {"open", "write", "replace", "rename", "link", "symlink", "sendfile", "mkfifo"}
TO_A_FILE = {
    **dict.fromkeys(
        ("savefig", "savez", "savez_compressed", "save", "imwrite", "imsave", "mimsave", "ParquetWriter"), 0
    ),
    **dict.fromkeys(("File", "ZipFile", "tostream"), 0),
    **dict.fromkeys(("write_table", "dump"), 1),
}
"""What writes to a path or to an open file -> the place of that argument, which must be a `replace_file`, or memory."""


def writes(tree: ast.Module) -> Iterator[tuple[str, int]]:
    """Calls that can write a file: the name, and the line."""
    safe = set(_safe_names(tree))
    for call in ast.walk(tree):
        if not isinstance(call, ast.Call):
            continue
        name, owner = _called(call)
        if owner == "os" and name in OF_OS:
            if name != "open" or not _reads(call):
                yield f"os.{name}", call.lineno
        elif name in ("open", "fdopen"):
            if not _opens_to_read(call, owner):
                yield name, call.lineno
        elif name in WRITERS or _copies(owner, name) or (name == "touch" and not call.args):
            yield name, call.lineno
        elif name in TO_A_FILE:
            place = TO_A_FILE[name]
            if not all(_is_safe(target, safe) for target in call.args[place : place + 1]) or not call.args:
                yield name, call.lineno


def _called(call: ast.Call) -> tuple[str, str]:
    """What is called, and of what it is an attribute."""
    if isinstance(call.func, ast.Attribute):
        owner = call.func.value
        return call.func.attr, owner.id if isinstance(owner, ast.Name) else ""
    return (call.func.id if isinstance(call.func, ast.Name) else ""), ""


def _opens_to_read(call: ast.Call, owner: str) -> bool:
    """Whether the mode says so; `archive.open(entry)` of a zip file has none."""
    is_method = isinstance(call.func, ast.Attribute) and owner not in ("os", "io")
    modes = call.args[:1] if is_method else call.args[1:2]
    modes = [*(mode for mode in modes if not (is_method and isinstance(mode, ast.Name)))]
    modes += [keyword.value for keyword in call.keywords if keyword.arg == "mode"]
    return all(isinstance(mode, ast.Constant) and not set(str(mode.value)) & set("wax+") for mode in modes)


def _copies(owner: str, name: str) -> bool:
    return owner == "shutil" and name not in ("rmtree", "which")


def _reads(call: ast.Call) -> bool:
    """Whether the flags of `os.open` say so."""
    flags = {node.attr for argument in call.args[1:2] for node in ast.walk(argument) if isinstance(node, ast.Attribute)}
    return "O_RDONLY" in flags


def _safe_names(tree: ast.Module) -> Iterator[str]:
    """Names that stand for a file of `replace_file`, or for one in memory."""
    for node in ast.walk(tree):
        if isinstance(node, ast.withitem) and isinstance(node.optional_vars, ast.Name):
            if _is_safe(node.context_expr, set()):
                yield node.optional_vars.id
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and _is_safe(node.value, set()):
            yield node.targets[0].id


def _is_safe(target: ast.expr, safe: set[str]) -> bool:
    if isinstance(target, ast.Constant):
        return target.value == "<bytes>"
    if isinstance(target, ast.Name):
        return target.id in safe
    calls = [_called(node)[0] for node in ast.walk(target) if isinstance(node, ast.Call)]
    return bool({"replace_file", "StringIO", "BytesIO"} & set(calls))


def found_in(text: str) -> dict[str, int]:
    """Name of a call -> how many there are."""
    names = [name for name, _ in writes(ast.parse(text))]
    return {name: names.count(name) for name in names}


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_nothing_else_writes_files(path: Path) -> None:
    assert found_in(path.read_text(encoding="utf-8")) == EXCEPTIONS.get(path.relative_to(PACKAGE).as_posix(), {})


@pytest.mark.parametrize(
    "breach",
    [
        "open(path, 'w')",
        "open(path, how)",
        "os.open(path, os.O_WRONLY)",
        "path.write_text(text)",
        "figure.savefig(path)",
        "h5py.File(path, 'w')",
        "pickle.dump(form, open(path, 'wb'))",
        "with open(path) as file:\n    figure.savefig(file)",
        "tempfile.NamedTemporaryFile()",
    ],
)
def test_every_other_way_to_write_is_noticed(breach: str) -> None:
    assert found_in(breach)


@pytest.mark.parametrize(
    "text",
    [
        "open(path, 'rb')",
        "os.open(path, os.O_RDONLY | flags)",
        "with replace_file(path) as file:\n    figure.savefig(file)\n    np.savez(file, a=a)\n    dump(a, file)",
        "parquet.ParquetWriter(stack.enter_context(replace_file(path)), schema)",
        "imageio.imwrite('<bytes>', image, extension='.png')",
        "file = io.StringIO()\nfigure.savefig(file)",
    ],
)
def test_the_right_way_is_not(text: str) -> None:
    assert not found_in(text)
