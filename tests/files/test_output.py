from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from wzsumo.errors import OutputError
from wzsumo.files.output import parquet_bytes, staged_folder, write_whole


class StoppedError(Exception):
    pass


def test_staged_files_replace_those_of_the_same_name_and_leave_the_others(tmp_path: Path) -> None:
    (tmp_path / "kept.txt").write_text("kept")
    (tmp_path / "map.txt").write_text("old")
    with staged_folder(tmp_path) as stage:
        (stage / "figures").mkdir()
        (stage / "figures" / "a.txt").write_text("figure")
        (stage / "map.txt").write_text("new")
        assert (tmp_path / "map.txt").read_text() == "old"
    assert {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*")} == {
        "kept.txt", "map.txt", "figures", "figures/a.txt",
    }  # fmt: skip
    assert (tmp_path / "map.txt").read_text() == "new"


@pytest.mark.parametrize("existed", [False, True])
def test_block_that_fails_leaves_the_folder_as_it_was(tmp_path: Path, existed: bool) -> None:
    out = tmp_path / "out"
    if existed:
        out.mkdir()

    def fail() -> None:
        with staged_folder(out) as stage:
            (stage / "map.txt").write_text("half")
            raise StoppedError

    with pytest.raises(StoppedError):
        fail()
    assert out.exists() == existed
    assert not existed or not any(out.iterdir())


def test_folder_that_cannot_be_written_to_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("a file, no folder")
    with pytest.raises(OutputError, match="name a folder that you may write to"), staged_folder(tmp_path / "file"):
        pass


def test_written_file_is_whole_and_nothing_else_is_left(tmp_path: Path) -> None:
    write_whole(tmp_path / "new" / "a.bin", b"first")
    write_whole(tmp_path / "new" / "a.bin", b"second")
    assert [(path.name, path.read_bytes()) for path in (tmp_path / "new").iterdir()] == [("a.bin", b"second")]


def test_file_that_cannot_be_written_stays_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "a.bin").mkdir()
    with pytest.raises(OutputError, match="cannot be written"):
        write_whole(tmp_path / "a.bin", b"content")
    assert [path.name for path in tmp_path.iterdir()] == ["a.bin"]


def test_parquet_file_has_a_checksum_on_its_pages(tmp_path: Path) -> None:
    content = parquet_bytes(pa.table({"a": list(range(5000))}))
    (tmp_path / "good.parquet").write_bytes(content)
    assert pq.read_table(tmp_path / "good.parquet", page_checksum_verification=True).num_rows == 5000
    broken = bytearray(content)
    broken[200] ^= 0xFF
    (tmp_path / "broken.parquet").write_bytes(bytes(broken))
    with pytest.raises(OSError, match="CRC checksum"):
        pq.read_table(tmp_path / "broken.parquet", page_checksum_verification=True)
