"""What commands say: progress on a terminal and in a log, nothing where they are to be quiet, figures in words."""

import argparse
import json
import subprocess
from pathlib import Path

import numba
import pytest

from wzsumo.cli import main, whole_parser
from wzsumo.commands.terminal import progress
from wzsumo.commands.terminal.completion import SHELLS, completion_script
from wzsumo.commands.terminal.progress import progress_of, say, telling_of_compiling
from wzsumo.commands.terminal.words import lines_of


class Clock:
    """A clock that a test sets."""

    now = 0.0

    def monotonic(self) -> float:
        return self.now


def args(*, quiet: bool) -> argparse.Namespace:
    return argparse.Namespace(quiet=quiet)


def test_log_gets_a_line_after_a_while_and_from_time_to_time(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    clock = Clock()
    monkeypatch.setattr(progress, "time", clock)
    with progress_of(args(quiet=False))("mixtures", 200.0) as tell:
        for clock.now in range(30):
            tell(clock.now * 5)
    assert capsys.readouterr().err.splitlines() == [
        "mixtures: 5 %", "mixtures: 30 %", "mixtures: 55 %", "mixtures: done in 29 s"
    ]  # fmt: skip
    with progress_of(args(quiet=False))("short", 1.0) as tell:
        tell(0.5)
    assert capsys.readouterr().err == ""


def test_quiet_command_says_nothing_on_its_way(capsys: pytest.CaptureFixture[str]) -> None:
    say(args(quiet=True), "advice")
    with progress_of(args(quiet=True))("mixtures", 1.0) as tell:
        tell(0.5)
    assert capsys.readouterr().err == ""


def test_compiling_is_told_once_and_not_of_other_peoples_kernels(capsys: pytest.CaptureFixture[str]) -> None:
    def kernel(number: float) -> float:
        return number + 1

    for module, quiet, n_lines in (("wzsumo.planning.made_up", False, 1), ("scipy", False, 0), ("wzsumo.made_up", True, 0)):
        kernel.__module__ = module
        with telling_of_compiling(args(quiet=quiet)):
            for number in (1, 2.0):  # compiled for each type
                numba.njit(kernel)(number)
        err = capsys.readouterr().err
        assert err.count("\n") == n_lines
        assert not n_lines or err.startswith("compiling the kernels that this takes;")


def test_quiet_leaves_out_the_next_command_and_keeps_the_figures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = {}
    for words in ((), ("--quiet",)):
        with pytest.raises(SystemExit):
            main(["layout", "right_lane", "--out", str(tmp_path), *words])
        said[words] = capsys.readouterr().out.splitlines()
    assert said[()][:-1] == said["--quiet",]
    assert said[()][-1].startswith("next: wzsumo run right_lane --out DIR")
    assert "  merging taper: 238 m" in said[()]  # 65 mph x 12 ft = 780 ft: MUTCD 11th ed., Table 6B-4


def test_figures_are_told_in_words_and_not_as_python_has_them() -> None:
    figures = {
        "frame": {"crs": "EPSG:32617", "origin_m": [1.0, 2.0]},
        "dropped": [{"vehicle_id": "v1", "n_fixes": 3, "reason": "stands"}],
        "closed": True, "warnings": [], "p_closed": [0.25, 1e-12], "free_m2": 7477.4, "announced": None,
    }  # fmt: skip
    text = "\n".join(lines_of(figures))
    assert not any(sign in text for sign in "{}[]'_") or "vehicle_id" not in text
    assert text.splitlines() == [
        "frame:", "  crs: EPSG:32617", "  origin: 1, 2 m", "dropped:", "  vehicle id v1, fixes 3, reason stands", "closed: yes",
        "p closed: 0.25, 1e-12", "free: 7477 m2",
    ]  # fmt: skip


@pytest.mark.parametrize("shell", SHELLS)
def test_completion_knows_every_command(shell: str, tmp_path: Path) -> None:
    script = completion_script(whole_parser(), shell=shell)
    assert all(name in script for name in ("init", "sweep", "at-latlon"))
    if shell == "bash":
        (tmp_path / "complete.sh").write_text(script)
        ask = f"source {tmp_path}/complete.sh; COMP_WORDS=(wzsumo init ri); COMP_CWORD=2; _shtab_wzsumo; echo ${{COMPREPLY[@]}}"
        found = subprocess.run(["bash", "-c", ask], capture_output=True, text=True, check=True).stdout.split()
        assert found == ["right_lane", "right_lane_barrier"]


def test_map_tells_its_figures_in_words(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [f"v{n},{s / 20},{s},{0.3 * n}" for n in range(4) for s in range(0, 200, 2)]
    (tmp_path / "t.csv").write_text("vehicle_id,time_s,x_m,y_m\n" + "\n".join(rows))
    with pytest.raises(SystemExit):
        main(["map", str(tmp_path / "t.csv"), "--out", str(tmp_path / "out")])
    out = capsys.readouterr().out
    assert "traces: 4\n" in out
    assert not any(sign in out for sign in ("{", "[", "'", "None", "True"))
    assert "next: " in out
    with pytest.raises(SystemExit):
        main(["map", str(tmp_path / "t.csv"), "--out", str(tmp_path / "out"), "--json"])
    assert json.loads(capsys.readouterr().out)["n_traces"] == 4


def test_every_argument_of_every_command_says_what_it_is() -> None:
    commands = next(action.choices for action in whole_parser()._actions if isinstance(action.choices, dict))
    silent = {name: [each.dest for each in command._actions if not each.help] for name, command in commands.items()}
    assert not {name: arguments for name, arguments in silent.items() if arguments}
