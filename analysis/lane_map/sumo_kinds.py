"""Zones of the scenario library with SUMO's traffic as kinds: a fleet is simulated once a zone and seed, and kept in a folder.

    from sumo_kinds import sumo_kinds
    sumo_kinds(Path("results/fleets"))["sumo_paper"].case(n=30, seed=81, receivers="1")

Where the traffic has changed, remove the folder. Receivers with a plain number have the errors of `wzsumo.sensing.gnss`, as in
scenarios; the others are those of receivers.py. The truth is the layout's, from the first device to the last.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from cases import FOOT_M, Case
from receivers import receiver_of

from wzsumo.case.crowd import traces_over_zone
from wzsumo.scenario.scenario import Scenario, load_scenario
from wzsumo.sensing.equipped import choose_equipped
from wzsumo.sensing.gnss import GnssSpec, report
from wzsumo.simulation.files import write_sumo_files
from wzsumo.simulation.fleet import simulate_fleet
from wzsumo.work_zone import WorkZoneLayout

SCENARIOS = Path(__file__).parents[2] / "scenarios"
NAMES = (
    "paper",
    "left_lane",
    "right_lane",
    "double_closure",
    "lane_shift",
    "interior_lane",
    "paper_bend_900m",
    "shoulder_freeway",
)


@dataclass(frozen=True, kw_only=True, eq=False)
class SumoKind:
    """A zone of the library; its fleets are kept in `fleets`."""

    name: str
    scenario: Scenario
    fleets: Path
    resolution_m: float = 0.254

    @cached_property
    def layout(self) -> WorkZoneLayout:
        """The zone as it is laid out."""
        return self.scenario.layout()

    def case(
        self,
        *,
        n: int,
        seed: int,
        receivers: str = "0.5",
        faults: Iterable[str] = (),
        interval_s: float = 1.0,
        states_accuracy: bool = False,
        common_offset_m: float = 0.0,
        announced_shift_m: float = 0.0,
        road_offset_m: float = 0.0,
    ) -> Case:
        """Traces of the first n equipped vehicles; arguments as those of `Kind.case`, faults are not made."""
        if tuple(faults) or states_accuracy:
            raise ValueError(f"{self.name}: faults={tuple(faults)} and stated accuracy are not made of SUMO's vehicles")
        fleet = self.true_traces(seed)
        chosen = choose_equipped(pd.Index(fleet["vehicle_id"].unique()), penetration=1.0, seed=seed)
        if n > len(chosen):
            raise ValueError(f"{self.name}: n={n} must be at most the {len(chosen)} vehicles that passed")
        true = fleet[fleet["vehicle_id"].isin(chosen[:n])]
        traces = _reported(true, receivers, interval_s=interval_s, seed=seed)
        road = self.layout.road
        heading = float(road.heading_at((self.layout.start + self.layout.end) / 2))
        across = np.array([-np.sin(heading), np.cos(heading)])
        traces[["x_m", "y_m"]] += common_offset_m * across
        margins = (min(-road.right_shoulder, 0.0) - 2.0, road.left_edge + 2.0)
        return Case(
            name=self.name,
            traces=traces[["vehicle_id", "time_s", "x_m", "y_m"]],
            road_toml=self._road_file(announced_shift_m=announced_shift_m, offset=road_offset_m * across),
            drivable=self.layout.drivable_between(self.layout.start, self.layout.end),
            scored=road.strip(self.layout.start, self.layout.end, *margins),
            resolution_m=self.resolution_m,
        )

    def true_traces(self, seed: int) -> pd.DataFrame:
        """True 10 Hz traces over the zone of all vehicles that passed it."""
        path = self.fleets / f"{self.name}_{seed}.parquet"
        if not path.exists():
            with TemporaryDirectory() as folder:
                files = write_sumo_files(self.layout, Path(folder), spec=self.scenario.zone_simulation(), seed=seed)
                fleet = simulate_fleet(files, on_second=lambda _time: None)
            self.fleets.mkdir(parents=True, exist_ok=True)
            unfinished = path.with_suffix(".unfinished")
            traces_over_zone(fleet, self.layout).to_parquet(unfinished, index=False)
            unfinished.replace(path)
        return pd.read_parquet(path)

    def _road_file(self, *, announced_shift_m: float, offset: np.ndarray[tuple[int], np.dtype[np.float64]]) -> str:
        road = self.layout.road
        points = ", ".join(f"[{x:.3f}, {y:.3f}]" for x, y in road.reference_line + offset)
        start, end = ((at + announced_shift_m) / FOOT_M for at in (self.layout.start, self.layout.end))
        return (
            f"[road]\nlane_count = {len(road.lane_widths)}\nlane_width_ft = {road.lane_widths[0] / FOOT_M:.4f}\n"
            f"left_shoulder_ft = {road.left_shoulder / FOOT_M:.4f}\nright_shoulder_ft = {road.right_shoulder / FOOT_M:.4f}\n"
            f"reference_points_m = [{points}]\n[announced]\nstart_ft = {start:.1f}\nend_ft = {end:.1f}\n"
        )


def sumo_kinds(fleets: Path) -> dict[str, SumoKind]:
    """The zones of the library as kinds, by name."""
    return {
        f"sumo_{name}": SumoKind(name=f"sumo_{name}", scenario=load_scenario(SCENARIOS / f"{name}.toml"), fleets=fleets)
        for name in NAMES
    }


def _reported(true: pd.DataFrame, receivers: str, *, interval_s: float, seed: int) -> pd.DataFrame:
    """What receivers report of true traces."""
    if receivers.replace(".", "").isdigit():
        return report(true, spec=GnssSpec(error_m=float(receivers), sampling_interval_s=interval_s), seed=seed)
    exact = report(true, spec=GnssSpec(error_m=0.0, sampling_interval_s=interval_s), seed=seed)
    tables = []
    for number, (_, trace) in enumerate(exact.groupby("vehicle_id", sort=True)):
        random = np.random.default_rng([seed, number, 5])
        error = receiver_of(receivers, seed=seed, number=number).errors(trace["time_s"].to_numpy(), random)
        tables.append(trace.assign(x_m=trace["x_m"] + error[:, 0], y_m=trace["y_m"] + error[:, 1]))
    return pd.concat(tables, ignore_index=True)
