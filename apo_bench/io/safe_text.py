"""Text from anywhere, safe for a terminal and for Markdown."""

import re

_OBEYED = "\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069"
CONTROL = re.compile(f"[{_OBEYED}]")
"""What a terminal obeys instead of showing it, and what turns the direction of text."""
UNSHOWN = re.compile(f"[{_OBEYED}\ud800-\udfff]")
"""Control characters, and the half letters that stand in names of files which are not UTF-8."""

_LONGEST = 1500


def clean(text: str) -> str:
    """One line in which control characters stand as `\\x1b`."""
    return UNSHOWN.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


_MARKDOWN = re.compile(r"[&<>\\`*\[\]{}|$~]|(?<![^\W_])_|_(?![^\W_])")
"""What has a meaning in Markdown or HTML inside a line: underscores do at the ends of a word."""


def escape_markdown(text: str) -> str:
    """One line that Markdown shows as it is, in a cell of a table or behind other text.

    Every character with a meaning becomes a character reference, which begins neither markup nor HTML in any renderer.
    """
    return _MARKDOWN.sub(lambda match: f"&#{ord(match[0])};", " ".join(clean(text).split()))


def shorten_text(text: str) -> str:
    """Without the middle of what is too long to be read."""
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 2 :]}"
