"""The commands `apo-bench power rate | pairs | margin | shows`: how many trials it takes, and what so many show."""

from collections.abc import Mapping
from typing import Annotated, Any

import typer

from apo_bench.cli.arguments import AsJson
from apo_bench.cli.help import group
from apo_bench.cli.printing import print_answer
from apo_bench.cli.values import numbers
from apo_bench.errors import InputError
from apo_bench.statistics import (
    ERROR,
    evidence,
    least_discordant,
    margin_power,
    margin_trials,
    paired_power,
    paired_trials,
    percent,
    rate_trials,
    shares,
    wilson_half_width,
)

_HELP = "How many trials it takes: for a rate, for a difference, for no loss; and what so many can show."
_QUESTIONS = """How many trials does it take?
  apo-bench power rate --rate 0.9 --half-width 0.05     for a success rate, known to 5 points to either side
  apo-bench power pairs --win 0.1 --lose 0.02           to show which of two methods is better, over the same seeds
  apo-bench power margin --margin 0.03                  to show that a method is not worse by 3 points
  apo-bench power shows --trials 100                    what so many can show"""
_SCHEMA = "apo-bench/power/1"
power = group("power", _HELP, lambda: typer.echo(_QUESTIONS))

_Power = Annotated[float, typer.Option(help="How often it shall be shown if it is so.")]
_Win = Annotated[float | None, typer.Option(help="Share of the seeds at which the method alone is right.")]
_Lose = Annotated[float | None, typer.Option(help="Share of the seeds at which the reference alone is right.")]
_Rates = Annotated[str | None, typer.Option(help="Instead: the two success rates, as 0.95,0.85.")]
_Agree = Annotated[
    float | None, typer.Option(help="With --rates: share of the seeds at which both end alike; default: by chance.")
]
_Comparisons = Annotated[int, typer.Option(help="How many such tests the report makes; each is held to its share.")]


@power.command("rate")
def power_rate(
    half_width: Annotated[float, typer.Option(help="Half the width that the 95 % interval may have, as 0.05.")],
    rate: Annotated[float, typer.Option(help="The success rate that is expected; 0.5 takes most.")] = 0.5,
    as_json: AsJson = False,
) -> None:
    """Trials for a success rate: until Wilson's 95 % interval is narrow enough."""
    n = rate_trials(rate, half_width)
    reached = wilson_half_width(rate, n)
    _say(
        {"question": "rate", "rate": rate, "half_width": half_width, "trials": n, "reached": reached},
        f"{_many(n, 'trial')}: at a rate of {rate:g} Wilson's 95 % interval then reaches {100 * reached:.3g} points to "
        "either side of its middle.",
        as_json,
    )


@power.command("pairs")
def power_pairs(
    win: _Win = None,
    lose: _Lose = None,
    rates: _Rates = None,
    agree: _Agree = None,
    power: _Power = 0.8,
    comparisons: _Comparisons = 1,
    as_json: AsJson = False,
) -> None:
    """Seeds, met by both methods, until McNemar's exact test shows which one is better."""
    win, lose = _shares(win, lose, rates, agree)
    n = paired_trials(win, lose, power, comparisons)
    reached = paired_power(n, win, lose, ERROR / comparisons)
    _say(
        {"question": "pairs", "win": win, "lose": lose, "power": power, "comparisons": comparisons}
        | {"trials": n, "reached": reached},
        f"{_many(n, 'seed')}, each met by both methods: {_expected(win, lose)} McNemar's exact "
        f"test{_held(comparisons)} then shows which is better in {percent(reached)} of all sweeps.",
        as_json,
    )


@power.command("margin")
def power_margin(
    margin: Annotated[float, typer.Option(help="By how much the method may not be worse, as 0.03.")],
    win: _Win = None,
    lose: _Lose = None,
    rates: _Rates = None,
    agree: _Agree = None,
    power: _Power = 0.8,
    as_json: AsJson = False,
) -> None:
    """Seeds, met by both methods, until Tango's 95 % interval shows that one is not worse by a margin."""
    win, lose = (0.0, 0.0) if all(x is None for x in (win, lose, rates, agree)) else _shares(win, lose, rates, agree)
    n = margin_trials(margin, win, lose, power)
    reached = margin_power(n, margin, win, lose)
    expected = "if both end alike at every seed" if win == lose == 0.0 else _expected(win, lose)
    _say(
        {"question": "margin", "margin": margin, "win": win, "lose": lose, "power": power}
        | {"trials": n, "reached": reached},
        f"{_many(n, 'seed')}, each met by both methods: {expected}, Tango's 95 % interval then lies above "
        f"-{100 * margin:.3g} points in {percent(reached)} of all sweeps.",
        as_json,
    )


@power.command("shows")
def power_shows(
    trials: Annotated[int, typer.Option(help="Seeds per cell, the same for every method.")],
    power: _Power = 0.8,
    comparisons: _Comparisons = 1,
    as_json: AsJson = False,
) -> None:
    """What so many trials per cell can show at best."""
    s = evidence(trials, power, comparisons)
    if s.discordant is None or s.least_win is None:
        fewest = least_discordant(ERROR / comparisons)
        test = (
            f"McNemar's exact test{_held(comparisons)} can show no difference with so few: it takes {fewest} or more."
        )
    else:
        test = (
            f"McNemar's exact test{_held(comparisons)} rejects from {s.discordant} discordant pairs on, if all fall "
            f"one way; wins at {100 * s.least_win:.3g} % of the seeds, without a loss, are shown in {100 * power:g} "
            "% of all sweeps."
        )
    _say(
        {"question": "shows", "power": power, "comparisons": comparisons, "trials": trials}
        | {"half_width_at_0.5": s.half_width_50, "half_width_at_0.9": s.half_width_90}
        | {"low_95_if_all_right": s.all_right.low, "discordant": s.discordant, "least_win": s.least_win}
        | {"margin": s.margin},
        f"{_many(trials, 'trial')} per cell, with 95 % intervals:\n"
        f"  a rate of 0.5 is known to {100 * s.half_width_50:.3g} points to either side, one of 0.9 to "
        f"{100 * s.half_width_90:.3g};\n"
        f"  all right means a rate above {100 * s.all_right.low:.3g} %, none right one below "
        f"{100 * (1 - s.all_right.low):.3g} %;\n"
        f"  {test}\n"
        f"  If two methods end alike at every seed, neither is worse by more than {100 * s.margin:.3g} points.",
        as_json,
    )


def _shares(win: float | None, lose: float | None, rates: str | None, agree: float | None) -> tuple[float, float]:
    if rates is None and win is not None and lose is not None and agree is None:
        return win, lose
    if rates is None or win is not None or lose is not None:
        raise InputError(
            "the shares of wins and losses are not clear; give --win and --lose, or --rates with or without --agree."
        )
    two = numbers(rates, "--rates")
    if len(two) != 2:
        raise InputError(f"--rates {rates} was given; two numbers are allowed, as 0.95,0.85.")
    return shares(*two, agree)


def _many(n: int, what: str) -> str:
    return f"{n:,} {what}{'' if n == 1 else 's'}"


def _expected(win: float, lose: float) -> str:
    return f"with {100 * win:.3g} % wins and {100 * lose:.3g} % losses"


def _held(comparisons: int) -> str:
    return "" if comparisons == 1 else f", the first of {comparisons} by Holm,"


def _say(answer: Mapping[str, Any], words: str, as_json: bool) -> None:
    print_answer({"schema": _SCHEMA, **answer}, [words], as_json)
