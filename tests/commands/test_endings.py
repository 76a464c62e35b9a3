"""How commands end: by signals, by a pipe that nobody reads, with what they leave behind."""

import os
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from wzsumo.cli import main
from wzsumo.commands import capacity
from wzsumo.files.ros_map import write_map
from wzsumo.grid import blank_grid
from wzsumo.simulation.connection import sumo_binary

PAPER = Path(__file__).parents[2] / "scenarios" / "paper.toml"


def started(*words: object, folder: Path, **options: Any) -> "subprocess.Popen[bytes]":
    """A command in a process of its own, whose temporary files lie in a folder."""
    (folder / "tmp").mkdir(exist_ok=True)
    environment = os.environ | {"TMPDIR": str(folder / "tmp")}
    command = [sys.executable, "-m", "wzsumo", *map(str, words)]
    settings: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "env": environment} | options
    return subprocess.Popen(command, **settings)


def is_simulating(process: "subprocess.Popen[bytes]") -> bool:
    """Whether SUMO has begun to simulate: the first line about its progress tells more than nothing."""
    assert process.stderr is not None
    read = b""
    while piece := process.stderr.read(1):
        read += piece
        if re.search(rb"fleet in SUMO: [1-9]\d* %", read[-30:]):
            return True
    return False


def processes_that_name(folder: Path) -> list[str]:
    """Command lines of processes that name a folder."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            line = entry.read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except OSError:  # it has just ended
            continue
        if str(folder) in line and int(entry.parent.name) != os.getpid():
            found.append(line)
    return found


def test_run_that_is_terminated_leaves_no_process_and_no_file(tmp_path: Path) -> None:
    process = started("run", PAPER, "--out", tmp_path / "out", "--method", "swept", folder=tmp_path)
    assert is_simulating(process)
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate()
    assert process.returncode == 143
    assert err.decode().splitlines()[-1] == "wzsumo: interrupted; what was finished is kept, nothing is half-written"
    assert b"Traceback" not in err
    assert [path.name for path in tmp_path.rglob("*")] == ["tmp"]
    assert processes_that_name(tmp_path) == []


MARK = "WZSUMO_TEST_OF_ENDINGS"


def programs_of(mark: str) -> dict[int, str]:
    """Command line by number of all processes whose environment holds a mark."""
    found = {}
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # it has just ended
            if f"{MARK}={mark}".encode() in (entry / "environ").read_bytes().split(b"\0"):
                found[int(entry.name)] = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
    return found


def wait_for(condition: Callable[[], bool], *, patience_s: float = 60.0) -> bool:
    """Whether a condition comes true in time."""
    until = time.monotonic() + patience_s
    while not (holds := condition()) and time.monotonic() < until:
        time.sleep(0.01)
    return holds


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_nothing_of_a_sweep_runs_once_the_command_has_ended(number: signal.Signals, tmp_path: Path) -> None:
    """After SIGKILL the workers see that it has ended, and end."""
    study, mark = tmp_path / "study.toml", str(tmp_path)
    study.write_text(f'name = "s"\nscenarios = ["{PAPER}"]\nmethods = ["swept"]\n[grid]\nseed = [1, 2]\n')
    words = ("sweep", study, "--workers", "1", "--out", tmp_path / "out")
    process = started(*words, folder=tmp_path, env=os.environ | {MARK: mark, "TMPDIR": str(tmp_path)})
    assert wait_for(lambda: any("bin/sumo " in line for line in programs_of(mark).values()))
    process.send_signal(number)
    process.wait()
    left = programs_of(mark)
    _, err = process.communicate()
    if number == signal.SIGTERM:
        assert (process.returncode, left) == (143, {})
        assert b"Traceback" not in err
    else:
        assert wait_for(lambda: not programs_of(mark))


def test_what_a_killed_run_left_is_removed_by_the_next_command_that_writes_there(tmp_path: Path) -> None:
    process = started("run", PAPER, "--out", tmp_path / "out", "--method", "swept", folder=tmp_path)
    assert is_simulating(process)
    process.kill()
    process.communicate()
    (tmp_path / "out" / "mine.txt").write_text("mine")
    assert len(list((tmp_path / "out").iterdir())) == 2
    again = started("net", PAPER, "--out", tmp_path / "out", folder=tmp_path)
    again.communicate()
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names >= {"mine.txt", "zone.net.xml", "zone.sumocfg"}
    assert not [name for name in names if "unfinished" in name]


def test_reader_that_goes_away_ends_the_command_as_it_ends_other_programs(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    process = started("capacity", PAPER, "--json", folder=tmp_path, stdout=writing)
    os.close(writing)
    _, err = process.communicate()
    assert (process.returncode, err) == (141, b"")


@pytest.mark.parametrize("words", [("--help",), ("init",), ("schema",), ("--completion", "bash")])
def test_words_that_nobody_reads_to_their_end_leave_no_traceback(tmp_path: Path, words: tuple[str, ...]) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    process = started(*words, folder=tmp_path, stdout=writing)
    os.close(writing)
    _, err = process.communicate()
    assert process.returncode in {0, 141}  # argparse itself passes over a pipe that is closed
    assert err == b""


def test_words_go_to_a_terminal_of_ascii_and_names_that_are_no_utf_8_are_told(tmp_path: Path) -> None:
    folder = tmp_path / os.fsdecode(b"caf\xe9")
    folder.mkdir()
    environment = os.environ | {"PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    process = started("capacity", folder / "“zone”.toml", folder=tmp_path, env=environment)
    out, err = process.communicate()
    assert (process.returncode, out, err.count(b"\n")) == (2, b"", 1)
    assert b"no such file" in err
    assert b"caf\\udce9" in err


@pytest.mark.parametrize("text", ["2147483648", "-1", "1.0", "²", "9" * 5000, "nan", ""])
def test_seed_that_sumo_would_drop_is_refused_and_told_shortly(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["run", str(PAPER), "--out", str(tmp_path / "out"), f"--seed={text}"])
    err = capsys.readouterr().err
    assert stopped.value.code == 2
    assert "must be a whole number from 0 to 2147483647" in err
    assert err.count("\n") == 1
    assert len(err) < 600


def test_largest_seeds_reach_sumo_and_give_other_drivers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With the same vehicles, only SUMO's own random numbers can make a difference."""
    driven = []
    for seed in (2**31 - 1, 2**31 - 2):
        folder = tmp_path / str(seed)
        scenario = tmp_path / f"paper{seed}.toml"
        scenario.write_text(re.sub(r"^seed = \d+", f"seed = {seed}", PAPER.read_text(), flags=re.M))
        with pytest.raises(SystemExit):
            main(["net", str(scenario), "--out", str(folder)])
        routes = str(tmp_path / str(2**31 - 1) / "zone.rou.xml")
        options = ("--route-files", routes, "--end", "30", "--fcd-output", str(folder / "fcd.xml"), "--no-step-log")
        subprocess.run(
            [str(sumo_binary("sumo")), "-c", str(folder / "zone.sumocfg"), *options], check=True, capture_output=True
        )
        driven.append((folder / "fcd.xml").read_text().partition("<fcd-export")[2])
    assert driven[0] != driven[1]
    capsys.readouterr()


def test_control_characters_of_an_input_do_not_reach_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scenario = tmp_path / "evil.toml"
    scenario.write_text('name = "x"\n"\\u001b]0;owned\\u0007" = 1\n')
    with pytest.raises(SystemExit) as stopped:
        main(["capacity", str(scenario)])
    err = capsys.readouterr().err
    assert stopped.value.code == 2
    assert "\x1b" not in err
    assert "\\x1b]0;owned\\x07: unknown key" in err


@pytest.mark.parametrize("words", [[], ["nonsense"], ["run"], ["plan", "m.yaml", "--start", "1", "2"], ["map", "--nonsense"]])
def test_words_that_are_no_command_are_told_in_one_line(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(words)
    err = capsys.readouterr().err
    assert stopped.value.code == 2
    assert err.count("\n") == 1
    assert err.startswith("wzsumo: ")


def test_second_signal_does_not_disturb_the_cleaning_up_after_the_first(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    cleaned = []

    def interrupted_twice(_args: object) -> None:
        try:
            signal.raise_signal(signal.SIGTERM)
        finally:
            signal.raise_signal(signal.SIGINT)
            cleaned.append(True)

    monkeypatch.setattr(capacity, "run", interrupted_twice)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(SystemExit) as stopped:
        main(["capacity", str(PAPER)])
    assert (stopped.value.code, cleaned) == (143, [True])
    assert signal.getsignal(signal.SIGINT) is before
    assert "interrupted" in capsys.readouterr().err


@pytest.mark.parametrize("speed", ["1e-300", "0", "1e-160"])
def test_path_for_a_speed_of_next_to_nothing_is_planned_by_the_steering_alone(
    speed: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_map(blank_grid((0, -5, 120, 5), resolution=0.25, p_occupied=0.0), tmp_path)
    poses = ("--start", "10", "0", "0", "--goal", "100", "1", "0")
    with pytest.raises(SystemExit) as stopped:
        main(["plan", str(tmp_path / "map.yaml"), *poses, "--out", str(tmp_path / "p.csv"), "--speed-mps", speed])
    assert stopped.value.code == 0
    assert np.isfinite(pd.read_csv(tmp_path / "p.csv").to_numpy()).all()
    assert "FOUND" in capsys.readouterr().out


def test_disk_that_fills_up_while_sumo_writes_is_told_in_one_line_and_nothing_is_left(tmp_path: Path) -> None:
    """A limit on the size of files stands for the full disk; SUMO inherits it."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (400_000, 400_000))

    process = started("run", PAPER, "--out", tmp_path / "out", "--method", "swept", folder=tmp_path, preexec_fn=limit)
    _, err = process.communicate()
    told = err.decode().replace("\r", "\n").splitlines()
    assert process.returncode == 2, told
    assert told[-1].startswith(f"wzsumo: {tmp_path / 'out'}: the disk is full; what was there stays")
    assert b"Traceback" not in err
    assert [path.name for path in tmp_path.rglob("*")] == ["tmp"]
