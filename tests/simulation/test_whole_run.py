from dataclasses import replace
from pathlib import Path

import pytest
from builders import paper_layout

from wzsumo.errors import SimulationError
from wzsumo.simulation.demand import DemandSpec
from wzsumo.simulation.files import SimulationSpec, write_sumo_files
from wzsumo.simulation.fleet import run_to_end
from wzsumo.simulation.session import running


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory):
    spec = SimulationSpec(demand=DemandSpec(duration_s=40))
    return write_sumo_files(paper_layout(), tmp_path_factory.mktemp("run"), spec=spec, seed=2)


def test_binary_moves_every_vehicle_as_libsumo_does(files, tmp_path: Path) -> None:
    outputs = [tmp_path / name for name in ("binary.xml", "libsumo.xml")]
    options = ("--fcd-output.attributes", "x,y,angle,speed", "--precision", "4")
    run_to_end(files, options=(*options, "--fcd-output", str(outputs[0])), on_second=lambda _: None)
    with running(files.config, options=(*options, "--fcd-output", str(outputs[1]))) as session:
        for _ in range(400):
            session.step()
    first, second = (path.read_text().split("<fcd-export", 1)[1] for path in outputs)  # the head names the file
    assert first == second


def test_progress_tells_every_simulated_second_once(files) -> None:
    seconds = []
    run_to_end(files, options=(), on_second=seconds.append)
    assert seconds == pytest.approx(list(range(41)))


def test_failure_of_sumo_is_told_with_its_reason(files, tmp_path: Path) -> None:
    missing = replace(files, config=tmp_path / "nowhere.sumocfg")
    with pytest.raises(SimulationError, match=r"SUMO ended with 1: .*nowhere\.sumocfg"):
        run_to_end(missing, options=(), on_second=lambda _: None)
