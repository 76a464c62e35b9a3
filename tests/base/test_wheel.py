"""The wheel: what a user without a checkout gets."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CLEAN = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the content of a wheel that was built from a copy of the sources."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    source.mkdir()
    for name in ("wzsumo", "scenarios"):
        shutil.copytree(ROOT / name, source / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source / name)
    build = "import setuptools.build_meta as backend; print(backend.build_wheel('..'))"
    subprocess.run([sys.executable, "-c", build], cwd=source, env=CLEAN, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    shutil.rmtree(source)
    with zipfile.ZipFile(wheel) as file:
        file.extractall(folder / "site")
    return folder / "site"


def installed(site: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """A command of the package in `site`, run in a folder outside the checkout."""
    command = [sys.executable, "-m", "wzsumo", *words]
    return subprocess.run(
        command, cwd=folder, env=CLEAN | {"PYTHONPATH": str(site)}, capture_output=True, text=True, check=False
    )


def test_wheel_holds_every_file_of_the_library(site: Path) -> None:
    here, there = ROOT / "scenarios", site / "wzsumo" / "library"
    files = {path.relative_to(here) for path in here.rglob("*") if path.is_file()}
    assert {path.relative_to(there) for path in there.rglob("*") if path.is_file()} == files
    assert all((there / path).read_bytes() == (here / path).read_bytes() for path in files)


def test_installed_package_writes_a_scenario_to_start_from_and_lays_it_out(site: Path, tmp_path: Path) -> None:
    where = installed(site, tmp_path, "--version")
    assert where.returncode == 0, where.stderr
    done = installed(site, tmp_path, "init", "right_lane", "--out", "mine.toml")
    assert done.returncode == 0, done.stderr
    for words in (("layout", "mine.toml", "--out", "own"), ("layout", "lane_shift", "--out", "named")):
        done = installed(site, tmp_path, *words)
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "own" / "layout.png").is_file()
    assert (tmp_path / "named" / "layout.png").is_file()
