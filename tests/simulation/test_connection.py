import os
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from signal_at_each_line import interrupted_at_each_line

from wzsumo.errors import DisplayError, SimulationError
from wzsumo.simulation.connection import _refuse_another, connected_program, refuse_without_display, window_command


def test_window_starts_at_once_and_goes_away_at_the_end() -> None:
    command = window_command(Path("/sumo/bin/sumo-gui"), ["--configuration-file", "zone.sumocfg"])
    assert command[:3] == ["/sumo/bin/sumo-gui", "--configuration-file", "zone.sumocfg"]
    assert {"--start", "--quit-on-end", "--delay"} <= set(command)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only there a display has to be named")
def test_machine_without_a_display_is_told_so_and_one_with_it_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(DisplayError, match="no display here"):
        refuse_without_display()
    monkeypatch.setenv("DISPLAY", ":0")
    refuse_without_display()


def test_program_is_driven_by_traci_also_after_the_library_was_loaded() -> None:
    code = (
        "from wzsumo.simulation.connection import _load_libsumo, _load_traci\n"
        "library, program = _load_libsumo(), _load_traci()\n"
        "print(program is not library, hasattr(program, 'getFreeSocketPort'))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "True True\n"


@pytest.mark.parametrize(("answers", "refused"), [("a/zone.sumocfg", False), ("b/zone.sumocfg", True)])
def test_simulation_of_others_at_the_same_port_is_not_taken_for_ours(answers: str, refused: bool) -> None:
    api = SimpleNamespace(simulation=SimpleNamespace(getOption={"configuration-file": answers}.get))
    command = ["sumo", "--configuration-file", "a/zone.sumocfg", "--remote-port", "40000"]
    with pytest.raises(SimulationError, match="another simulation, of b/zone") if refused else nullcontext():
        _refuse_another(api, command)


def test_signal_at_any_line_leaves_no_sumo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[subprocess.Popen[bytes]] = []

    class Noted(subprocess.Popen[bytes]):
        def __init__(self, *words: Any, **options: Any) -> None:
            super().__init__(*words, **options)
            started.append(self)

    program, told_to_end = tmp_path / "sumo", tmp_path / "told_to_end"
    os.mkfifo(told_to_end)
    program.write_text(f"#!/bin/sh\nexec cat {told_to_end}\n")
    program.chmod(0o755)
    api = SimpleNamespace(
        simulation=SimpleNamespace(getOption=lambda _name: "zone.sumocfg"), close=lambda: told_to_end.write_text("")
    )
    monkeypatch.setattr("wzsumo.simulation.connection.subprocess.Popen", Noted)
    monkeypatch.setattr("wzsumo.simulation.connection._connect", lambda *_: api)
    monkeypatch.setattr("wzsumo.simulation.connection.sumo_binary", lambda _name: program)

    def act() -> None:
        with connected_program(["zone.sumocfg"], folder=tmp_path):
            pass

    for line in interrupted_at_each_line(act, files=("simulation/connection.py", "wzsumo/errors.py")):
        assert all(process.returncode is not None for process in started), line
    assert len(started) > 20
