"""The table of what became of foreign assemblies, both halves apart, and every refusal with its sentence."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

METHODS = ("oracle", "contact", "snap", "uncorrected")
_GRASP = re.compile(r"gripper|grasp|fingers|held")
_TURNING = re.compile(r"turning over")
_DRAFTS = {
    "overlap": re.compile(r"inside each other"),
    "order": re.compile(r"there is no order"),
}

Line = Mapping[str, Any]
Own = Sequence[Line]


def came_to(own: Own) -> str:
    """`scenario`, or what stopped it, as the page says; `grasp`, `turning` count apart."""
    if any("failed" in line for line in own):
        return "failed"
    if any("refused" in line for line in own):
        return "import"
    draft = next((str(line["draft"]) for line in own if line.get("draft")), "")
    if draft:
        return next((end for end, said in _DRAFTS.items() if said.search(draft)), "draft")
    wrong = list(_wrong(own))
    tried = [line["success"] for line in own if "success" in line]
    if not wrong:
        return "human" if tried and all(success is None for success in tried) else "scenario"
    if all(_GRASP.search(sentence) or _TURNING.search(sentence) for sentence in wrong):
        return "turning" if any(_TURNING.search(sentence) for sentence in wrong) else "grasp"
    return "check"


def _wrong(own: Own) -> Iterator[str]:
    return (sentence for line in own for sentence in line.get("wrong", ()))


def _said(own: Own) -> Iterator[str]:
    """Every sentence that stands between an assembly and its rates."""
    for line in own:
        yield from (str(line[key]).splitlines()[0] for key in ("failed", "refused", "draft") if line.get(key))
        yield from line.get("wrong", ())


_HEAD = """# Assemblies that others drew

Written by `python benchmarks/foreign.py benchmarks/foreign.json FOLDER --page docs/results/foreign.md`. The list was
fixed before its first file was imported; where each file is from, its licence and its hash stand there, and nothing
of the files is kept. Parts are imported at their places, a scenario is drafted without a hand and checked, and trials
are run at 1 mm and 1 degree. What came of it: `scenario`; or `import` (a file makes no part), `overlap` (the convex
pieces of parts are inside each other), `order` (they cannot be put together one after the other without screws, glue
or a third hand), `draft` (no scenario for another reason), `check` (one that cannot be done), `grasp`, `turning`
(that cannot be held, or needs turning over), `human` (the hands that demonstrate never get it right, so no trial
counts), `failed` (an error of this program). `code` is the commit that was run; an assembly without a line was not
run.

**Why so few become scenarios.** Most were drawn to be screwed, pressed or glued together, and a robot that lays parts
on one another cannot do that: `overlap` and `order` are what the sentences below say of the files. Of six that were
held out some were imported once at an earlier state, before their half was opened; `duck_antenna`,
`openbot_glue_top` and `openbot_rtr` were run again after a mend that their refusals led to.

"""


def page(tried: Sequence[tuple[str, str, Own]], listed: Mapping[str, int]) -> str:
    """The table as a page of results.

    Args:
        listed: Half -> how many assemblies the list has in it.
    """
    runs = ", ".join(f"{sum(each == half for _, each, _ in tried)} of {many} {half}" for half, many in listed.items())
    return f"{_HEAD}Run, of those of the list: {runs}.\n\n{table(tried).rstrip()}\n"


def table(tried: Sequence[tuple[str, str, Own]]) -> str:
    """All of it, in Markdown.

    Args:
        tried: Name, half and lines of each assembly.
    """
    made: list[str] = []
    for half in dict.fromkeys(half for _, half, _ in tried):
        those = [(name, own) for name, each, own in tried if each == half]
        made += [f"## {half}: {len(those)} assemblies", "", *_rows(those), "", *_sums([own for _, own in those]), ""]
        made += ["Sentences, numbers and names left out:", "", *_sentences(own for _, own in those), ""]
        made += [f"- {name}: {sentence}" for name, own in those for sentence in dict.fromkeys(_said(own))]
        wrong = [(name, line) for name, own in those for line in own if line.get("success", True) is not True]
        wrong = [(name, line) for name, line in wrong if line["method"] in METHODS[:2]]
        made += ["", "Trials that failed:", ""] if wrong else []
        made += [f"- {name}, `{x['method']}`, seed {x['seed']}: {x['code']}, {x['sentence']}" for name, x in wrong]
        made += [""]
    return "\n".join(made)


def _rows(those: Sequence[tuple[str, Own]]) -> Iterator[str]:
    yield f"| assembly | files | flat, round, no contact | contacts | came to | {' | '.join(METHODS)} | code |"
    yield "|" + "---|" * (6 + len(METHODS))
    for name, own in those:
        files = [line for line in own if "file" in line]
        well = [line for line in files if "refused" not in line]
        faces = ", ".join(str(sum(line[kind] for line in well)) for kind in ("flat", "round", "no_contact"))
        contacts = next((line["contacts"] for line in own if "contacts" in line), {})
        kinds = ", ".join(f"{count} {kind}" for kind, count in contacts.items())
        cells = (f"{len(well)} of {len(files)}", faces, kinds, came_to(own), *(_rate(own, m) for m in METHODS))
        code = next((str(line.get("code", "")) for line in own if "ended" in line), "")
        yield f"| {name} | {' | '.join(cells)} | {code} |"


def _sums(every: Sequence[Own]) -> Iterator[str]:
    files = [line for own in every for line in own if "file" in line]
    well = [line for line in files if "refused" not in line]
    ends = Counter(map(came_to, every))
    counted = len(every) - ends["grasp"] - ends["turning"]
    yield f"- files imported: {len(well)} of {len(files)}, {sum(line['round'] > 0 for line in well)} with round faces"
    yield f"- came to: {', '.join(f'{count} {end}' for end, count in ends.most_common())}"
    yield f"- scenarios, of those not refused for a grasp or for turning over: {ends['scenario']} of {counted}"
    usable = [line for own in every if came_to(own) == "scenario" for line in own]
    yield "- trials of these: " + ", ".join(f"`{method}` {_rate(usable, method) or '-'}" for method in METHODS)


def _rate(own: Own, method: str) -> str:
    counted = [line["success"] for line in own if line.get("method") == method and line["success"] is not None]
    return f"{sum(counted)} of {len(counted)}" if counted else ""


def _sentences(every: Iterable[Own]) -> Iterator[str]:
    """How many assemblies hear each sentence."""
    heard = Counter(
        form for own in every for form in {_form(sentence) for said in _said(own) for sentence in said.split("; '")}
    )
    yield from (f"- {count}: {form}" for form, count in heard.most_common())


def _form(sentence: str) -> str:
    bare = re.sub(r"^\S+\.(stl|obj|step|stp|3mf)(, [^:]*)?: ", "", sentence, flags=re.IGNORECASE)
    bare = re.sub(r"'?[\w.]+'", "'X'", bare)
    return re.sub(r"-?\d[\d,.]*(e-?\d+)?", "N", bare)
