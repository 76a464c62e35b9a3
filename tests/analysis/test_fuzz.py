"""A short run of the fuzzer on the kinds of input that are quick; `make fuzz` runs thousands of all."""

import subprocess
import sys
from pathlib import Path

import pytest

FUZZ = Path(__file__).parents[2] / "analysis" / "fuzz" / "fuzz.py"


@pytest.mark.parametrize("kind", ["ROS map", "scenario", "words", "traces", "place"])
def test_damaged_inputs_end_with_a_result_or_one_line(kind: str, tmp_path: Path) -> None:
    command = [sys.executable, str(FUZZ), "--kind", kind, "--inputs", "6", "--seed", "77", "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    counts = [line.split(",") for line in done.stdout.splitlines()[1:]]
    assert sum(int(row[2]) for row in counts) == 6
    assert {row[1] for row in counts} <= {"done", "refused"}
