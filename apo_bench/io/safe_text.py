"""Make text from any source safe for a terminal and for Markdown."""

import re

# control characters, and characters that change the direction of text
_OBEYED = "\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069"
CONTROL = re.compile(f"[{_OBEYED}]")
"""Characters that a terminal executes instead of showing, or that change the direction of text."""
UNSHOWN = re.compile(f"[{_OBEYED}\ud800-\udfff]")
"""These characters, and half letters, which occur in file names that are not UTF-8."""

_LONGEST = 1500  # letters of a shortened text


def clean(text: str) -> str:
    """Return a text on one line, with control characters escaped as `\\x1b`."""
    return UNSHOWN.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


_MARKDOWN = re.compile(r"[&<>\\`*\[\]{}|$~]|(?<![^\W_])_|_(?![^\W_])")
"""Characters with a meaning in Markdown or HTML within a line; underscores only at the ends of a word."""


def escape_markdown(text: str) -> str:
    """Return a text on one line that Markdown shows literally, in a cell of a table or after other text.

    Characters with a meaning become character references, which no renderer takes for markup or HTML.
    """
    return _MARKDOWN.sub(lambda match: f"&#{ord(match[0])};", " ".join(clean(text).split()))


def shorten_text(text: str) -> str:
    """Return a text without its middle if it is too long to be read."""
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 2 :]}"
