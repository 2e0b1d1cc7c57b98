"""Make command-line options for the settings of a trial from the description of each setting."""

from collections.abc import Callable, Iterable
from inspect import Parameter, signature
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from apo_bench.cli.shared.arguments import make_path_option
from apo_bench.cli.shared.completion import complete_last_word
from apo_bench.cli.shared.values import parse_list
from apo_bench.records import NOISE_LEVEL, SETTINGS, SettingInfo
from apo_bench.records.run.replay_command import format_number, round_up_to_ms

Command = TypeVar("Command", bound=Callable[..., None])


def add_options(options: Iterable[Parameter]) -> Callable[[Command], Command]:
    """Return a decorator that adds options to a command, which gets them as `**options`."""

    def wrap(command: Command) -> Command:
        own = signature(command, eval_str=True)
        parameters = [p for p in own.parameters.values() if p.kind is not Parameter.VAR_KEYWORD]
        plain = [p for p in parameters if p.kind is not Parameter.KEYWORD_ONLY]
        # between plain and keyword-only ones
        vars(command)["__signature__"] = own.replace(parameters=[*plain, *options, *parameters[len(plain) :]])
        return command

    return wrap


def make_trial_options(*names: str) -> list[Parameter]:
    """Return the options of one trial for these settings, or for all; each option may be omitted."""
    infos = {NOISE_LEVEL.name: NOISE_LEVEL, **SETTINGS}
    return [_make_trial_option(info) for name, info in infos.items() if info.help and (not names or name in names)]


def make_sweep_options() -> list[Parameter]:
    """Return the options of a sweep: its axes, and the settings that all of its trials share."""
    # settings that may have several values
    axes = [info for info in (NOISE_LEVEL, *SETTINGS.values()) if info.axis and info.help]
    shared = [info for info in SETTINGS.values() if info.shared]
    return [
        *map(_make_axis_option, [*axes, SETTINGS["noise_mm"], SETTINGS["noise_deg"]]),
        *map(_make_trial_option, shared),
    ]


def read_axis(info: SettingInfo, text: str) -> tuple[Any, ...]:
    """Parse the values of an axis: `0,0.5,1` or `uncorrected,contact`."""
    kind = str if info.is_text else int if info.is_whole else float
    return parse_list(text, f"--{info.option}", kind)


def format_default(info: SettingInfo) -> str:
    """Return the default of a setting as text, in the unit of its option."""
    return info.usual or _convert_to_option_unit(info, info.default)


def _make_trial_option(info: SettingInfo) -> Parameter:
    """Return the option of a setting of one trial, which takes one value."""
    description = f"{info.help}; default: {format_default(info)}."
    if info.name == "secret_seed":
        return _make_parameter(info, Path, make_path_option(description))
    return _make_parameter(info, getattr(info.kind, "__origin__", info.kind), _make_option(info, description))


def _make_axis_option(info: SettingInfo) -> Parameter:
    """Return the option of a setting of a sweep, which takes several values separated by commas."""
    usual = ",".join(_convert_to_option_unit(info, value) for value in info.swept) or format_default(info)
    return _make_parameter(info, str, _make_option(info, f"{info.help}; several with commas; default: {usual}."))


def _make_option(info: SettingInfo, description: str) -> Any:
    """Return the typer option of a setting, with completion if its values are names."""
    named = info.choices or info.name in ("noise", "arm", "contact_source", "method")
    return typer.Option(help=description, autocompletion=complete_last_word(info.name) if named else None)


def _make_parameter(info: SettingInfo, kind: Any, option: Any) -> Parameter:
    """Return a setting as a keyword-only parameter of a command, with default None."""
    annotation = Annotated[kind | None, option]
    return Parameter(info.keyword, Parameter.KEYWORD_ONLY, default=None, annotation=annotation)


def _convert_to_option_unit(info: SettingInfo, value: Any) -> str:
    return str(value) if info.is_text else format_number(round_up_to_ms(value) if info.scale != 1.0 else value)
