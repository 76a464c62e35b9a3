"""Results of several files are in their place all or none, wherever a kill cuts the moving of them."""

import os
import threading
from pathlib import Path

import numpy as np
import pytest

from wzsumo.errors import OutputError
from wzsumo.files import placing
from wzsumo.files.output import staged_folder, write_whole
from wzsumo.files.placing import FINISHED, keeping, settle
from wzsumo.files.ros_map import read_map, write_map
from wzsumo.files.work_folder import only_writer, work_folder
from wzsumo.grid import OccupancyGrid

NAMES = ("a.txt", "maps/b.txt", "maps/c.txt", "z.txt")


def write_result(out: Path, text: str) -> None:
    with staged_folder(out) as stage:
        (stage / "maps").mkdir()
        for name in NAMES:
            (stage / name).write_text(text)


def killed_at_move(number: int, out: Path) -> None:
    """Write another result in a process that ends at once before it moves the file of that number to its place."""
    child = os.fork()
    if child == 0:
        moves = iter(range(99))
        replace = Path.replace

        def die_in_between(self: Path, target: Path) -> Path:
            if next(moves) == number:
                os._exit(9)
            return replace(self, target)

        Path.replace = die_in_between  # type: ignore[method-assign,assignment]
        write_result(out, "new")
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == (9 if number < len(NAMES) else 0)


@pytest.mark.parametrize("number", range(len(NAMES) + 1))
@pytest.mark.parametrize("then", ["read", "write"])
def test_result_whose_command_was_killed_between_two_files_is_put_in_place_by_the_next(
    tmp_path: Path, number: int, then: str
) -> None:
    write_result(tmp_path, "old")
    killed_at_move(number, tmp_path)
    assert [(tmp_path / name).read_text() for name in NAMES].count("new") == number
    if then == "read":
        settle(tmp_path)
    else:
        write_whole(tmp_path / "other.txt", b"")
    assert {(tmp_path / name).read_text() for name in NAMES} == {"new"}
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_reader_of_a_map_sees_its_image_and_its_metadata_of_one_result(tmp_path: Path) -> None:
    write_map(OccupancyGrid(p_occupied=np.zeros((2, 3), dtype=np.float32), resolution=1.0, origin=(0, 0)), tmp_path)
    finished = tmp_path / f"{FINISHED}{1:016x}"
    finished.mkdir()
    write_map(OccupancyGrid(p_occupied=np.ones((4, 5), dtype=np.float32), resolution=2.0, origin=(0, 0)), finished)
    (finished / "map.pgm").replace(tmp_path / "map.pgm")  # and here it was killed
    grid = read_map(tmp_path / "map.yaml")
    assert (grid.shape, grid.resolution) == ((4, 5), 2.0)


def test_rest_that_cannot_be_moved_is_told_and_folders_of_other_names_stay(tmp_path: Path) -> None:
    (tmp_path / f"{FINISHED}{2:016x}").mkdir()
    (tmp_path / f"{FINISHED}{2:016x}" / "a.txt").write_text("new")
    (tmp_path / "a.txt").mkdir()
    (tmp_path / f"{FINISHED}thesis").mkdir()
    with pytest.raises(OutputError, match=r"a\.txt: is a folder where a file goes"):
        settle(tmp_path)
    (tmp_path / "a.txt").rmdir()
    settle(tmp_path)
    assert (tmp_path / "a.txt").read_text() == "new"
    assert (tmp_path / f"{FINISHED}thesis").is_dir()


def test_what_a_command_reads_is_not_written_over_unless_it_stays_the_same(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("mine")
    (tmp_path / "link.txt").symlink_to("a.txt")
    with keeping([tmp_path / "link.txt", tmp_path / "missing"]):
        with pytest.raises(OutputError, match=r"a\.txt: is an input of this command"):
            write_result(tmp_path, "new")
        with pytest.raises(OutputError, match="is an input"):
            write_whole(tmp_path / "a.txt", b"new")
        assert sorted(path.name for path in tmp_path.iterdir()) == ["a.txt", "link.txt"]
        write_result(tmp_path, "mine")
    write_whole(tmp_path / "a.txt", b"new")
    assert (tmp_path / "a.txt").read_text() == "new"


def test_results_of_two_commands_that_end_at_once_do_not_mix(tmp_path: Path) -> None:
    between, go_on = os.pipe(), os.pipe()
    child = os.fork()
    if child == 0:
        replace = Path.replace

        def wait_in_between(self: Path, target: Path) -> Path:
            if self.name == "c.txt":
                os.write(between[1], b"x")
                os.read(go_on[0], 1)
            return replace(self, target)

        Path.replace = wait_in_between  # type: ignore[method-assign,assignment]
        write_result(tmp_path, "one")
        os._exit(0)
    os.read(between[0], 1)
    other = threading.Thread(target=write_result, args=(tmp_path, "two"))
    other.start()
    other.join(timeout=0.2)
    os.write(go_on[1], b"x")
    other.join()
    os.waitpid(child, 0)
    assert {(tmp_path / name).read_text() for name in NAMES} == {"two"}


def test_command_places_results_in_its_own_work_folder(tmp_path: Path) -> None:
    with work_folder(tmp_path) as folder:
        write_result(folder, "own")
        assert (folder / "z.txt").read_text() == "own"


def test_only_the_command_that_keeps_the_folder_moves_files_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wzsumo.files.placing._PATIENCE_S", 0.0)
    with only_writer(tmp_path):
        write_result(tmp_path, "own")
        child = os.fork()
        if child == 0:
            placing._held.clear()  # as in a process of another command
            try:
                write_result(tmp_path, "other")
            except OutputError as refused:
                os._exit(7 if "another command is writing there" in str(refused) else 8)
            os._exit(0)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
    assert {(tmp_path / name).read_text() for name in NAMES} == {"own"}
