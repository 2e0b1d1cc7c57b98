"""Options of the command line for the settings of a trial, made from what is stated with each; and how they complete.

When Tab is pressed, a shell is offered names out of short lists and folders, without anything being read. Where none
begins like what was typed, it offers files, as scenarios, noises and arms may be.

What the command line makes of the words it is given: numbers, paths, files to write.
"""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from inspect import Parameter, signature
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from apo_bench.errors import InputError, require
from apo_bench.io import check_target
from apo_bench.records import FOREIGN_ARMS, LEVEL, METHODS, RECOGNISED, SETTINGS, WRONG_RELATIONS, SettingInfo
from apo_bench.records.run.replay_command import milli, number
from apo_bench.resources import folder

NO_RESULT = 1
"""The exit code of a command that ended without the result it was asked for."""
Output = tuple[Path | None, str, tuple[str, ...]]
"""A file to write if any, its option, and the endings that its name may have."""
_Number = TypeVar("_Number", int, float)


def numbers(text: str, option: str) -> tuple[float, ...]:
    """`0,0.5,1` as numbers; whether they are allowed is checked where they are used."""
    return _converted(text, option, float, "numbers", "0,0.5,1")


def whole_numbers(text: str, option: str) -> tuple[int, ...]:
    """`0,2,4` as whole numbers."""
    return _converted(text, option, int, "whole numbers", "0,2,4")


def _converted(text: str, option: str, kind: type[_Number], called: str, example: str) -> tuple[_Number, ...]:
    entries = words(text, option)
    try:
        return tuple(map(kind, entries))
    except ValueError as error:
        raise InputError(
            f"{option} {text} was given; {called} with commas between them are allowed: {example}."
        ) from error


def words(text: str, option: str) -> tuple[str, ...]:
    """`oracle,none` as its entries."""
    entries = tuple(word.strip() for word in text.split(","))
    require(
        all(entries), f"{option} '{text}' was given; at least one entry is needed, with single commas between them."
    )
    return entries


def path_given(text: str) -> Path:
    """A path that names something: the empty text would stand for the current folder."""
    import typer

    if not text.strip():
        raise typer.BadParameter("an empty path was given; name a file or a folder.")
    return Path(text)


def check_outputs(outputs: Iterable[Output], inputs: Sequence[Path] = ()) -> None:
    """Refuse, before any work is done, files that cannot be written, or that are read as well."""
    for path, option, endings in outputs:
        if path is None:
            continue
        check_writable(path, option, endings)
        require(
            not any(path.exists() and source.exists() and path.samefile(source) for source in inputs),
            f"{option} {path} is a file that is read; name another, so that it is kept.",
        )


def check_writable(path: Path, option: str, endings: tuple[str, ...]) -> None:
    """Refuse, before any work is done, a file that has another ending or cannot be written."""
    allowed = " or ".join(endings)
    require(
        path.suffix.lower() in endings, f"{option} {path} was given; a file name that ends in {allowed} is allowed."
    )
    if not path.is_dir():
        check_target(path)
    folder = path.parent
    require(
        not path.is_dir()
        and folder.is_dir()
        and all(os.access(each, os.W_OK) for each in (folder, path) if each.exists()),
        f"{option} {path} cannot be written; name a file in a folder that exists and can be written.",
    )


@contextmanager
def writing(target: str = "") -> Iterator[None]:
    """Say that something cannot be written, such as `--out FILE`; the file that failed if it is not named."""
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{target or error.filename or 'a file'} cannot be written ({error.strerror}); choose another place."
        ) from error


def cores() -> int:
    """How many processes the machine gives this one, at most 64."""
    affinity: Any = getattr(os, "sched_getaffinity", None)
    return max(1, min(64, len(affinity(0)) if affinity else os.cpu_count() or 1))


Completion = Callable[[str], list[str]]
"""What was typed of a word -> the words that it may become."""
Command = TypeVar("Command", bound=Callable[..., None])


def offered_names(what: str) -> list[str]:
    """Names that a shell is offered for a setting, or `scenario`: what comes with the package, and how others begin."""
    if what == "scenario":
        return _stems("scenarios", "*.toml")
    if what == "noise":
        from apo_bench.observation.noise import NOISES

        return [*NOISES, *_stems("assets", "noise/*.toml")]
    if what == "arm":
        return [SETTINGS["arm"].default, *_stems("assets", "arms/*.toml"), *FOREIGN_ARMS]
    if what == "relations":
        return [SETTINGS["relations"].default, *RECOGNISED, *WRONG_RELATIONS]
    return [*METHODS, "search"] if what == "method" else [*SETTINGS[what].choices]


def completion(what: str) -> Completion:
    """Names that begin like what was typed, after its last comma."""

    def complete(incomplete: str) -> list[str]:
        before, comma, last = incomplete.rpartition(",")
        names = [name for name in offered_names(what) if name.startswith(last) and name not in before.split(",")]
        return [f"{before}{comma}{name}" for name in names]

    return complete


ScenarioArgument = Annotated[
    str,
    typer.Argument(
        help="A name out of `apo-bench scenarios`, generated:SEED, or a scenario file.",
        autocompletion=completion("scenario"),
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object, and nothing else.")]
StatedMm = Annotated[float | None, typer.Option(help="Its standard deviation where it states none, mm.")]
StatedDeg = Annotated[float | None, typer.Option(help="The same in degrees.")]


def takes(options: Iterable[Parameter]) -> Callable[[Command], Command]:
    """Give a command more options, between its plain and its keyword-only arguments; it gets them as `**options`."""

    def wrap(command: Command) -> Command:
        own = signature(command, eval_str=True)
        parameters = [p for p in own.parameters.values() if p.kind is not Parameter.VAR_KEYWORD]
        plain = [p for p in parameters if p.kind is not Parameter.KEYWORD_ONLY]
        vars(command)["__signature__"] = own.replace(parameters=[*plain, *options, *parameters[len(plain) :]])
        return command

    return wrap


def trial_options(*names: str) -> list[Parameter]:
    """Options of one trial, none of which need be given: those of these settings, or of all."""
    infos = {LEVEL.name: LEVEL, **SETTINGS}
    return [_of_trial(info) for name, info in infos.items() if info.help and (not names or name in names)]


def sweep_options() -> list[Parameter]:
    """Options of a sweep: its axes, and what all of its trials have in common."""
    axes = {info.axis: info for info in (LEVEL, *SETTINGS.values()) if info.axis and info.help}
    return [*map(_axis, axes.values()), *map(_of_trial, [info for info in SETTINGS.values() if info.shared])]


def axis_option(info: SettingInfo) -> str:
    """What the option of an axis is called, as an argument."""
    return (info.axis_option or info.option).replace("-", "_")


def axis_flag(info: SettingInfo) -> str:
    """The option of an axis as it is typed: `--robot-error`."""
    return f"--{axis_option(info).replace('_', '-')}"


def read_axis(info: SettingInfo, text: str) -> tuple[Any, ...]:
    """What was given for an axis: `0,0.5,1` or `none,contact`."""
    read = words if info.is_text else whole_numbers if info.is_whole else numbers
    return read(text, axis_flag(info))


def shown_default(info: SettingInfo) -> str:
    """The default of a setting, in the unit of its option."""
    return info.usual or _in_option_unit(info, info.default)


def _of_trial(info: SettingInfo) -> Parameter:
    described = f"{info.help}; default: {shown_default(info)}."
    if info.name == "salt":
        return _option(info.keyword, Path, described, parser=path_given, metavar="<path>")
    kind = info.kind.__origin__ if hasattr(info.kind, "__origin__") else info.kind
    return _option(info.keyword, kind, described, autocompletion=_completion_of(info))


def _axis(info: SettingInfo) -> Parameter:
    usual = ",".join(_in_option_unit(info, value) for value in info.swept) or shown_default(info)
    described = f"{info.help}; several with commas; default: {usual}."
    return _option(axis_option(info), str, described, autocompletion=_completion_of(info))


def _completion_of(info: SettingInfo) -> Completion | None:
    """How the value of a setting is completed; None where it is a number."""
    named = info.choices or info.name in ("noise", "arm", "relations", "method")
    return completion(info.name) if named else None


def _option(name: str, kind: Any, described: str, **more: Any) -> Parameter:
    annotation = Annotated[kind | None, typer.Option(help=described, **more)]
    return Parameter(name, Parameter.KEYWORD_ONLY, default=None, annotation=annotation)


def _in_option_unit(info: SettingInfo, value: Any) -> str:
    return str(value) if info.is_text else number(milli(value) if info.scale != 1.0 else value)


def _stems(where: str, pattern: str) -> list[str]:
    return sorted(path.stem for path in folder(where).glob(pattern))
