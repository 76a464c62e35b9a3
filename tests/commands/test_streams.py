"""What commands do where standard streams are closed or full, and with paths that libraries take for others."""

import subprocess
import sys
from pathlib import Path

import pytest

from wzsumo.cli import main

PAPER = Path(__file__).parents[2] / "scenarios" / "paper.toml"


def in_shell(words: str, *, folder: Path) -> "subprocess.CompletedProcess[str]":
    command = f"{sys.executable} -m wzsumo {words}"
    return subprocess.run(["sh", "-c", command], cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("closed", [">&-", "<&-", "<&- >&- 2>&-"])
def test_streams_that_are_closed_do_not_disturb_a_command(tmp_path: Path, closed: str) -> None:
    """Else the first file that it opens would be standard output to the libraries that print."""
    done = in_shell(f"init paper --out a.toml {closed}", folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "a.toml").read_text().startswith("# The work zone of Chen")


@pytest.mark.parametrize("words", [f"capacity {PAPER}", "--completion bash", "schema", "init"])
def test_full_disk_under_standard_output_is_told_in_one_line(tmp_path: Path, words: str) -> None:
    done = in_shell(f"{words} > /dev/full", folder=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "standard output: cannot be written to (No space left on device)" in done.stderr


def test_full_disk_under_standard_errors_leaves_the_exit_code(tmp_path: Path) -> None:
    assert in_shell("capacity nothing.toml 2> /dev/full", folder=tmp_path).returncode == 2
    assert in_shell(f"capacity {PAPER} 2> /dev/full", folder=tmp_path).returncode == 0


def test_backend_of_matplotlib_that_is_not_there_does_not_matter(tmp_path: Path) -> None:
    assert in_shell(f"layout {PAPER} --out o", folder=tmp_path).returncode == 0
    command = f"MPLBACKEND=none {sys.executable} -m wzsumo layout {PAPER} --out p"
    assert subprocess.run(["sh", "-c", command], cwd=tmp_path, capture_output=True, check=False).returncode == 0
    assert sorted(path.name for path in (tmp_path / "p").iterdir()) == sorted(path.name for path in (tmp_path / "o").iterdir())


def test_folder_that_is_called_like_a_home_is_one_like_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """pandas takes the first ~ of a path for a home."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["layout", str(PAPER), "--out", "~/o"])
    assert (ended.value.code, capsys.readouterr().err) == (0, "")
    assert (tmp_path / "~" / "o" / "devices.csv").is_file()


def test_command_does_not_write_over_its_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "layout.geojson").write_bytes(PAPER.read_bytes())
    with pytest.raises(SystemExit) as ended:
        main(["layout", "layout.geojson", "--out", "."])
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith("wzsumo: layout.geojson: is an input of this command")
    assert [path.name for path in tmp_path.iterdir()] == ["layout.geojson"]
    assert (tmp_path / "layout.geojson").read_bytes() == PAPER.read_bytes()
