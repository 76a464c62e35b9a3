import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from PIL import Image
from sweep_trials import FLEET, a_study, sweep

from wzsumo.errors import InputError
from wzsumo.report.sweep_report import write_sweep_report
from wzsumo.sweep import task_queue as engine
from wzsumo.sweep.evaluation.study_case import StudyCase
from wzsumo.sweep.results import read_results


def evaluate_cases(fleet: bytes, cases: Sequence[StudyCase]) -> list[dict[str, Any]]:
    """Maps that grow better with traces and worse with the GNSS error; four traces are refused."""
    rows = []
    for case in cases:
        used, error = case.scenario.crowd.used, case.scenario.gnss.error_m or 0.0
        row = {"case": case.id, "status": "DONE", "reason": "", "plan_status": "FOUND", "safe_plan": used >= 2 + error}
        row |= {"iou": min(used / 5 - 0.1 * error, 1) + 0.01 * case.scenario.seed, "precision": 0.9, "recall": 0.8}
        row |= {"planned_min_clearance_devices_m": 0.5, "minutes_to_collect": used / case.scenario.crowd.penetration / 25}
        if case.method == "hd_map":
            row |= {"safe_plan": used == 1, "minutes_to_collect": None}
        refused = {"case": case.id, "status": "REFUSED", "reason": "<script>alert(1)</script>"}
        rows.append(refused if used == 4 else row)
    return rows


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("study")
    study = a_study(
        methods=("swept", "lanes", "hd_map"),
        seed=[1, 2],
        crowd__used=[1, 2, 3, 4],
        gnss__error_m=[0.0, 1.0],
        crowd__penetration=[0.1, 0.2],
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "simulate", lambda _scenario: FLEET)
        patch.setattr(engine, "evaluate_cases", evaluate_cases)
        sweep(study, out)
    alone = out / "cases" / study.cases[0].id
    alone.mkdir(parents=True)
    (alone / "report.html").write_text("what `wzsumo run --case` would write")
    write_sweep_report(out)
    return out


@pytest.fixture(scope="module")
def page(folder: Path) -> str:
    return (folder / "report.html").read_text()


def test_headline_says_no_more_than_the_seeds_support(page: str) -> None:
    (answer,) = re.findall(r'<div class="answer">(.*?)</div>', page, flags=re.S)
    first, second = re.findall(r"<p>(.*?)</p>", answer)
    # With three traces every case is safe at both errors, in 2 of 2 seeds: 0.05 ** (1 / 2) = 22 %.
    assert re.match("With “(swept|lanes)” on maps of 3 traces, 100 % of the cases gave safe plans", first)
    assert "(8 of 8; 95 % interval 16 to 100 %, n = 2 seeds)" in first
    assert first.endswith("pooled over GNSS error (0 m, 1 m) and share of equipped vehicles (0.1, 0.2).")
    assert second == (
        "In 2 of 2 seeds all of these cases did: that supports “in at least 22 % of seeds” (95 %, one-sided); "
        "to show 90 % takes 29 seeds without a failure."
    )


def test_each_method_and_each_factor_has_a_sentence_that_names_what_it_pools(page: str) -> None:
    methods, factors = (re.findall(r"<li>(.*?)</li>", part) for part in re.findall(r"<ul>(.*?)</ul>", page, flags=re.S)[:2])
    assert [line.split(":")[0] for line in methods] == ["“swept”", "“lanes”", "“hd_map”"]
    assert all("pooled over traces used (1, 2, 3) and GNSS error" in line for line in methods)
    assert [line.split(",")[0] for line in factors] == ["traces used", "GNSS error", "share of equipped vehicles"]
    # An error of 1 m takes one of three numbers of traces from safe to not, in every seed.
    assert "GNSS error, 0 m to 1 m: safe plans 67 % to 33 %" in factors[1]
    assert "-33 points, the same in every seed, n = 2 seeds" in factors[1]


def test_tables_stand_as_files_beside_the_page(folder: Path, page: str) -> None:
    links = [link for link in re.findall(r'href="([^"]*)"', page) if not link.startswith("#")]
    assert {"results.parquet", "tables/methods.csv", "tables/summary.csv", "tables/paired.csv"} <= set(links)
    assert all((folder / link).is_file() for link in links)
    matrix = pd.read_csv(folder / "tables" / "methods.csv").set_index("method")
    assert list(matrix.columns) == ["traces used: 1", "traces used: 2", "traces used: 3"]
    assert matrix.loc["lanes", "traces used: 2"] == "50 % (4 of 8, 0 of 2 seeds)"


def test_page_stands_alone_and_escapes_what_a_case_says(page: str) -> None:
    images = re.findall(r"""<img[^>]*?\ssrc="([^"]{0,30})""", page)
    assert len(images) == 6
    assert all(source.startswith("data:image/png;base64,") for source in images)
    assert not re.search(r"https?://|url\(|@import", page)
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page


def test_page_lists_every_case_by_name_and_links_the_one_that_was_run_alone(folder: Path, page: str) -> None:
    first, *others = read_results(folder)["case"]
    assert len(others) == 95
    assert set(re.findall(r'class="case">(\w+)<', page)) == set(others)
    assert f'<a href="cases/{first}/report.html">{first}</a>' in page


def test_figures_are_what_the_factors_allow(folder: Path) -> None:
    assert sorted(path.stem for path in (folder / "figures").glob("*.png")) == [
        "methods", "minutes", "outcome", "quality", "quality_crowd_penetration", "quality_gnss_error_m",
    ]  # fmt: skip
    for path in (folder / "figures").glob("*.png"):
        with Image.open(path) as image:
            assert image.width == 1575  # 10.5 in at 150 dpi


def test_summary_table_gives_the_means_of_the_cases(folder: Path) -> None:
    summary = pd.read_csv(folder / "tables" / "summary.csv")
    cell = summary[(summary["measure"] == "iou") & (summary["method"] == "lanes") & (summary["crowd.used"] == 3)]
    expected = 3 / 5 - 0.1 * cell["gnss.error_m"] + 0.01 * 1.5  # seeds 1 and 2
    assert cell["mean"].to_numpy() == pytest.approx(expected.to_numpy())
    assert (cell["n"] == 2).all()
    assert {path.suffix for path in (folder / "tables").iterdir()} == {".csv", ".md", ".parquet", ".tex"}


def test_report_of_a_study_without_results_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"holds no study\.json"):
        write_sweep_report(tmp_path)


@pytest.mark.parametrize("status", ["REFUSED", "FAILED"])
def test_report_of_a_study_none_of_whose_cases_has_a_result_is_refused_with_the_reason(
    status: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none_has(_fleet: bytes, cases: Sequence[StudyCase]) -> list[dict[str, Any]]:
        if status == "FAILED":
            raise RuntimeError("of some reason")
        return [{"case": case.id, "status": status, "reason": "of some reason"} for case in cases]

    monkeypatch.setattr(engine, "simulate", lambda _scenario: FLEET)
    monkeypatch.setattr(engine, "evaluate_cases", none_has)
    sweep(a_study(seed=[1, 2]), tmp_path)
    with pytest.raises(InputError, match=r"none of its 2 cases has a result, the first because: .*of some reason; run the"):
        write_sweep_report(tmp_path)
