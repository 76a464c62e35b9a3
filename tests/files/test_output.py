import resource
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from wzsumo.cli import main
from wzsumo.errors import OutputError
from wzsumo.files.output import parquet_bytes, remove_stamps, staged_file, staged_folder, write_whole


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
    with pytest.raises(OutputError, match=r"a\.bin: is a folder where a file goes"):
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


def write(out: Path, content: dict[str, bytes], *, told: Sequence[str] = (), worked: list[bool] | None = None) -> None:
    """Write files, or folders and files below them, through a stage."""
    with staged_folder(out, files=told) as stage:
        if worked is not None:
            worked.append(True)
        for name, data in content.items():
            (stage / name).parent.mkdir(exist_ok=True)
            (stage / name).write_bytes(data)


@contextmanager
def files_limited_to(n_bytes: int) -> Iterator[None]:
    """A limit on the size of files is the full disk that a test can have: the system refuses the write."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_disk_that_fills_up_changes_nothing_and_is_named(tmp_path: Path) -> None:
    (tmp_path / "map.txt").write_text("old")
    with files_limited_to(1000), pytest.raises(OutputError, match="a file would be too large; what was there stays"):
        write(tmp_path, {"map.txt": b"new", "figure.png": b"0" * 2000})
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("map.txt", "old")]


@pytest.mark.parametrize("in_the_way", ["map.yaml", "maps"])
def test_folder_where_a_file_goes_or_file_where_a_folder_goes_is_refused_and_nothing_is_moved(
    tmp_path: Path, in_the_way: str
) -> None:
    """The name of one is told beforehand, that of the other is not."""
    (tmp_path / "a.txt").write_text("old")
    (tmp_path / "map.yaml").mkdir() if in_the_way == "map.yaml" else (tmp_path / "maps").write_text("a file")
    worked: list[bool] = []
    with pytest.raises(OutputError, match=f"{in_the_way}: is a f"):
        write(tmp_path, {"a.txt": b"new", "maps/swept.yaml": b"new"}, told=("map.yaml",), worked=worked)
    assert worked == ([] if in_the_way == "map.yaml" else [True])
    assert (tmp_path / "a.txt").read_text() == "old"
    assert {path.name for path in tmp_path.iterdir()} == {"a.txt", in_the_way}


def test_link_to_a_file_is_replaced_and_the_file_that_it_names_stays(tmp_path: Path) -> None:
    (tmp_path / "precious.txt").write_text("precious")
    out = tmp_path / "out"
    out.mkdir()
    (out / "map.txt").symlink_to(tmp_path / "precious.txt")
    with staged_folder(out) as stage:
        (stage / "map.txt").write_text("new")
    assert (tmp_path / "precious.txt").read_text() == "precious"
    assert not (out / "map.txt").is_symlink()
    assert (out / "map.txt").read_text() == "new"


def test_link_to_a_folder_is_not_written_through(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    out = tmp_path / "out"
    out.mkdir()
    (out / "maps").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OutputError, match="maps: is a link where a folder goes"):
        write(out, {"maps/swept.yaml": b"map"})
    assert not list((tmp_path / "elsewhere").iterdir())


def test_interrupt_while_files_are_moved_comes_after_the_last_of_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    replace = Path.replace

    def interrupted(self: Path, target: Path) -> Path:
        signal.raise_signal(signal.SIGINT)
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", interrupted)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    try:
        with pytest.raises(KeyboardInterrupt):
            write(tmp_path, {"a": b"a", "b": b"b", "c": b"c"})
    finally:
        signal.signal(signal.SIGINT, before)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b", "c"]


@pytest.mark.parametrize("name", ["", ".", "..", "/", "a" * 300, "a/" + "b" * 300, "nul\0byte", "file/below", "folder"])
def test_output_file_that_cannot_be_is_refused_before_the_work(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_text("a file")
    (tmp_path / "folder").mkdir()
    worked = []
    with pytest.raises(OutputError), staged_file(tmp_path / name if name not in {"", "."} else Path(name)) as staged:
        worked.append(staged)
    assert worked == []
    assert {path.name for path in tmp_path.iterdir()} == {"file", "folder"}


def test_folders_made_for_a_result_that_does_not_come_are_removed_again(tmp_path: Path) -> None:
    with pytest.raises(StoppedError), staged_folder(tmp_path / "a" / "b" / "c"):
        raise StoppedError
    assert not list(tmp_path.iterdir())


def test_only_the_stamp_of_sumos_files_is_removed(tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    path.write_text('<?xml version="1.0"?>\n<!-- generated on 2026 by SUMO\n<a/> -->\n\n<net><!-- kept --></net>\n')
    for _ in range(2):
        remove_stamps(tmp_path)
        assert path.read_text() == '<?xml version="1.0"?>\n<net><!-- kept --></net>\n'


def test_network_of_a_zone_is_the_same_bytes_wherever_it_is_written(tmp_path: Path) -> None:
    paper = Path(__file__).parents[2] / "scenarios" / "paper.toml"
    for name in ("a", "b"):
        with pytest.raises(SystemExit):
            main(["net", str(paper), "--out", str(tmp_path / name)])
    first, second = (
        {path.name: path.read_bytes() for path in (tmp_path / name).rglob("*") if path.is_file()} for name in ("a", "b")
    )
    assert first == second
    assert b"unfinished" not in first["zone.net.xml"]
