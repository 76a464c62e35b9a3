"""Statistics of a result table: means with intervals over seeds, paired differences, traces needed; and tables of them."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from scipy.stats import beta

from wzsumo.case.methods import is_baseline
from wzsumo.errors import InputError
from wzsumo.frames import FloatArray
from wzsumo.sweep.results import CASE_COLUMNS, MEASURED_COLUMNS, column_of

CONFIDENCE = 0.95
RESAMPLES = 2000  # with so many, the ends of an interval differ by about 3 % of its width from one resampling seed to another
_OF_FLEET, _LOCKED = "fleet_", "fleet_locked_s"  # figures of a fleet whose traffic locked are not averaged
_RESAMPLING_SEED = 1  # fixed, so that the same table always gives the same interval


def summarise(table: pd.DataFrame, measure: str, *, by: Sequence[str]) -> pd.DataFrame:
    """Columns `by`, n, mean, median, low, high of a measured column, one row per combination of the columns `by`.

    n counts seeds: rows of one seed in one combination are averaged first, because they share a simulation. `low` and `high`
    are the ends of a 95 % interval of the mean over seeds: of the percentile bootstrap, and for a share of what is true or
    false that of `share_interval`, since seeds that agree leave the bootstrap nothing to resample. Refused and failed cases are
    left out, and from figures of the fleet cases whose traffic locked. Source: Efron & Tibshirani 1993, An Introduction to the
    Bootstrap, section 13.3.
    """
    done = _done(table, [measure, *by])
    values = _by_seed(done, pd.to_numeric(done[measure].astype(float)), by)
    if column_of(measure).type == pa.bool_():
        low, high = share_interval(values.mean(axis=1).to_numpy(), values.notna().sum(axis=1).to_numpy())
    else:
        low, high = _bootstrap_interval(values.to_numpy())
    summary = pd.DataFrame(
        {
            "n": values.notna().sum(axis=1),
            "mean": values.mean(axis=1),
            "median": values.median(axis=1),
            "low": low,
            "high": high,
        },
        index=values.index,
    )
    return summary.reset_index() if by else summary.reset_index(drop=True)


def compare(table: pd.DataFrame, measure: str, *, between: str, against: object, by: Sequence[str] = ()) -> pd.DataFrame:
    """Paired differences of a measure from its value where the column `between` is `against`.

    The two cases of a pair agree in everything else, the seed included, so that they share the same traffic. Columns:
    `between`, `by`, n (seeds), difference (mean), low and high (its 95 % interval), share_above (share of the pairs in which
    the value is larger than that of `against`).
    """
    done = _done(table, [measure, between, *by])
    factors = [name for name in table.attrs.get("factors", []) if name != between]
    paired_by = list(dict.fromkeys(["scenario", "method", "seed", *factors]))
    paired_by = [name for name in paired_by if name != between and name in done]
    done = done.assign(**{measure: done[measure].astype(float)})
    baseline = done[done[between] == against].set_index(paired_by)[measure]
    if baseline.empty:
        raise InputError(f"no finished case has {between}={against!r}; there is {sorted(map(str, done[between].unique()))}")
    others = done[done[between] != against].join(baseline.rename("_baseline"), on=paired_by, how="inner")
    difference = others[measure] - others["_baseline"]
    values = _by_seed(others, difference, [between, *by])
    low, high = _bootstrap_interval(values.to_numpy())
    above = _by_seed(others, (difference > 0).where(difference.notna()).astype(float), [between, *by])
    columns = {"n": values.notna().sum(axis=1), "difference": values.mean(axis=1), "low": low, "high": high}
    return pd.DataFrame(columns | {"share_above": above.mean(axis=1)}, index=values.index).reset_index()


def clean_drives(table: pd.DataFrame, *, by: Sequence[str]) -> pd.DataFrame:
    """Columns `by`, n_seeds, n, n_reached, n_clean, share, low, unclean_seeds of the drives, one row per combination of `by`.

    `share` is that of the clean drives. `low` is the one-sided 95 % bound below it if every drive were independent, and
    `unclean_seeds` the same kind of bound above the share of seeds with a drive that is not clean: drives of one seed share
    their traffic. Source: Clopper & Pearson 1934.
    """
    driven = _done(table, ["clean", "outcome", *by])
    driven = driven[driven["clean"].notna()]
    groups = driven.groupby(list(by), sort=True) if by else [((), driven)]
    rows = []
    for key, group in groups:
        clean = group["clean"].astype(bool)
        bad_seeds = int((~clean.groupby(group["seed"]).all()).sum())
        n, n_seeds, n_clean = len(group), group["seed"].nunique(), int(clean.sum())
        n_reached = int((group["outcome"] == "REACHED_GOAL").sum())
        counts = {"n_seeds": n_seeds, "n": n, "n_reached": n_reached, "n_clean": n_clean}
        bounds = {"low": 1 - largest_share(n - n_clean, n), "unclean_seeds": largest_share(bad_seeds, n_seeds)}
        rows.append(dict(zip(by, key, strict=True)) | counts | {"share": n_clean / n} | bounds)
    return pd.DataFrame(rows)


def share_interval(shares: FloatArray, n_seeds: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lower and upper ends (k,) of the 95 % intervals of shares (k,) that are means over numbers of seeds (k,).

    The interval of Clopper and Pearson for as many independent draws as there are seeds: cases of one seed share their traffic
    and count as one draw, at the safe side. Source: Korn & Graubard 1998, Survey Methodology 24, section 2.

    >>> share_interval(np.array([1.0]), np.array([4.0]))[0].round(2)  # 4 of 4: the share may be as low as 0.4
    array([0.4])
    """
    found, tail = shares * n_seeds, (1 - CONFIDENCE) / 2
    low = np.where(found > 0, beta.ppf(tail, np.maximum(found, 1e-9), n_seeds - found + 1), 0.0)
    high = np.where(found < n_seeds, beta.ppf(1 - tail, found + 1, np.maximum(n_seeds - found, 1e-9)), 1.0)
    return np.where(n_seeds > 0, low, np.nan), np.where(n_seeds > 0, high, np.nan)


def whole_seeds(table: pd.DataFrame, measure: str, *, by: Sequence[str]) -> pd.DataFrame:
    """Columns `by`, n, n_true, n_seeds, n_whole, at_least of a measure that is true or false, one row per combination of `by`.

    A seed is whole where the measure is true in all of its cases. `at_least` is the one-sided 95 % bound below the share of
    whole seeds: what the data support, 47 % where 4 of 4 are. Source: Clopper & Pearson 1934.
    """
    done = _done(table, [measure, *by])
    done = done[done[measure].notna()]
    rows = []
    for key, group in done.groupby(list(by), sort=True) if by else [((), done)]:
        true = group[measure].astype(bool)
        whole, n_seeds = int(true.groupby(group["seed"]).all().sum()), group["seed"].nunique()
        counts = {"n": len(group), "n_true": int(true.sum()), "n_seeds": n_seeds, "n_whole": whole}
        rows.append(dict(zip(by, key, strict=True)) | counts | {"at_least": 1 - largest_share(n_seeds - whole, n_seeds)})
    return pd.DataFrame(rows, columns=[*by, "n", "n_true", "n_seeds", "n_whole", "at_least"])


def seeds_to_show(share: float) -> int:
    """The fewest seeds, all of them whole, that show with 95 % confidence that at least this share of seeds is whole.

    >>> seeds_to_show(0.9)
    29
    """
    return math.ceil(math.log(1 - CONFIDENCE) / math.log(share))


def largest_share(found: int, n: int) -> float:
    """The one-sided 95 % upper bound of a share of which `found` of `n` independent draws are; Clopper & Pearson 1934.

    >>> round(largest_share(0, 59), 3)  # the rule of three: some 3 / n
    0.05
    """
    return 1.0 if found >= n else float(beta.ppf(CONFIDENCE, found + 1, n - found))


def write_table(frame: pd.DataFrame, folder: Path, name: str) -> list[Path]:
    """The paths of NAME.csv, .parquet, .md and .tex, written to `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    texts = {".csv": frame.to_csv(index=False), ".md": markdown(frame), ".tex": latex(frame)}
    for suffix, text in texts.items():
        (folder / f"{name}{suffix}").write_text(text, encoding="utf-8")
    (folder / f"{name}.parquet").write_bytes(frame.to_parquet(index=False))
    return [folder / f"{name}{suffix}" for suffix in (*texts, ".parquet")]


def markdown(frame: pd.DataFrame) -> str:
    """The table in Markdown, numbers to four significant digits."""
    rows = [list(map(str, frame.columns)), ["---"] * len(frame.columns), *_texts(frame)]
    return "".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |\n" for row in rows)


def latex(frame: pd.DataFrame) -> str:
    """The table in LaTeX (booktabs), numbers to four significant digits."""
    head, *body = [" & ".join(map(_escaped, row)) + r" \\" for row in [list(map(str, frame.columns)), *_texts(frame)]]
    columns = "".join("r" if pd.api.types.is_numeric_dtype(kind) else "l" for kind in frame.dtypes)
    lines = [rf"\begin{{tabular}}{{{columns}}}", r"\toprule", head, r"\midrule", *body, r"\bottomrule", r"\end{tabular}"]
    return "\n".join(lines) + "\n"


def _done(table: pd.DataFrame, needed: Sequence[str]) -> pd.DataFrame:
    missing = [name for name in needed if name not in table.columns]
    if missing:
        known = [
            name for name in table.columns if name in CASE_COLUMNS | MEASURED_COLUMNS or name in table.attrs.get("factors", [])
        ]
        raise InputError(f"column(s) {', '.join(missing)} are not in the table; it has {', '.join(known)}")
    done = table[table["status"] == "DONE"]
    if needed[0].startswith(_OF_FLEET) and needed[0] != _LOCKED and _LOCKED in done:
        done = done[done[_LOCKED].isna()]
    return done


def _by_seed(rows: pd.DataFrame, values: pd.Series, by: Sequence[str]) -> pd.DataFrame:
    """Mean value of each combination (rows) and seed (columns)."""
    if rows.empty:
        raise InputError("no case is finished, so there is nothing to summarise")
    keys = [rows[name] for name in by] or [pd.Series("all", index=rows.index, name="cases")]
    return values.groupby([*keys, rows["seed"]], sort=True, dropna=False, observed=True).mean().unstack("seed")


def _bootstrap_interval(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lower and upper ends (groups,) of the interval of the mean of each row of values (groups, seeds).

    nan marks a seed that a group does not have. To draw seeds with replacement is to give each seed a weight, so one matrix
    product makes all resamples of all groups.
    """
    n_seeds = values.shape[1]
    draws = (
        np.random.default_rng(_RESAMPLING_SEED)
        .multinomial(n_seeds, np.full(n_seeds, 1 / n_seeds), size=RESAMPLES)
        .astype(float)
    )
    known = np.isfinite(values)
    with np.errstate(invalid="ignore"):
        means = (np.where(known, values, 0.0) @ draws.T) / (known @ draws.T)
    means[known.sum(axis=1) < 2] = np.nan  # the scatter over seeds needs at least two
    ends = np.full((2, len(values)), np.nan)
    has_interval = np.isfinite(means).any(axis=1)
    tails = ((1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2)
    ends[:, has_interval] = np.nanquantile(means[has_interval], tails, axis=1)
    return ends[0], ends[1]


def _texts(frame: pd.DataFrame) -> list[list[str]]:
    return [[f"{v:.4g}" if isinstance(v, float) else str(v) for v in row] for row in frame.itertuples(index=False)]


def _escaped(text: str) -> str:
    return "".join("\\" + letter if letter in "&%$#_{}" else letter for letter in text)


REQUIRED_SAFE_SHARE = 0.9  # a number of traces is enough where this share of seeds has a safe plan
TRACES_FACTOR = "crowd.used"


def traces_needed(table: pd.DataFrame, *, by: Sequence[str]) -> pd.DataFrame:
    """Columns `by`, traces, minutes, n_seeds, best_traces, best_share, one row per combination of the columns `by`.

    `traces` is the smallest number of traces that is enough, together with every larger number in the study: at each of them
    the share of seeds with a safe plan reaches REQUIRED_SAFE_SHARE. `minutes` is the mean time until so many traces are
    collected. Both are nan where no number is enough. `best_traces` is the number with the largest share, `best_share`.
    Methods that take no traces are left out.
    """
    table = table[~table["method"].map(is_baseline).astype(bool)]
    safe = summarise(table, "safe_plan", by=[*by, TRACES_FACTOR]).rename(columns={"mean": "share", "n": "n_seeds"})
    minutes = summarise(table, "minutes_to_collect", by=[*by, TRACES_FACTOR]).rename(columns={"mean": "minutes"})
    points = safe.merge(minutes[[*by, TRACES_FACTOR, "minutes"]], on=[*by, TRACES_FACTOR])
    groups = points.groupby(list(by), sort=True) if by else [((), points)]
    rows = []
    for key, group in groups:
        enough = _last_rows_enough(group.sort_values(TRACES_FACTOR))
        traces, minutes_then = enough.iloc[0][[TRACES_FACTOR, "minutes"]] if len(enough) else (math.nan, math.nan)
        best = group.iloc[int(group["share"].to_numpy().argmax())]
        found = {"traces": traces, "minutes": minutes_then, "n_seeds": group["n_seeds"].max()}
        found |= {"best_traces": best[TRACES_FACTOR], "best_share": best["share"]}
        rows.append(dict(zip(by, key, strict=True)) | found)
    return pd.DataFrame(rows).astype({"traces": float, "minutes": float})


def _last_rows_enough(group: pd.DataFrame) -> pd.DataFrame:
    """The rows at the end of the group that all reach REQUIRED_SAFE_SHARE."""
    enough = (group["share"] >= REQUIRED_SAFE_SHARE).to_numpy()[::-1].cumprod()[::-1].astype(bool)
    return group[enough]
