# ruff: noqa: E402  (threads are limited before numpy is imported)
"""What a sweep costs beside what it cannot do without: bare SUMO runs, and the kernels that map and plan.

python analysis/benchmarks/sweep.py                                   two simulations, 200 cases
python analysis/benchmarks/sweep.py --simulations 10 --cases 2000     the bar: at most 1.5 times the floor, 10,000 cases an hour
python analysis/benchmarks/sweep.py --simulations 10 --cases 500 --workers 1 2    the second worker's worth: 1.8 on idle cores

Times are processor time (user + system, programs that are started included), for which the load of the machine does not
count, but for the speed-up, which is of wall-clock times.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np

from wzsumo.case.crowd import Crowd, reported_traces
from wzsumo.case.map_method import CrowdMethod
from wzsumo.case.plans import plan_for
from wzsumo.scenario.site import prepare_site
from wzsumo.simulation.connection import sumo_binary
from wzsumo.simulation.files import write_sumo_files
from wzsumo.sweep.evaluation.study_case import StudyCase
from wzsumo.sweep.evaluation.tasks import read_simulated, simulate
from wzsumo.sweep.study_file import Study, load_study

SCENARIO = Path(__file__).parents[2] / "scenarios" / "paper.toml"
STUDY = """
name = "cost"
scenarios = ["{scenario}"]
methods = ["{method}"]
[grid]
seed = {{ first = 31, count = {simulations} }}
crowd.used = [1, 2, 3, 4, 5, 6, 8, 10, 15, 20]
gnss.error_m = [0.0, 0.5, 1.0, 1.5, 2.0]
gnss.sampling_interval_s = {intervals}
"""
SAMPLE = 20  # cases whose kernels are timed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--simulations", type=int, default=2)
    parser.add_argument("--cases", type=int, default=200, help="a multiple of 50 times the simulations")
    parser.add_argument("--workers", type=int, nargs="+", default=[2])
    parser.add_argument("--method", default="swept")
    args = parser.parse_args()
    intervals = [0.1, 0.5, 1.0, 2.0, 3.0][: max(1, args.cases // args.simulations // 50)]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "cost.toml"
        simulations, method = args.simulations, args.method
        file.write_text(STUDY.format(scenario=SCENARIO, method=method, simulations=simulations, intervals=intervals))
        study = load_study(file)
        size = f"{len(study.cases)} cases on {len(study.simulations)} simulations"
        print(f"{size}, method {method}, load {os.getloadavg()[0]:.1f}", flush=True)
        bare_s, kernel_s = bare_sumo_s(study), kernels_s(study)
        floor_s = bare_s * len(study.simulations) + kernel_s * len(study.cases)
        print(f"bare SUMO run                    {bare_s:8.2f} s")
        print(f"kernels: mixture, map, plan      {kernel_s:8.3f} s a case (mean of {SAMPLE})")
        print(f"floor                            {floor_s:8.1f} s", flush=True)
        walls_s = [report_sweep(file, Path(folder) / f"out_{n}", workers=n, floor_s=floor_s) for n in args.workers]
    for n, wall_s in zip(args.workers[1:], walls_s[1:], strict=True):
        print(f"{n} workers against {args.workers[0]}: {walls_s[0] / wall_s:.2f} x as fast")


def report_sweep(study: Path, out: Path, *, workers: int, floor_s: float) -> float:
    """Wall-clock time [s] of a sweep, whose cost is printed."""
    sweep_s, wall_s, memory_mb = swept(study, out, workers=workers)
    n_cases = len(load_study(study).cases)
    print(f"sweep, {workers} workers                 {sweep_s:8.1f} s = {sweep_s / floor_s:.2f} x the floor")
    print(f"cases an hour                    {3600 * n_cases / wall_s:8.0f} (wall clock {wall_s:.0f} s)")
    print(f"workers' memory along the sweep  {' '.join(f'{mb:.0f}' for mb in memory_mb)} MB", flush=True)
    return wall_s


def bare_sumo_s(study: Study) -> float:
    """Processor time of SUMO alone on the first simulation, without any output."""
    scenario = study.cases[0].scenario
    with tempfile.TemporaryDirectory() as folder:
        files = write_sumo_files(scenario.layout(), Path(folder), spec=scenario.zone_simulation(), seed=scenario.seed)
        command = [str(sumo_binary("sumo")), "--configuration-file", str(files.config), "--no-warnings"]
        return _processor_s(lambda: subprocess.run(command, check=True, capture_output=True))


def kernels_s(study: Study) -> float:
    """Processor time of a case's kernels, mean of cases all over the study's grid; compiled before."""
    group = next(iter(study.simulations.values()))
    over_zone, _ = read_simulated(simulate(group[0].scenario))
    site = prepare_site(group[0].scenario)

    def run(case: StudyCase) -> float:
        used = reported_traces(over_zone, case.scenario, which="used")

        def kernels() -> None:
            crowd = Crowd(traces=used, road=site.layout.road, spec=case.scenario.mixture, seed=case.scenario.seed)
            method = case.map_method
            if not isinstance(method, CrowdMethod):
                raise TypeError(f"{method.name}: the benchmark is of methods that map the crowd's traces")
            made = method.map_of_crowd(crowd, scenario=case.scenario, site=site)
            plan_for(method, made, scenario=case.scenario, site=site)

        return _processor_s(kernels)

    run(group[0])
    chosen = [group[at] for at in np.linspace(0, len(group) - 1, SAMPLE).round().astype(int)]  # those with many traces too
    return sum(map(run, chosen)) / len(chosen)


def swept(study: Path, out: Path, *, workers: int) -> tuple[float, float, list[float]]:
    """Processor time, wall-clock time and the workers' memory [MB] at six moments of the sweep of a study."""
    command = [sys.executable, "-m", "wzsumo", "sweep", str(study), "--out", str(out), "--workers", str(workers)]
    samples: list[float] = []
    began, before = time.monotonic(), _children_s()
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
        threading.Thread(target=_watch, args=(process, samples), daemon=True).start()
    after = _children_s()
    moments = [samples[int(share * (len(samples) - 1))] for share in (0.2, 0.4, 0.6, 0.8, 0.95)] if samples else []
    return after - before, time.monotonic() - began, moments


def _watch(process: subprocess.Popen[bytes], samples: list[float]) -> None:
    while process.poll() is None:
        samples.append(max((_resident_mb(child) for child in _children_of(process.pid)), default=0.0))
        time.sleep(2)


def _children_of(pid: int) -> list[int]:
    stats = [path for path in Path("/proc").glob("[0-9]*/stat") if path.exists()]
    parents = {int(path.parent.name): text for path in stats if (text := _read(path))}
    return [child for child, text in parents.items() if int(text.rsplit(")", 1)[1].split()[1]) == pid]


def _resident_mb(pid: int) -> float:
    fields = _read(Path(f"/proc/{pid}/statm")).split()
    return int(fields[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6 if fields else 0.0


def _read(path: Path) -> str:
    try:
        return path.read_text()
    except OSError:  # it has ended meanwhile
        return ""


def _processor_s(work: Callable[[], object]) -> float:
    before = time.process_time() + _children_s()
    work()
    return time.process_time() + _children_s() - before


def _children_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


if __name__ == "__main__":
    main()
