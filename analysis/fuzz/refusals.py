"""Measures what it takes to refuse inputs that ask for too much: processor time and memory, beside those of the start alone.

    .venv/bin/python analysis/fuzz/refusals.py --out results/refusals

The start alone is the same command with a file that is not there.
"""

import argparse
import csv
import gzip
import os
import sys
import tempfile
from pathlib import Path

from damage import HUGE
from networks import REPOSITORY
from trace_inputs import BOMB

PAPER = (REPOSITORY / "scenarios" / "paper.toml").read_text()
STUDY = 'name = "s"\nscenarios = ["paper"]\nmethods = ["swept"]\n[grid]\n'
POSES = ["--start", "0", "0", "0", "--goal", "1", "0", "0"]
NPY = "{{'descr': '<f8', 'fortran_order': False, 'shape': ({rows}, 3), }}"
YAML_OF_BIG = "image: big.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
ALIASES = "\n".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9) if n else 1}]" for n in range(9))
# Kind: (command, name of the file, its content, words behind the file).
Case = tuple[str, str, str | bytes, list[str]]


def cases() -> dict[str, Case]:
    """An input of each kind."""
    straight = "length_ft = 6000"
    changed = {
        "bend of radius 1e-9": (straight, f"alignment = [{{ {straight}, radius_ft = 1e-9 }}]"),
        "road of 2^63 ft": (straight, f"length_ft = {2**63}"),
        "road of 1e7 ft": (straight, "length_ft = 10000000"),
        "1e9 vehicles an hour": ("flow_vph = 1500", "flow_vph = 1000000000"),
        "1e9 s of traffic": ("duration_s = 900", "duration_s = 1000000000"),
        "1e9 traces": ("used = 5", "used = 1000000000"),
        "cells of 1e-9 m": ("[control]", "[map]\nresolution_m = 1e-9\n[control]"),
        "5,000 digits": ("seed = 1", f"seed = {'9' * 5000}"),
    }
    studies = {
        "1e7 seeds": "seed = { first = 1, count = 10000000 }",
        "1e9 seeds": "seed = { first = 1, count = 1000000000 }",
        "9 million cases": f"seed = {{ first = 1, count = 3000 }}\ncrowd.used = {list(range(1, 3001))}",
    }
    rows = [f"v{v},{t},{20 * t},{v}" for v in range(3) for t in range(20)]
    far = [f"v{v},{1e6 * t},{2e7 * t},{v}" for v in range(3) for t in range(20)]
    head = "vehicle_id,time_s,x_m,y_m\n"
    place = ["--zone", str(REPOSITORY / "scenarios" / "paper.toml"), "--at", "e", "1"]
    return {
        **{name: ("run", "zone.toml", PAPER.replace(*change), ["--method", "swept"]) for name, change in changed.items()},
        **{name: ("sweep", "study.toml", STUDY + factor, ["--dry-run"]) for name, factor in studies.items()},
        "TOML nested 50,000 deep": ("run", "zone.toml", "a = " + "[" * 50_000, ["--method", "swept"]),
        "YAML aliases": ("plan", "m.yaml", f"{ALIASES}\nimage: x.pgm\n", POSES),
        "image of 1e10 pixels": ("plan", "big.yaml", YAML_OF_BIG, POSES),
        **{f"array of {rows:g} rows": ("ground", "c.npy", _npy(rows), []) for rows in (10**9, HUGE)},
        "cells of 1e-6 m, from traces": ("map", "t.csv", head + "\n".join(rows), ["--resolution-m", "1e-6"]),
        "traces 3e8 m long": ("map", "t.csv", head + "\n".join(far), []),
        "gzip of 300 MB of zeros": ("map", "t.csv.gz", gzip.compress(b"0" * 300 * 2**20, mtime=0), []),
        "XML entities": ("map", "t.xml", f"{BOMB}<fcd-export>&z;</fcd-export>", []),
        "network nested 100,000 deep": ("place", "n.net.xml", "<net>" + "<a>" * 100_000 + "</a>" * 100_000 + "</net>", place),
        "feed nested 200,000 deep": ("init", "f.geojson", "[" * 200_000, []),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/refusals"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    table: list[tuple[str, ...]] = [("kind", "command", "exit_code", "lines", "cpu_s", "of_which_start_s", "largest_mb")]
    starts: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as base:
        (Path(base) / "big.pgm").write_bytes(b"P5\n100000 100000\n255\n\0\0")
        for kind, (command, name, content, words) in cases().items():
            path = Path(base) / name
            path.unlink(missing_ok=True)
            if command not in starts:
                starts[command] = min(_measured(command, path, words)[2] for _ in range(3))
            path.write_bytes(content.encode() if isinstance(content, str) else content)
            code, lines, cpu_s, largest_mb = _measured(command, path, words)
            table.append(
                (kind, command, *map(str, (code, lines, f"{cpu_s:.1f}", f"{starts[command]:.1f}", f"{largest_mb:.0f}")))
            )
            with (args.out / "refusals.csv").open("w", newline="") as file:
                csv.writer(file).writerows(table)
    print(*(",".join(row) for row in table), sep="\n")


def _measured(command: str, path: Path, words: list[str]) -> tuple[int, int, float, float]:
    """(exit code, lines on stderr, processor time [s], largest memory [MB]) of a command in a process of its own."""
    said, out = path.with_name("said"), path.with_name("out.npy")
    given = ["--from", str(path)] if command == "init" else [str(path)]
    child = os.fork()
    if child == 0:
        os.dup2(os.open(said, os.O_CREAT | os.O_TRUNC | os.O_WRONLY), 2)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.execv(sys.executable, [sys.executable, "-m", "wzsumo", command, *given, *words, "--out", str(out)])  # noqa: S606 - ours
    _, status, usage = os.wait4(child, 0)
    lines = len(said.read_text(errors="replace").splitlines())
    return os.waitstatus_to_exitcode(status), lines, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def _npy(rows: int) -> bytes:
    header = NPY.format(rows=rows).ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode() + b"\0" * 2400


if __name__ == "__main__":
    main()
