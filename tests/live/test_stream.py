"""The stream and its folder: order, twice, kills, and input that does not belong together."""

import io
import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from live.streams_of_traces import fixes, merges_at, two_lane_map

from wzsumo.cli import main
from wzsumo.errors import MapError, TraceError
from wzsumo.files.lanes import LanesFile, write_lanes
from wzsumo.live.live_map import live_map, with_trace
from wzsumo.live.stream import replay
from wzsumo.live.stream.arrivals import AS_THEY_ARE, arrivals_of, followed, replayed, streamed
from wzsumo.live.stream.log_folder import open_folder
from wzsumo.live.stream.state_file import read_state, state_bytes
from wzsumo.live.trace.reading import read_trace


def table(numbers: range, *, moved_from: int = 10**6) -> pd.DataFrame:
    parts = []
    for number in numbers:
        own = merges_at(number)
        by = 1.0 / 3.6 if number >= moved_from else 0.0
        s, d, t = fixes(number, lane=lambda s, own=own, by=by: own(s) + by * ((s > 700) & (s < 1200)))  # type: ignore[misc]  # of a lambda with defaults
        parts.append(pd.DataFrame({"vehicle_id": f"v{number:04d}", "time_s": t, "x_m": s, "y_m": d}))
    return pd.concat(parts, ignore_index=True)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map, and 160 traces in two files; lanes move by 1 m at trace 120."""
    folder = tmp_path_factory.mktemp("live")
    (folder / "map").mkdir()
    write_lanes(LanesFile(lanes=two_lane_map(), frame=None), folder / "map")
    (folder / "traces").mkdir()
    table(range(90), moved_from=120).to_parquet(folder / "traces" / "a.parquet")
    table(range(90, 160), moved_from=120).to_parquet(folder / "traces" / "b.parquet")
    return folder


def words(inputs: Path, out: Path, *more: str) -> list[str]:
    return ["live", str(inputs / "traces"), "--map", str(inputs / "map"), "--out", str(out), "--json", *more]


def run(capsys: pytest.CaptureFixture[str], *argv: str) -> tuple[int, list[dict[str, object]], str]:
    with pytest.raises(SystemExit) as stopped:
        main(list(argv))
    out = capsys.readouterr()
    code = stopped.value.code
    assert isinstance(code, int)
    return code, [json.loads(line) for line in out.out.splitlines()], out.err


def files_of(out: Path) -> dict[str, bytes]:
    names = [path for path in sorted(out.rglob("*")) if path.is_file() and path.name not in ("state.zip", "live.html")]
    return {str(path.relative_to(out)): path.read_bytes() for path in names}


def test_replay_writes_alarms_versions_and_a_page(inputs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, lines, _ = run(capsys, *words(inputs, tmp_path / "out"))
    assert code == 0
    assert lines[-1]["traces"] == 160
    assert lines[-1]["alarms"] == 1
    (alarm,) = [line["alarm"] for line in lines if "alarm" in line]
    assert isinstance(alarm, dict)
    assert alarm["kind"] == "shifted"
    assert 120 < alarm["trace"] <= 128
    assert {"start_sd_m", "since_s", "n_traces", "false_alarms_per_trace"} <= set(alarm)
    versions = [json.loads(line) for line in (tmp_path / "out" / "versions.jsonl").read_text().splitlines()]
    assert [version["version"] for version in versions] == list(range(1, 1 + len(versions)))
    assert (tmp_path / "out" / "versions" / "000002" / "lanes.geojson").is_file()
    assert "all lanes moved by" in (tmp_path / "out" / "live.html").read_text()
    before = files_of(tmp_path / "out")
    code, lines, _ = run(capsys, *words(inputs, tmp_path / "out"))  # nothing is taken twice
    assert code == 0
    assert lines[-1]["traces"] == 160
    assert files_of(tmp_path / "out") == before


def test_killed_runs_go_on_to_the_same_bytes(inputs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(capsys, *words(inputs, tmp_path / "whole"))
    random = np.random.default_rng(4)
    command = [sys.executable, "-c", KILLED, *words(inputs, tmp_path / "killed")]
    for _ in range(3):
        process = subprocess.Popen([*command, str(int(random.integers(10, 50)))], stdout=subprocess.DEVNULL)
        assert process.wait() == -signal.SIGKILL
    code, lines, _ = run(capsys, *words(inputs, tmp_path / "killed"))
    assert code == 0
    assert lines[-1]["traces"] == 160
    assert files_of(tmp_path / "killed") == files_of(tmp_path / "whole")


# Runs the command, and kills itself when it has taken some traces, states being written every 7.
KILLED = """
import os, signal, sys
from wzsumo.live.stream import replay
from wzsumo.cli import main
replay.COMMIT_EVERY = 7
left, take = int(sys.argv.pop()), replay._take
def counted(*args, **how):
    global left
    left -= 1
    if left < 0:
        os.kill(os.getpid(), signal.SIGKILL)
    return take(*args, **how)
replay._take = counted
main(sys.argv[1:])
"""


def test_files_that_overlap_in_time_are_taken_in_order(inputs: Path, tmp_path: Path) -> None:
    table(range(0, 20, 2)).to_csv(tmp_path / "even.csv", index=False)
    table(range(1, 20, 2)).to_csv(tmp_path / "odd.csv", index=False)
    ends = [arrival.end_s for arrival in replayed([tmp_path / "odd.csv", tmp_path / "even.csv"], AS_THEY_ARE)]
    assert len(ends) == 20
    assert ends == sorted(ends)


def test_a_vehicle_that_comes_again_is_another_trace() -> None:
    first = table(range(1))
    again = first.assign(time_s=first["time_s"] + 3600)
    assert len(arrivals_of(pd.concat([first, again]), source="here")) == 2


def test_traces_that_come_twice_count_once(inputs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table(range(30)).to_csv(tmp_path / "a.csv", index=False)
    table(range(20, 40)).to_csv(tmp_path / "b.csv", index=False)
    argv = ["live", str(tmp_path / "a.csv"), str(tmp_path / "b.csv"), "--map", str(inputs / "map")]
    code, lines, _ = run(capsys, *argv, "--out", str(tmp_path / "out"), "--json")
    assert code == 0
    assert (lines[-1]["traces"], lines[-1]["twice"]) == (40, 10)


def test_a_growing_folder_is_followed_file_by_file(inputs: Path, tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    table(range(3)).to_csv(tmp_path / "in" / "a.csv", index=False)
    ticks = iter(range(100))

    def wait(_seconds: float) -> None:
        if next(ticks) == 2:
            table(range(3, 5)).to_csv(tmp_path / "in" / "b.csv", index=False)

    clock = iter(np.arange(0, 100, 1.0))
    found = list(followed(tmp_path / "in", AS_THEY_ARE, done=[], idle_s=6, clock=lambda: float(next(clock)), wait=wait))
    assert [(name, len(arrivals)) for name, arrivals in found] == [("a.csv", 3), ("b.csv", 2)]


def test_lines_of_standard_input_become_traces(tmp_path: Path) -> None:
    path = tmp_path / "lines.csv"
    table(range(6)).sort_values("time_s").to_csv(path, index=False)
    with path.open() as lines:
        assert [arrival.key.split()[0] for arrival in streamed(lines, AS_THEY_ARE)] == [f"v{n:04d}" for n in range(6)]


def test_state_is_read_back_to_the_same_map() -> None:
    live = live_map(two_lane_map())
    for arrival in arrivals_of(table(range(8)), source="here"):
        s, d = live.ground.lanes.axis.to_sd(arrival.points)
        reading = read_trace(live.ground, s, d, arrival.times)
        assert reading is not None
        live = with_trace(live, reading).live
    content = state_bytes(live, {"delivered": 3})
    back, about = read_state(content, source="state.zip")
    assert about == {"delivered": 3}
    assert state_bytes(back, about) == content
    with pytest.raises(MapError, match=r"state\.zip: is cut off"):
        read_state(content[:-100], source="state.zip")


def test_bad_input_is_refused_in_one_line(inputs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert run(capsys, *words(inputs, out))[0] == 0
    before = files_of(out)
    other = tmp_path / "other"
    other.mkdir()
    write_lanes(LanesFile(lanes=two_lane_map(closed=False), frame=None), other)
    code, _, said = run(capsys, "live", str(inputs / "traces"), "--map", str(other), "--out", str(out))
    assert (code, said.count("\n")) == (2, 1)
    assert "was begun with another map" in said
    assert files_of(out) == before
    elsewhere = table(range(30)).assign(y_m=500.0)
    elsewhere.to_csv(tmp_path / "elsewhere.csv", index=False)
    code, _, said = run(
        capsys, "live", str(tmp_path / "elsewhere.csv"), "--map", str(inputs / "map"), "--out", str(tmp_path / "new")
    )
    assert (code, said.count("\n")) == (2, 1)
    assert "are not on the map's road" in said
    for name in ("lanes.parquet", "lanes.geojson", "version.json"):
        cut = out / "versions" / "000002" / name
        whole = cut.read_bytes()
        cut.write_bytes(whole[:-10])
        code, _, said = run(capsys, *words(inputs, out))
        assert (code, said.count("\n")) == (2, 1)
        assert f"{name}: is missing or cut off" in said
        cut.write_bytes(whole)


def test_a_faulty_row_names_file_and_row(tmp_path: Path) -> None:
    faulty = table(range(2))
    faulty.loc[3, "x_m"] = np.nan
    with pytest.raises(TraceError, match="x_m of row 3"):
        arrivals_of(faulty, source="a.csv")


def refused(capsys: pytest.CaptureFixture[str], *argv: str) -> str:
    code, _, said = run(capsys, *argv)
    assert (code, said.count("\n")) == (2, 1), said
    return said


def test_files_of_others_are_never_removed(inputs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "versions").mkdir()
    (tmp_path / "versions" / "thesis.txt").write_text("mine")
    assert "holds versions, but no state.zip" in refused(capsys, *words(inputs, tmp_path))
    assert (tmp_path / "versions" / "thesis.txt").read_text() == "mine"
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "alarms.jsonl").write_text("mine")
    assert "holds alarms.jsonl, but no state.zip" in refused(capsys, *words(inputs, tmp_path / "b"))
    assert (tmp_path / "b" / "alarms.jsonl").read_text() == "mine"
    (tmp_path / "c").mkdir()
    (tmp_path / "mine").mkdir()
    (tmp_path / "c" / "versions").symlink_to(tmp_path / "mine")
    assert "is a link" in refused(capsys, *words(inputs, tmp_path / "c"))
    assert list((tmp_path / "mine").iterdir()) == []


def test_map_and_result_are_different_folders(inputs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = files_of(inputs / "map")
    assert "is the folder of --map" in refused(capsys, *words(inputs, inputs / "map"))
    assert files_of(inputs / "map") == before


def test_a_damaged_folder_is_refused_or_used_and_nothing_beside_it_changes(
    inputs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, outside = tmp_path / "whole", tmp_path / "outside.txt"
    assert run(capsys, *words(inputs, whole))[0] == 0
    outside.write_text("not of the live map")
    for name in (
        "state.zip",
        "alarms.jsonl",
        "versions.jsonl",
        "evidence.f4",
        "versions/000002/lanes.parquet",
        "lanes.geojson",
    ):
        for how in ("gone", "empty", "folder"):
            out = tmp_path / "damaged"
            shutil.copytree(whole, out)
            (out / name).unlink()
            if how == "folder":
                (out / name).mkdir()
            elif how == "empty":
                (out / name).write_bytes(b"")
            code, _, said = run(capsys, *words(inputs, out))
            if name != "lanes.geojson" or how == "folder":  # that one is written anew
                assert (code, said.count("\n")) == (2, 1), (name, how, said)
            shutil.rmtree(out)
    live, about = read_state((whole / "state.zip").read_bytes(), source="state.zip")
    about["sizes"] |= {"../outside.txt": 3}
    (whole / "state.zip").write_bytes(state_bytes(live, about))
    run(capsys, *words(inputs, whole))
    assert outside.read_text() == "not of the live map"


def test_one_command_at_a_time_writes_to_a_folder(inputs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with open_folder(tmp_path / "out", inputs / "map"):
        assert "another command is writing there" in refused(capsys, *words(inputs, tmp_path / "out"))


def test_a_terminated_run_loses_no_trace(
    inputs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    run(capsys, *words(inputs, tmp_path / "whole"))
    calls = iter(range(1000))

    def terminated(*args: Any) -> Any:
        if next(calls) == 50:
            signal.raise_signal(signal.SIGTERM)  # while a trace is taken
        return with_trace(*args)

    monkeypatch.setattr(replay, "with_trace", terminated)
    code, _, said = run(capsys, *words(inputs, tmp_path / "stopped"))
    assert (code, "interrupted" in said) == (143, True)
    code, lines, _ = run(capsys, *words(inputs, tmp_path / "stopped"))
    assert (code, lines[-1]["traces"], lines[-1]["twice"]) == (0, 160, 0)
    assert files_of(tmp_path / "stopped") == files_of(tmp_path / "whole")


@pytest.mark.parametrize(
    ("lines", "words_of_it"),
    [
        (b"vehicle_id,time_s,x_m,y_m\na,0,1,2\na,1,2\n", "has 3 columns, the first line 4"),
        (b"\xff\xfe\x00v", "is no text in UTF-8"),
        (b"", "is empty"),
        (b"vehicle_id,time_s,x_m,y_m\na,0,1,\0\n", "standard input: "),
        (b"vehicle_id,time_s,x_m,y_m\na,0,1," + b"9" * 200_000 + b"\n", "standard input: "),
    ],
)
def test_a_stream_that_is_no_table_is_told(
    inputs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, lines: bytes,
    words_of_it: str,
) -> None:  # fmt: skip
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(lines)))
    assert words_of_it in refused(capsys, "live", "-", "--map", str(inputs / "map"), "--out", str(tmp_path / "out"))
