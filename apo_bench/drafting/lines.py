"""In which line of a scenario file something stands that a sentence names."""

import re

_OPERATION = re.compile(r"operation (\d+)(?:, (\w+))?")
_PART = re.compile(r"parts, (\w+)(?:, (\w+))?")
_SITE = re.compile(r"site\b")


def line_of(text: str, sentence: str) -> int | None:
    """The line, from 1, of `operation 2, grasp` or `parts, pin, start`, with which sentences about files begin.

    Of a key that is not there: the line of its table.
    """
    lines = text.splitlines()
    if found := _OPERATION.match(sentence):
        heads = [i for i, line in enumerate(lines) if line.startswith("[[operations]]")]
        k = int(found[1]) - 1
        return _key(lines, heads[k], found[2]) if 0 <= k < len(heads) else None
    if found := _PART.match(sentence):
        head = next((i for i, line in enumerate(lines) if line.startswith(f"[parts.{found[1]}]")), None)
        return None if head is None else _key(lines, head, found[2])
    if _SITE.match(sentence):
        head = next((i for i, line in enumerate(lines) if line.startswith("[site]")), None)
        return None if head is None else head + 1
    return None


def _key(lines: list[str], head: int, key: str | None) -> int:
    for i in range(head + 1, len(lines)):
        if lines[i].startswith("["):
            break
        if key and re.match(rf"{re.escape(key)}\s*=", lines[i]):
            return i + 1
    return head + 1
