"""Options of the command line for the settings of a trial, made from what is stated with each."""

from collections.abc import Callable, Iterable
from inspect import Parameter, signature
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from apo_bench.cli.completion import completion
from apo_bench.cli.values import numbers, path_given, whole_numbers, words
from apo_bench.records import NOISE_LEVEL, SETTINGS, SettingInfo
from apo_bench.records.run.replay_command import milli, number

Command = TypeVar("Command", bound=Callable[..., None])


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
    infos = {NOISE_LEVEL.name: NOISE_LEVEL, **SETTINGS}
    return [_of_trial(info) for name, info in infos.items() if info.help and (not names or name in names)]


def sweep_options() -> list[Parameter]:
    """Options of a sweep: its axes, and what all of its trials have in common."""
    axes = [info for info in (NOISE_LEVEL, *SETTINGS.values()) if info.axis and info.help]
    return [
        *map(_axis, [*axes, SETTINGS["noise_mm"], SETTINGS["noise_deg"]]),
        *map(_of_trial, [info for info in SETTINGS.values() if info.shared]),
    ]


def read_axis(info: SettingInfo, text: str) -> tuple[Any, ...]:
    """What was given for an axis: `0,0.5,1` or `none,contact`."""
    read = words if info.is_text else whole_numbers if info.is_whole else numbers
    return read(text, f"--{info.option}")


def shown_default(info: SettingInfo) -> str:
    """The default of a setting, in the unit of its option."""
    return info.usual or _in_option_unit(info, info.default)


def _of_trial(info: SettingInfo) -> Parameter:
    described = f"{info.help}; default: {shown_default(info)}."
    if info.name == "secret_seed":
        return _option(info.keyword, Path, described, parser=path_given, metavar="<path>")
    kind = getattr(info.kind, "__origin__", info.kind)
    return _option(info.keyword, kind, described, autocompletion=_completion_of(info))


def _axis(info: SettingInfo) -> Parameter:
    usual = ",".join(_in_option_unit(info, value) for value in info.swept) or shown_default(info)
    described = f"{info.help}; several with commas; default: {usual}."
    return _option(info.keyword, str, described, autocompletion=_completion_of(info))


def _completion_of(info: SettingInfo) -> Callable[[str], list[str]] | None:
    """How the value of a setting is completed; None where it is a number."""
    named = info.choices or info.name in ("noise", "arm", "contact_source", "method")
    return completion(info.name) if named else None


def _option(name: str, kind: Any, described: str, **more: Any) -> Parameter:
    annotation = Annotated[kind | None, typer.Option(help=described, **more)]
    return Parameter(name, Parameter.KEYWORD_ONLY, default=None, annotation=annotation)


def _in_option_unit(info: SettingInfo, value: Any) -> str:
    return str(value) if info.is_text else number(milli(value) if info.scale != 1.0 else value)
