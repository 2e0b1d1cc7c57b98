"""Write documents as TOML text."""

import json
from collections.abc import Iterator, Mapping
from typing import Any


def format_toml(document: Mapping[str, Any]) -> str:
    """Return a document of tables, lists, texts and numbers as TOML.

    Args:
        document: Keys without dots and quotes; each table in it, and each of a list of tables, becomes a section.
    """
    return "\n".join(_list_lines(document, "")) + "\n"


def _list_lines(table: Mapping[str, Any], prefix: str) -> Iterator[str]:
    """Yield the lines of a table: first its plain keys, then its sections, whose names begin with `prefix`."""
    sections = []
    for key, value in table.items():
        if isinstance(value, Mapping):
            sections.append((f"[{prefix}{key}]", value, f"{prefix}{key}."))
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            sections += [(f"[[{prefix}{key}]]", each, f"{prefix}{key}.") for each in value]
        else:
            # JSON and TOML write texts, numbers, booleans and lists in the same way
            yield f"{key} = {json.dumps(value, ensure_ascii=False)}"
    for head, value, inner in sections:
        yield from ("", head, *_list_lines(value, inner))
