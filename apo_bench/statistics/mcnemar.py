"""McNemar's exact test: whether two methods over the same seeds are right equally often."""


def mcnemar(only_first: int, only_second: int) -> float:
    """The two-sided exact p-value: how unlikely so uneven a split is if each discordant pair falls either way alike.

    After Q. McNemar, Note on the sampling error of the difference between correlated proportions or percentages,
    Psychometrika 12 (1947), 153-157; exact by the binomial distribution. Without a discordant pair it is 1.

    Args:
        only_first: Pairs in which the first alone succeeded.
        only_second: Pairs in which the second alone succeeded.
    """
    from scipy.stats import binomtest

    pairs = only_first + only_second
    return float(binomtest(min(only_first, only_second), pairs, 0.5).pvalue) if pairs else 1.0
