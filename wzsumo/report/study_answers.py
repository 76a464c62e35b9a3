"""What a study answers: a headline that says no more than its seeds support, a sentence a method and a sentence a factor."""

from typing import Any

import pandas as pd

from wzsumo.case.methods import is_baseline
from wzsumo.errors import count_of
from wzsumo.figures.sweep_figures import factors_of, level_text, name_of
from wzsumo.sweep.summary import (
    REQUIRED_SAFE_SHARE,
    TRACES_FACTOR,
    compare,
    seeds_to_show,
    summarise,
    traces_needed,
    whole_seeds,
)

WORDS = {"clean": "clean drives", "safe_plan": "safe plans"}
MEANING = {
    "clean": "A clean drive reaches its goal within all limits of conduct.",
    "safe_plan": "A safe plan: a path was found, and its outline touches no device, no pavement edge and not the closed area.",
}


def measure_of(table: pd.DataFrame) -> str:
    """What the study is held against: clean drives where it drives, else safe plans."""
    return "clean" if table["clean"].notna().any() else "safe_plan"


def headline(table: pd.DataFrame) -> list[str]:
    """Two sentences: the best method with its share, and what the seeds support of it."""
    table = _finished(table)
    measure, method = measure_of(table), best_method(table)
    if method is None:
        return ["No case is finished, so the study does not answer yet."]
    rows = table[table["method"] == method]
    enough = _enough_traces(table, method)
    basis = f"With “{method}”"
    if enough is not None:
        rows = rows[rows[TRACES_FACTOR] >= enough]
        most = enough == table[TRACES_FACTOR].max()
        basis += f" on maps of {level_text(enough)} {_traces_word(enough)}{'' if most else ' or more'}"
    return [f"{basis}, {_share(rows, measure)}{_pooled(rows, without=[])}.", _support(rows, measure)]


def method_sentences(table: pd.DataFrame) -> list[str]:
    """One sentence a method: how often, on how many seeds that rests, and how many traces it takes."""
    table = _finished(table)
    measure = measure_of(table)
    return [
        f"“{method}”: {_share(rows, measure)}{_pooled(rows, without=[])}.{_traces(table, method)}"
        for method in dict.fromkeys(table["method"])
        if (rows := table[table["method"] == method])[measure].notna().any()
    ]


def factor_sentences(table: pd.DataFrame) -> list[str]:
    """One sentence a factor: the share at its two ends for the best method, and the paired difference with its interval."""
    table = _finished(table)
    measure, method = measure_of(table), best_method(table)
    if method is None:
        return []
    rows = table[table["method"] == method]
    return [_factor_sentence(rows, measure, factor, method) for factor in factors_of(rows)]


def best_method(table: pd.DataFrame) -> str | None:
    """The method with the largest share of the study's measure, of those that make maps of traces if there are any."""
    measure = measure_of(table)
    done = _finished(table)
    done = done[done[measure].notna()]
    crowd = done[~done["method"].map(is_baseline).astype(bool)]
    shares = summarise(crowd if len(crowd) else done, measure, by=["method"]) if len(done) else pd.DataFrame()
    return None if shares.empty else str(shares.sort_values("mean", kind="stable")["method"].iloc[-1])


def _finished(table: pd.DataFrame) -> pd.DataFrame:
    return table[table["status"] == "DONE"]


def _share(rows: pd.DataFrame, measure: str) -> str:
    """Share of the cases, with its interval over seeds."""
    counted, share = whole_seeds(rows, measure, by=[]).iloc[0], summarise(rows, measure, by=[]).iloc[0]
    return (
        f"{100 * share['mean']:.0f} % of the cases gave {WORDS[measure]} ({counted['n_true']:.0f} of {counted['n']:.0f}; 95 % "
        f"interval {100 * share['low']:.0f} to {100 * share['high']:.0f} %, n = {count_of(counted['n_seeds'], 'seed')})"
    )


def _support(rows: pd.DataFrame, measure: str) -> str:
    """What the seeds show at a stated confidence, and how many would show the share that is required."""
    counted = whole_seeds(rows, measure, by=[]).iloc[0]
    n_seeds, whole = int(counted["n_seeds"]), int(counted["n_whole"])
    needed = seeds_to_show(REQUIRED_SAFE_SHARE)
    told = f"In {whole} of {count_of(n_seeds, 'seed')} all of these cases did"
    if whole:
        told += f": that supports “in at least {int(100 * counted['at_least'])} % of seeds” (95 %, one-sided)"
    more = f"; to show {100 * REQUIRED_SAFE_SHARE:.0f} % takes {needed} seeds without a failure"
    return f"{told}{'' if whole >= needed else more}."


def _traces(table: pd.DataFrame, method: str) -> str:
    """How many traces a method needs, where the study varies them and the method takes any."""
    if TRACES_FACTOR not in factors_of(table) or is_baseline(method):
        return ""
    (row,) = traces_needed(table[table["method"] == method], by=["method"]).to_dict("records")
    required = f"{100 * REQUIRED_SAFE_SHARE:.0f} % of the cases of this study"
    if pd.isna(row["traces"]):
        best = f"{row['best_traces']:.0f} {_traces_word(row['best_traces'])} ({100 * row['best_share']:.0f} %)"
        return f" No number of traces, with every larger one, gave a safe plan in {required}; the best was {best}."
    when = "" if pd.isna(row["minutes"]) else f", collected after {row['minutes']:.1f} min on average"
    return f" {row['traces']:.0f} {_traces_word(row['traces'])} or more gave a safe plan in {required}{when}."


def _traces_word(number: float) -> str:
    return "trace" if number == 1 else "traces"


def _enough_traces(table: pd.DataFrame, method: str) -> float | None:
    if TRACES_FACTOR not in factors_of(table) or is_baseline(method):
        return None
    (row,) = traces_needed(table[table["method"] == method], by=["method"]).to_dict("records")
    return float(row["best_traces"] if pd.isna(row["traces"]) else row["traces"])


def _factor_sentence(rows: pd.DataFrame, measure: str, factor: str, method: str) -> str:
    shares = summarise(rows, measure, by=[factor]).dropna(subset=["mean"])
    if len(shares) < 2:
        return f"{_plain_name(factor)}: of its values only one has finished cases."
    if not pd.api.types.is_numeric_dtype(rows[factor]):
        shares = shares.sort_values("mean")
    first, last = shares.iloc[0], shares.iloc[-1]
    levels = f"{_level(factor, first[factor])} to {_level(factor, last[factor])}"
    told = f"{_plain_name(factor)}, {levels}: {WORDS[measure]} {100 * first['mean']:.0f} % to {100 * last['mean']:.0f} %"
    paired = compare(rows, measure, between=factor, against=first[factor])
    paired = paired[paired[factor] == last[factor]]
    interval = "no pairs of cases"
    if len(paired):
        pair: Any = paired.iloc[0]
        same = pair["low"] == pair["high"]  # nothing to resample: the seeds say no more than that they agree
        ends = f", 95 % interval {100 * pair['low']:+.0f} to {100 * pair['high']:+.0f}"
        ends = "" if pd.isna(pair["low"]) else ", the same in every seed" if same else ends
        difference = f"difference in the same traffic {100 * pair['difference']:+.0f} points"
        interval = f"{difference}{ends}, n = {count_of(pair['n'], 'seed')}"
    return f"{told} ({interval}), “{method}”{_pooled(rows, without=[factor])}."


def _pooled(rows: pd.DataFrame, *, without: list[str]) -> str:
    """Over which other factors a figure is a mean, with their values; empty where there is no other."""
    pooled = [
        f"{_plain_name(factor)} ({', '.join(_level(factor, value) for value in sorted(rows[factor].unique()))})"
        for factor in factors_of(rows)
        if factor not in without and rows[factor].nunique() > 1
    ]
    return f", pooled over {' and '.join(pooled)}" if pooled else ""


def _plain_name(factor: str) -> str:
    """The name of a factor without its unit, which its values carry."""
    return name_of(factor).partition(" [")[0]


def _level(factor: str, value: Any) -> str:
    unit = name_of(factor).partition(" [")[2].removesuffix("]")
    return f"{level_text(value)} {unit}".rstrip()
