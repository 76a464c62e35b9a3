import json
import subprocess
from pathlib import Path

import code_parts
import csv_figures
import markers
import pytest
import records
from hypothesis import given
from hypothesis import strategies as st


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project of one module, one result and its record, under version control."""
    results = tmp_path / "docs" / "results"
    results.mkdir(parents=True)
    (tmp_path / "drive.py").write_text("def gain() -> float:\n    return 1.5\n")
    (results / "drives.json").write_text(json.dumps({"lanes": [{"iou": 0.9041}]}))
    (results / "drives.csv").write_text("method,seed,iou,clean\nlanes,1,0.5,True\nlanes,2,0.75,False\nswept,1,0.25,True\n")
    (results / "drives.toml").write_text(
        '[fresh]\nseeds = "1, n = 1"\ndata = ["drives.json"]\ncode = ["drive.py"]\n\n'
        '[again]\nseeds = "2"\ndata = []\ncode = ["drive.py"]\n'
    )
    for words in (("init", "-q"), ("add", "."), ("-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "first")):
        subprocess.run(["git", *words], cwd=tmp_path, check=True)
    for module in (code_parts, markers, records):
        monkeypatch.setattr(module, "ROOT", tmp_path)
    for module in (markers, records):
        monkeypatch.setattr(module, "RESULTS", results)
    records._now.cache_clear()
    return tmp_path


def read(project: Path) -> dict[str, records.Record]:
    records._now.cache_clear()
    return records.read_records(project / "docs" / "results")


def test_marker_holds_the_figure_of_its_json_file(project: Path) -> None:
    text = "IoU <!-- from drives.json: lanes.0.iou .2f -->0.5<!-- end -->, here."
    assert markers.filled(text, {}) == "IoU <!-- from drives.json: lanes.0.iou .2f -->0.90<!-- end -->, here."


def test_marker_holds_what_a_function_of_a_script_returns_for_its_words(project: Path) -> None:
    (project / "tables.py").write_text('def rows(n):\n    return "| a |\\n|---|\\n" + f"| {n} |\\n"\n')
    filled = markers.filled("<!-- from ./tables.py: rows 3 -->\nold\n<!-- end -->\n", {})
    assert filled == "<!-- from ./tables.py: rows 3 -->\n| a |\n|---|\n| 3 |\n<!-- end -->\n"


@pytest.mark.parametrize(
    ("asked", "figure"),
    [
        ("n - d method=lanes", "2"),
        ("min iou .2f", "0.25"),
        ("max iou .2f method=lanes seed=2..9", "0.75"),
        ("mean iou .3f method=lanes", "0.625"),
        ("share clean .0% method=lanes", "50 %"),
        ("value iou .2f method=swept", "0.25"),
        ("sum seed .0f method=lanes|swept", "4"),
    ],
)
def test_figure_of_a_csv_file_is_the_one_that_is_asked_for(project: Path, asked: str, figure: str) -> None:
    assert csv_figures.csv_figure(project / "docs" / "results" / "drives.csv", asked) == figure


@pytest.mark.parametrize(
    "text",
    [
        "<!-- from drives.json: lanes.0.recall .2f -->x<!-- end -->",
        "<!-- from drives.json: lanes.1.iou .2f -->x<!-- end -->",
        "<!-- from absent.json: lanes .2f -->x<!-- end -->",
        "<!-- from drives.csv: value iou .2f method=lanes -->x<!-- end -->",
        "<!-- from drives.csv: middle iou .2f -->x<!-- end -->",
        "<!-- age drives.none --><!-- end -->",
        "<!-- measured drives.fresh -->\nno end",
        "<!-- age drives.fresh --> <!-- age drives.fresh --><!-- end -->",
    ],
)
def test_marker_that_names_nothing_or_has_no_end_is_refused_by_name(project: Path, text: str) -> None:
    with pytest.raises(ValueError, match=r"drives|absent"):
        markers.filled(text, read(project))


def test_result_is_marked_from_the_change_of_its_code_until_it_is_measured_again(project: Path) -> None:
    text = "IoU. <!-- age drives.fresh drives.again --><!-- end -->"
    records.stamp(["drives"], folder=project / "docs" / "results")
    assert markers.filled(text, read(project)) == text
    (project / "drive.py").write_text('"""Said."""\n\n# why\ndef gain() -> float:\n    """The gain."""\n    return 1.5\n')
    assert markers.filled(text, read(project)) == text
    (project / "drive.py").write_text("def gain() -> float:\n    return 1.6\n")
    old = markers.filled(text, read(project))
    assert old == "IoU. <!-- age drives.fresh drives.again -->**Older than the code.**<!-- end -->"
    assert "| code | **Older than the code**: drive.py |" in markers.filled(
        "<!-- measured drives.fresh --><!-- end -->", read(project)
    )
    records.stamp(["drives.fresh"], folder=project / "docs" / "results")
    assert [record.changed for record in read(project).values()] == [(), ("drive.py",)]
    assert markers.filled(old, read(project)) == old
    records.stamp(["drives.fresh"], commit="HEAD", folder=project / "docs" / "results")
    assert read(project)["drives.fresh"].changed == ("drive.py",)


def test_fingerprint_of_a_commit_is_that_of_the_folder_that_was_committed(project: Path) -> None:
    now = code_parts.fingerprint("drive.py")
    (project / "drive.py").write_text("gain = 2\n")
    assert code_parts.fingerprint("drive.py", commit="HEAD") == now != code_parts.fingerprint("drive.py")


@given(st.floats(0.1, 9.9), st.floats(0.1, 9.9))
def test_a_number_in_the_code_is_part_of_its_meaning(first: float, second: float) -> None:
    meanings = [code_parts._meaning("a.py", f"def f(x):\n    return {number} * x\n") for number in (first, second)]
    assert (meanings[0] == meanings[1]) == (first == second)


def test_record_with_an_unknown_key_or_an_absent_file_is_refused_by_name(project: Path) -> None:
    path = project / "docs" / "results" / "drives.toml"
    good = path.read_text()
    for bad in (good.replace("seeds", "seed", 1), good.replace("drives.json", "gone.csv")):
        path.write_text(bad)
        with pytest.raises(ValueError, match=r"drives\.fresh"):
            records.read_records(path.parent)
    path.write_text(good)
    with pytest.raises(ValueError, match="other"):
        records.stamp(["other"], folder=path.parent)
