"""Inputs of many kinds with their truth: closed-form roads, zones, drivers and receivers, of another make than the product's.

    from kinds import KINDS
    case = KINDS["left"].case(n=30, seed=1, receivers="mixed")
    case.traces, case.before(), case.drivable, case.scored      # table, MapBefore, shapely areas
    case.write(Path("folder"))                                  # traces.csv, road.toml, truth.geojson

Each seed of a kind has its own road frame, stations, lane width and lane shares; the first of more vehicles are the same
vehicles. `receivers` is a crowd or a name in `receivers.RECEIVERS`, `faults` some of `receivers.FAULTS`. Truth: ground between
the line of devices and the edge lines of open lanes, the open part of tapers included. Lengths in metres.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from cases import Case, road_file
from drivers import Drive, Traffic, drive, work_truck
from layouts import Layout
from receivers import Crowd, receiver_of, reported, with_fault
from zone_layouts import LAYOUTS

OTHER_CARRIAGEWAY_M = 12.0  # from the left edge line to the left edge line of the other direction


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A layout by seed, and its traffic."""

    name: str
    layout: Callable[[np.random.Generator], Layout]
    traffic: Traffic = field(default_factory=Traffic)
    other_direction: float = 0.0  # vehicles of the other carriageway, as a share of n
    resolution_m: float = 0.254

    def case(
        self,
        *,
        n: int,
        seed: int,
        receivers: str | Crowd = "0.5",
        faults: Iterable[str] = (),
        interval_s: float = 1.0,
        states_accuracy: bool = False,
        common_offset_m: float = 0.0,
        announced_shift_m: float = 0.0,
        road_offset_m: float = 0.0,
    ) -> Case:
        """Traces of n vehicles, with the road before and the truth; position_sd_m where the receivers state their error.

        All positions are `common_offset_m` off to the left. The zone is announced `announced_shift_m` too far on (negative: too
        early), the road is drawn `road_offset_m` to the left of where it is.
        """
        layout = self.layout(np.random.default_rng([seed, 99]))
        tables = []
        plan = _plan_of_faults(n, tuple(faults))
        for number in range(n):
            driven = drive(layout, self.traffic, seed=seed, number=number)
            fault = plan.get(number)
            if fault == "truck":
                driven = work_truck(layout, seed=seed, number=number)
            elif fault:
                driven = with_fault(driven, layout, fault, seed=seed)
            tables.append(_table(driven, layout, number, receivers, interval_s=interval_s, seed=seed))
        if self.other_direction:
            tables += self._others(layout, n, receivers, interval_s=interval_s, seed=seed)
        traces = pd.concat(tables, ignore_index=True)
        if not states_accuracy:
            traces = traces.drop(columns="position_sd_m")
        if common_offset_m:
            heading = float(layout.alignment.heading(np.array([layout.length / 2]))[0])
            traces["x_m"] -= common_offset_m * np.sin(heading)
            traces["y_m"] += common_offset_m * np.cos(heading)
        return Case(
            name=self.name,
            traces=traces,
            road_toml=road_file(layout, announced_shift_m=announced_shift_m, road_offset_m=road_offset_m),
            drivable=layout.drivable(),
            scored=layout.scored(),
            layout=layout,
            resolution_m=self.resolution_m,
        )

    def _others(self, layout: Layout, n: int, receivers: str | Crowd, *, interval_s: float, seed: int) -> list[pd.DataFrame]:
        """Traces of the other carriageway, driven against the stations."""
        bare = Layout(alignment=layout.alignment, length=layout.length, lanes=layout.lanes, width=layout.width)
        left = layout.lanes * layout.width
        tables = []
        for number in range(100_000, 100_000 + round(self.other_direction * n)):
            one = drive(bare, self.traffic, seed=seed, number=number)
            t, s, d = one.t - 15.0 * 100_000, layout.length - one.s, 2 * left + OTHER_CARRIAGEWAY_M - one.d
            tables.append(_table(Drive(t=t, s=s, d=d), layout, number, receivers, interval_s=interval_s, seed=seed))
        return tables


def _plan_of_faults(n: int, faults: tuple[str, ...]) -> dict[int, str]:
    """Which vehicle has which fault: spread over the crowd, from the second one on."""
    wanted = [part for fault in faults for part in (["truck"] * int(fault[-1]) if fault.startswith("truck") else [fault])]
    return {min(1 + 3 * k, n - 1 - k): fault for k, fault in enumerate(wanted)}


def _table(driven: Drive, layout: Layout, number: int, receivers: str | Crowd, *, interval_s: float, seed: int) -> pd.DataFrame:
    receiver = receiver_of(receivers, seed=seed, number=number)
    fixes = reported(driven, layout, receiver, interval_s=interval_s, seed=seed, number=number)
    columns = dict(zip(("time_s", "x_m", "y_m"), fixes.T, strict=True))
    return pd.DataFrame({"vehicle_id": f"v{number:05d}", **columns, "position_sd_m": receiver.error})


KINDS: dict[str, Kind] = {name: Kind(name=name, layout=layout) for name, layout in LAYOUTS.items()}
KINDS["both_directions"] = Kind(name="both_directions", layout=LAYOUTS["left"], other_direction=0.6)
KINDS["no_changes"] = Kind(name="no_changes", layout=LAYOUTS["none"], traffic=Traffic(changes_per_km=0.0))
KINDS["short_trips"] = Kind(name="short_trips", layout=LAYOUTS["left"], traffic=Traffic(partial_share=0.6))
KINDS["slow"] = Kind(name="slow", layout=LAYOUTS["left"], traffic=Traffic(speed_factor=0.33))
KINDS["lanes_80_20"] = Kind(name="lanes_80_20", layout=LAYOUTS["left"], traffic=Traffic(lane_evenness=0.8))
KINDS["long"] = Kind(name="long", layout=LAYOUTS["long"], resolution_m=0.508)
