"""What a study answers: how many traces make a map that a safe path can be planned on, and how long they take to come in."""

import math
from collections.abc import Sequence

import pandas as pd

from wzsumo.study.baselines import BASELINE_METHODS
from wzsumo.study.summary import summarise

GOOD_ENOUGH = 0.9  # share of seeds with a safe plan from which on a map is called good enough
TRACES = "crowd.used"


def traces_needed(table: pd.DataFrame, *, by: Sequence[str]) -> pd.DataFrame:
    """Columns `by`, traces, minutes, n_seeds, best_traces, best_share, one row a combination of `by`.

    `traces` is the fewest from which on, with every larger number in the study as well, the share of seeds with a safe plan
    is GOOD_ENOUGH, `minutes` the mean time until so many have come in; nan where there is none. `best_traces` has the largest
    share of all. Methods that take no traces are left out.
    """
    table = table[~table["method"].isin(BASELINE_METHODS)]
    safe = summarise(table, "safe_plan", by=[*by, TRACES]).rename(columns={"mean": "share", "n": "n_seeds"})
    minutes = summarise(table, "minutes_to_collect", by=[*by, TRACES]).rename(columns={"mean": "minutes"})
    points = safe.merge(minutes[[*by, TRACES, "minutes"]], on=[*by, TRACES])
    groups = points.groupby(list(by), sort=True) if by else [((), points)]
    rows = []
    for key, group in groups:
        enough = _from_which_on(group.sort_values(TRACES))
        traces, minutes_then = enough.iloc[0][[TRACES, "minutes"]] if len(enough) else (math.nan, math.nan)
        best = group.iloc[int(group["share"].to_numpy().argmax())]
        found = {"traces": traces, "minutes": minutes_then, "n_seeds": group["n_seeds"].max()}
        found |= {"best_traces": best[TRACES], "best_share": best["share"]}
        rows.append(dict(zip(by, key, strict=True)) | found)
    return pd.DataFrame(rows).astype({"traces": float, "minutes": float})


def _from_which_on(group: pd.DataFrame) -> pd.DataFrame:
    """The rows at the end of the group that are good enough without a break."""
    enough = (group["share"] >= GOOD_ENOUGH).to_numpy()[::-1].cumprod()[::-1].astype(bool)
    return group[enough]
