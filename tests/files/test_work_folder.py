import subprocess
import sys
from pathlib import Path

from signal_at_each_line import interrupted_at_each_line

from wzsumo.files.work_folder import PREFIX, remove_leftovers, work_folder

HOLD = """
import sys
from pathlib import Path
from wzsumo.files.work_folder import work_folder
with work_folder(Path(sys.argv[1])) as folder:
    (folder / "half").write_text("half")
    print(folder, flush=True)
    sys.stdin.read()
"""


def other_process_at_work(folder: Path) -> "tuple[subprocess.Popen[str], Path]":
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    return process, Path(process.stdout.readline().strip())


def test_folder_is_deleted_at_the_end(tmp_path: Path) -> None:
    with work_folder(tmp_path) as folder:
        (folder / "a").write_text("a")
        assert folder.parent == tmp_path
    assert not list(tmp_path.iterdir())


def test_folder_of_a_process_that_lives_stays_and_that_of_a_killed_one_goes(tmp_path: Path) -> None:
    process, theirs = other_process_at_work(tmp_path)
    with work_folder(tmp_path):
        assert (theirs / "half").exists()
    process.kill()
    process.communicate()
    assert (theirs / "half").exists()
    with work_folder(tmp_path) as ours:
        assert list(tmp_path.iterdir()) == [ours]


def test_nothing_of_other_people_is_deleted(tmp_path: Path) -> None:
    exact = f"{PREFIX}{'0' * 15}"
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked" / "precious").write_text("precious")
    (tmp_path / f"{exact}1").symlink_to(tmp_path / "linked")
    (tmp_path / f"{exact}2").write_text("a file of exactly such a name")
    for name in (".unfinished-thesis", f"{PREFIX}notes", f"{exact}12", f"x{exact}1", f"{PREFIX}{'A' * 16}"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "precious").write_text("precious")
    before = sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*"))
    remove_leftovers(tmp_path)
    assert sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*")) == before


def test_signal_at_any_line_leaves_no_folder(tmp_path: Path) -> None:
    def act() -> None:
        with work_folder(tmp_path) as folder:
            (folder / "begun").write_text("x")

    for line in interrupted_at_each_line(act, files=("files/work_folder.py", "wzsumo/errors.py")):
        assert list(tmp_path.iterdir()) == [], line
    assert line > 20
