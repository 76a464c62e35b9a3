"""Run the Python example at the top of the README in an empty folder, and keep what it prints.

    python analysis/pages/first_lines.py

Writes what they print into docs/results/first_lines.txt, which the README shows.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from code_parts import ROOT
from records import RESULTS


def printed(text: str, folder: Path) -> str:
    """What the first block of Python of a page prints, run in a folder with the scenario that `wzsumo init` writes there."""
    code = re.findall(r"^```python\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)[0]
    for words in (["-m", "wzsumo", "init", "right_lane"], ["-c", code]):
        done = subprocess.run([sys.executable, *words], cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(done.stderr)
    return done.stdout


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        said = printed((ROOT / "README.md").read_text(encoding="utf-8"), Path(folder))
    (RESULTS / "first_lines.txt").write_text(said, encoding="utf-8")


if __name__ == "__main__":
    main()
