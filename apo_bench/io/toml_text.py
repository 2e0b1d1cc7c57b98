"""Documents as TOML text."""

import json
from collections.abc import Iterator, Mapping
from typing import Any


def format_toml(document: Mapping[str, Any]) -> str:
    """Return a document of tables, lists, texts and numbers as TOML.

    Args:
        document: Keys without dots and quotes; a table in it becomes a section, and so does each of a list of tables.
    """
    return "\n".join(_lines(document, "")) + "\n"


def _lines(table: Mapping[str, Any], prefix: str) -> Iterator[str]:
    sections = []
    for key, value in table.items():
        if isinstance(value, Mapping):
            sections.append((f"[{prefix}{key}]", value, f"{prefix}{key}."))
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            sections += [(f"[[{prefix}{key}]]", each, f"{prefix}{key}.") for each in value]
        else:
            # JSON writes texts, numbers, truth values and lists as TOML has them.
            yield f"{key} = {json.dumps(value, ensure_ascii=False)}"
    for head, value, inner in sections:
        yield from ("", head, *_lines(value, inner))
