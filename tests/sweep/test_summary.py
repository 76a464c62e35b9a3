from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import bootstrap

from wzsumo.errors import InputError
from wzsumo.sweep.summary import (
    clean_drives,
    compare,
    largest_share,
    latex,
    markdown,
    seeds_to_show,
    summarise,
    traces_needed,
    whole_seeds,
    write_table,
)


def results(
    *,
    seeds: int = 8,
    methods: Sequence[str] = ("swept",),
    used: Sequence[int] = (1,),
    value: Callable[..., float] = lambda *_: 0.5,
) -> pd.DataFrame:
    """A table of finished cases whose IoU is `value`, a row a seed, method and number of traces."""
    rows = [
        (seed, method, n, value(seed, method, n)) for seed in range(seeds) for method in methods for n in used
    ]  # fmt: skip
    table = pd.DataFrame(rows, columns=["seed", "method", "crowd.used", "iou"]).assign(scenario="paper", status="DONE")
    table.attrs["factors"] = ["seed", "crowd.used"]
    return table


def test_mean_median_and_interval_are_those_of_scipy() -> None:
    sample = np.random.default_rng(3).beta(5, 2, 12)
    summary = summarise(results(seeds=12, value=lambda seed, *_: sample[seed]), "iou", by=["method"]).iloc[0]
    assert (summary["n"], summary["mean"], summary["median"]) == (
        12,
        pytest.approx(sample.mean()),
        pytest.approx(np.median(sample)),
    )
    theirs = bootstrap(
        (sample,), np.mean, method="percentile", n_resamples=100_000, rng=np.random.default_rng(1)
    ).confidence_interval
    width = theirs.high - theirs.low
    assert summary["low"] == pytest.approx(theirs.low, abs=0.05 * width)
    assert summary["high"] == pytest.approx(theirs.high, abs=0.05 * width)


def test_interval_over_seeds_that_are_not_all_there_is_that_of_those_there_are() -> None:
    table = results(seeds=8, value=lambda seed, *_: seed / 10)
    table.loc[table["seed"] > 5, "status"] = "REFUSED"
    whole = summarise(results(seeds=6, value=lambda seed, *_: seed / 10), "iou", by=["method"]).iloc[0]
    part = summarise(table, "iou", by=["method"]).iloc[0]
    assert (part["n"], part["mean"]) == (whole["n"], whole["mean"]) == (6, pytest.approx(0.25))
    assert part["low"] == pytest.approx(whole["low"], abs=0.02)


def test_fleet_whose_traffic_locked_is_not_averaged_and_its_case_counts_otherwise() -> None:
    flows = np.array([1500.0, 700.0, 1600.0])
    table = results(seeds=3).assign(fleet_throughput_vph=flows, fleet_locked_s=[np.nan, 900.0, np.nan])
    for measure, n, mean in (("fleet_throughput_vph", 2, 1550.0), ("iou", 3, 0.5), ("fleet_locked_s", 1, 900.0)):
        summary = summarise(table, measure, by=["method"]).iloc[0]
        assert (summary["n"], summary["mean"]) == (n, mean)


def test_rows_of_one_seed_count_as_one() -> None:
    """Ten equal rows a seed tell no more of the scatter over seeds than one."""
    once, often = (results(seeds=6, used=range(n), value=lambda seed, *_: seed / 10) for n in (1, 10))
    pd.testing.assert_frame_equal(summarise(often, "iou", by=["method"]), summarise(once, "iou", by=["method"]))


def test_interval_of_a_constant_is_a_point_and_that_of_one_seed_is_not_known() -> None:
    assert summarise(results(), "iou", by=[])[["mean", "low", "high"]].to_numpy().tolist() == [[0.5, 0.5, 0.5]]
    assert summarise(results(seeds=1), "iou", by=[])[["low", "high"]].isna().all(axis=None)


def test_paired_difference_leaves_out_the_chance_that_the_pairs_share() -> None:
    chance = np.random.default_rng(2).normal(0, 10, 8)
    table = results(
        methods=("swept", "lanes"),
        used=(1, 2),
        value=lambda seed, method, used: chance[seed] + 0.1 * used * (method == "lanes"),
    )
    found = compare(table, "iou", between="method", against="swept", by=["crowd.used"])
    assert found["method"].tolist() == ["lanes", "lanes"]
    assert found[["difference", "low", "high"]].to_numpy() == pytest.approx(np.array([[0.1] * 3, [0.2] * 3]), abs=1e-9)
    assert found[["n", "share_above"]].to_numpy().tolist() == [[8, 1], [8, 1]]


def test_pair_with_one_half_refused_is_no_pair() -> None:
    table = results(methods=("swept", "lanes"))
    table.loc[(table["seed"] == 3) & (table["method"] == "swept"), "status"] = "REFUSED"
    assert compare(table, "iou", between="method", against="swept")["n"].tolist() == [7]


def test_traces_needed_are_those_from_which_on_all_larger_numbers_suffice() -> None:
    safe = {1: 8, 2: 4, 5: 8, 10: 8}  # seeds with a safe plan, of 8: one trace was luck
    table = results(used=tuple(safe), value=lambda *_: 0.5)
    table["safe_plan"] = [seed < safe[n] for seed, n in zip(table["seed"], table["crowd.used"], strict=True)]
    table["minutes_to_collect"] = 2.0 * table["crowd.used"]
    assert traces_needed(table, by=["method"]).to_numpy().tolist() == [["swept", 5.0, 10.0, 8, 1, 1.0]]
    table["safe_plan"] = table["crowd.used"] < 10
    assert traces_needed(table, by=["method"])[["traces", "minutes"]].isna().all(axis=None)


@pytest.mark.parametrize(("measure", "by"), [("iuo", ["method"]), ("iou", ["speed"])])
def test_column_that_is_not_there_is_refused_with_those_that_are(measure: str, by: Sequence[str]) -> None:
    with pytest.raises(InputError, match=r"not in the table; it has .*iou"):
        summarise(results(), measure, by=by)


def test_comparison_with_a_level_that_is_not_there_is_refused_with_those_that_are() -> None:
    with pytest.raises(InputError, match=r"method='lanes'; there is \['swept'\]"):
        compare(results(), "iou", between="method", against="lanes")


def test_tables_for_papers_escape_what_their_language_reads(tmp_path: Path) -> None:
    frame = pd.DataFrame({"crowd.used_n": [5], "share|%": [0.123456]})
    assert markdown(frame).splitlines() == ["| crowd.used_n | share\\|% |", "| --- | --- |", "| 5 | 0.1235 |"]
    assert r"crowd.used\_n & share|\% \\" in latex(frame)
    assert r"5 & 0.1235 \\" in latex(frame)
    paths = write_table(frame, tmp_path, "t")
    assert sorted(path.suffix for path in paths) == [".csv", ".md", ".parquet", ".tex"]
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "t.parquet"), frame)


@pytest.mark.parametrize(("found", "n", "bound"), [(0, 320, 0.0093), (0, 10, 0.2589), (1, 10, 0.3942), (10, 10, 1.0)])
def test_largest_share_is_that_of_clopper_and_pearson(found: int, n: int, bound: float) -> None:
    # 0 of n: 1 - 0.05^(1/n); 1 of 10: their table, 95 % one-sided.
    assert largest_share(found, n) == pytest.approx(bound, abs=5e-5)


@pytest.mark.parametrize(
    ("found", "n", "low", "high"),
    [(4, 4, 0.398, 1.0), (0, 4, 0.0, 0.602), (9, 10, 0.555, 0.997), (5, 10, 0.187, 0.813)],  # tables of the exact binomial
)
def test_interval_of_a_share_is_that_of_clopper_and_pearson(found: int, n: int, low: float, high: float) -> None:
    table = pd.DataFrame({"seed": range(n), "safe_plan": [number < found for number in range(n)], "status": "DONE"})
    row = summarise(table, "safe_plan", by=[]).iloc[0]
    assert (row["low"], row["high"]) == pytest.approx((low, high), abs=0.001)


def test_seed_of_several_cases_is_whole_where_all_of_them_are_true() -> None:
    table = pd.DataFrame({"seed": [1, 1, 2, 2, 3, 3, 4, 4], "safe_plan": [True] * 7 + [False], "status": "DONE"})
    row = whole_seeds(table, "safe_plan", by=[]).iloc[0]
    assert row[["n", "n_true", "n_seeds", "n_whole"]].tolist() == [8, 7, 4, 3]
    # Clopper and Pearson's bound of 3 of 4 solves p^4 + 4 p^3 (1 - p) = 0.05.
    p = row["at_least"]
    assert p**4 + 4 * p**3 * (1 - p) == pytest.approx(0.05)
    assert whole_seeds(table.assign(safe_plan=True), "safe_plan", by=[]).iloc[0]["at_least"] == pytest.approx(0.4729, abs=1e-4)


def test_seeds_to_show_a_share_are_those_of_the_binomial() -> None:
    assert seeds_to_show(0.9) == 29  # 0.9^28 = 0.052, 0.9^29 = 0.047


def test_clean_drives_are_counted_by_method_and_bounded_by_drives_and_by_seeds() -> None:
    table = results(seeds=10, methods=("lanes", "swept"), used=(5, 10))
    table["outcome"], table["clean"] = "REACHED_GOAL", True
    table.loc[(table["method"] == "swept") & (table["seed"] == 3), "clean"] = False
    table.loc[(table["method"] == "swept") & (table["seed"] == 3) & (table["crowd.used"] == 5), "outcome"] = "COLLIDED"
    table = pd.concat([table, table.head(1).assign(clean=None), table.head(1).assign(clean=False, status="FAILED")])
    lanes, swept = clean_drives(table, by=["method"]).to_dict("records")
    assert (lanes["n"], lanes["n_clean"], lanes["share"]) == (20, 20, 1.0)
    assert (swept["n"], swept["n_reached"], swept["n_clean"]) == (20, 19, 18)
    assert lanes["low"] == pytest.approx(0.05 ** (1 / 20))
    assert lanes["unclean_seeds"] == pytest.approx(1 - 0.05 ** (1 / 10))
    assert swept["unclean_seeds"] == pytest.approx(0.3942, abs=5e-5)
