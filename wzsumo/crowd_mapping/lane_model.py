"""LaneStructure: a model of the open lanes and of the lanes that end, as a value that further traces update.

`fit_lane_structure` makes it from traces, `update` gives the next one, `fit_of` scores a trace by it.
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from pydantic import Field

from wzsumo.crowd_mapping.common_path import CommonPath, extend, fit_common_path
from wzsumo.crowd_mapping.kinks import Shift, find_shifts
from wzsumo.crowd_mapping.lane_changes import relative_lanes
from wzsumo.crowd_mapping.lane_levels import LaneLevels, fit_lane_levels, refresh
from wzsumo.crowd_mapping.lane_use import LaneUse, fit_lane_use
from wzsumo.crowd_mapping.reference_line import reference_line_from_traces
from wzsumo.crowd_mapping.station_table import StationTable, tabulate
from wzsumo.crowd_mapping.taper_line import TaperLine, fit_taper_line, merging_taper_m
from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray
from wzsumo.road import Road
from wzsumo.spec import Spec
from wzsumo.tables import check_traces
from wzsumo.units import mps_from_mph

DOWNSTREAM_TAPER_M = 30.48  # per lane; MUTCD 11th ed., Table 6B-3: 50 to 100 ft
DEFAULT_SPEED_MPS = 26.8  # 60 mph, where neither the posted speed nor the traces' own says more
SPEED_SPELL_S = 3.0
LEAST_USERS = 0.6  # traces in a lane that is said to end
LEAST_RETURNING = 0.08  # share of the traces in a lane that is said to open again: at 2 m error up to 5 % seem to by mistake
SLACK_STATIONS = 3  # of a trace in a closed lane: where it closes is known to about so many
KINK_SLACK_M = 30.0  # of a kink beside the last lane change: three stations
FADED = 0.01  # weight below which an old trace is dropped


class LaneStructureSpec(Spec):
    """What is known beforehand of the lanes. Everything may be left out."""

    posted_speed_mph: float | None = Field(None, ge=20, le=75)  # decides the tapers' length; None: from the traces' speeds
    open_lanes: int | None = Field(None, ge=1, le=4)
    lane_width_m: float = Field(3.6, gt=2.4, lt=5)  # 12 ft on freeways (AASHTO Green Book), down to 10 in zones (MUTCD 6G)
    lane_width_sd_m: float = Field(0.12, gt=0, le=0.5)  # covers 11 and 12 ft within two of them
    vehicle_width_m: float = Field(1.86, gt=1, lt=3)  # see VehicleGeometry


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneStructure:
    """A fitted model of the open lanes; stations and offsets in the frame of `axis`."""

    spec: LaneStructureSpec
    axis: Road
    table: StationTable
    weights: FloatArray  # (traces,) 1 for a fresh trace, less for one that fades
    speed_mps: float
    path: CommonPath
    levels: LaneLevels
    shifts: tuple[Shift, ...]
    closing: dict[int, TaperLine]  # by lane as counted in `levels`: where it ends
    opening: dict[int, TaperLine]  # where it begins again, stations counted against the direction of travel
    use: LaneUse  # of the lanes that go through
    chance: float  # that the lanes are these
    alternatives: tuple["LaneStructure", ...]  # other lanes that the same traces may have driven in, less likely

    @property
    def closed_side(self) -> str | None:
        """The side that is closed, "left" or "right", as the traffic shows it; None where nobody came from a closed lane."""
        return None if not self.levels.closed else ("left" if self.levels.closed[0] > 0 else "right")


@dataclass(frozen=True, kw_only=True)
class TraceFit:
    """How a trace fits the model: mean square of its normalised departures (1 is usual) and its sideways shift [m]."""

    mean_square: float
    shift_m: float
    n_stations: int


def fit_lane_structure(traces: pd.DataFrame, *, spec: LaneStructureSpec, nominal: Road | None = None) -> LaneStructure:
    """The model of a trace table. Raises TraceError where no trace can be used."""
    checked = check_traces(traces, source="traces")
    axis = nominal or reference_line_from_traces(checked)
    table = tabulate(checked, axis)
    weights = np.ones(len(table.offsets))
    path = fit_common_path(table.offsets, width=spec.lane_width_m, weights=weights)
    return _model(spec, axis, table, weights, path, speed_mps=_speed(checked, spec))


def update(model: LaneStructure, traces: pd.DataFrame, *, keep: float) -> LaneStructure:
    """The model with further traces, its old ones weighing `keep` (0 to 1) of what they did.

    Quick: axis, stations, number of lanes, their width and the shifts stay as they are; `refit` looks for those again.
    """
    if not 0 <= keep <= 1:
        raise TraceError(f"keep={keep} of the old traces' weight must be between 0 (forget them) and 1 (keep them)")
    new = tabulate(check_traces(traces, source="traces"), model.axis, stations=model.table.stations)
    alive = model.weights * keep > FADED
    table = replace(
        new,
        offsets=np.vstack([model.table.offsets[alive], new.offsets]),
        vehicle_ids=(*(v for v, a in zip(model.table.vehicle_ids, alive, strict=True) if a), *new.vehicle_ids),
    )
    weights = np.concatenate([model.weights[alive] * keep, np.ones(len(new.offsets))])
    width = model.levels.outer_width
    lanes = np.vstack([model.path.lanes[alive], _lanes_on(model.path, new.offsets, width=width)])
    path = extend(model.path, table.offsets, lanes, width=width, weights=weights)
    return _updated(model, table, weights, path)


def _updated(model: LaneStructure, table: StationTable, weights: FloatArray, path: CommonPath) -> LaneStructure:
    levels = refresh(model.levels, path, weights=weights)
    closing, opening = _tapers(model.spec, table, weights, levels, shifts=model.shifts, speed_mps=model.speed_mps)
    alternatives = tuple(_updated(other, table, weights, path) for other in model.alternatives)
    return replace(
        model, table=table, weights=weights, path=path, levels=levels, closing=closing, opening=opening,
        use=_use(model.spec, table, weights, levels), alternatives=alternatives,
    )  # fmt: skip


def refit(model: LaneStructure) -> LaneStructure:
    """The model fitted anew, from lane changes to tapers, to the traces and weights that it holds."""
    path = fit_common_path(model.table.offsets, width=model.spec.lane_width_m, weights=model.weights)
    return _model(model.spec, model.axis, model.table, model.weights, path, speed_mps=model.speed_mps)


def fit_of(model: LaneStructure, trace: pd.DataFrame) -> TraceFit:
    """How one vehicle's trace fits the model, in whichever lanes it drove."""
    row = tabulate(check_traces(trace, source="trace"), model.axis, stations=model.table.stations).offsets[:1]
    lanes = _lanes_on(model.path, row, width=model.levels.outer_width)
    rest = (row - model.path.course - model.levels.outer_width * lanes)[0]
    rest = rest[np.isfinite(rest)]
    width, levels = model.levels.width, model.levels
    level = float(np.median(rest)) - levels.right
    shift = level - width * np.clip(np.rint(level / width), 0, levels.n_lanes - 1)
    within = rest - np.median(rest)
    # Half of a random walk's variance over the trace stays about its own middle.
    variance = model.path.noise_m**2 + model.path.drift_m**2 * len(rest) / 6
    square = float((within**2).mean() / variance * (len(rest) - 1) + (shift / levels.spread) ** 2) / len(rest)
    return TraceFit(mean_square=square, shift_m=float(shift), n_stations=len(rest))


def _model(
    spec: LaneStructureSpec, axis: Road, table: StationTable, weights: FloatArray, path: CommonPath, *, speed_mps: float
) -> LaneStructure:
    shifts = tuple(find_shifts(table.stations, path.course))
    models = []
    for chance, levels in fit_lane_levels(
        path, width=(spec.lane_width_m, spec.lane_width_sd_m), weights=weights, n_lanes=spec.open_lanes
    ):
        closing, opening = _tapers(spec, table, weights, levels, shifts=shifts, speed_mps=speed_mps)
        model = LaneStructure(
            spec=spec, axis=axis, table=table, weights=weights, speed_mps=speed_mps, path=path, levels=levels, shifts=shifts,
            closing=closing, opening=opening, use=_use(spec, table, weights, levels), chance=chance, alternatives=(),
        )  # fmt: skip
        models.append(model)
    return replace(models[0], alternatives=tuple(models[1:]))


def _use(spec: LaneStructureSpec, table: StationTable, weights: FloatArray, levels: LaneLevels) -> LaneUse:
    return fit_lane_use(table, weights, levels, half_vehicle_m=spec.vehicle_width_m / 2)


def _tapers(
    spec: LaneStructureSpec,
    table: StationTable,
    weights: FloatArray,
    levels: LaneLevels,
    *,
    shifts: tuple[Shift, ...],
    speed_mps: float,
) -> tuple[dict[int, TaperLine], dict[int, TaperLine]]:
    """Lines across the lanes that are closed at the core, where vehicles left them and where they took them again."""
    stations = table.stations
    length = merging_taper_m(speed_mps, width_m=levels.outer_width)
    half_vehicle = spec.vehicle_width_m / 2 / levels.outer_width
    core = stations[levels.core]
    whole = np.rint(levels.lanes).astype(int)
    # One who seems to drive where the lanes are closed was mistaken: such a trace says nothing of where they end.
    beyond = (whole >= levels.n_lanes) | (whole < 0)
    trusted = beyond[:, levels.closes : levels.opens].sum(axis=1) <= SLACK_STATIONS
    before, after = stations <= core, stations >= core
    closing: dict[int, TaperLine] = {}
    opening: dict[int, TaperLine] = {}
    for lane in levels.closed:
        side = 1 if lane > 0 else -1
        adjacent = lane in {-1, levels.n_lanes}
        # Share of this lane's width that a vehicle's centre still has to go to the middle of the next lane inwards.
        share = np.clip(side * (levels.lanes - lane) + 1.0, -1.0, 1.0)
        for shares, at, sign, found, taper in (
            (share[:, before], stations[before], 1, closing, length),
            (share[:, after], -stations[after], -1, opening, DOWNSTREAM_TAPER_M),
        ):
            using = trusted & (shares.max(axis=1, initial=-1.0) > 0.5)
            users = shares[using]
            least = LEAST_USERS * min(1.0, weights.sum()) if found is closing else LEAST_RETURNING * weights.sum()
            if weights[using].sum() <= least:
                continue
            # Shifts away from the closed side follow the last merge; shifts back come before the first return.
            last = float(at[(users > 0.05).any(axis=0)].max())
            kinks = [
                (abs(shift.size), sign * (shift.start if sign > 0 else shift.end))
                for shift in shifts
                if adjacent and shift.size * side * sign < 0 and (shift.start - core) * (shift.end - core) > 0
            ]
            kinks = [(size, kink) for size, kink in kinks if last - KINK_SLACK_M < kink < sign * core]
            found[lane] = fit_taper_line(
                at, users, length=taper, half_vehicle=half_vehicle, kink=max(kinks)[1] if kinks else None
            )
    return closing, opening


def _lanes_on(path: CommonPath, offsets: FloatArray, *, width: float) -> FloatArray:
    widths = np.full(offsets.shape[1], width)
    lanes, _ = relative_lanes(offsets - path.course, widths, drift_variance=path.drift_m**2, white_variance=path.noise_m**2)
    return lanes


def _speed(traces: pd.DataFrame, spec: LaneStructureSpec) -> float:
    """Posted speed [m/s], or the 85th percentile of the speeds that vehicles reach on their way (85th percentile of each).

    Source: MUTCD 11th ed., Table 6B-4: S is the posted speed or the off-peak 85th-percentile speed before the work.
    """
    if spec.posted_speed_mph is not None:
        return mps_from_mph(spec.posted_speed_mph)
    # Over some seconds the positions' noise adds little to the speed between them.
    spell = np.floor(traces["time_s"] / SPEED_SPELL_S).rename("spell")
    fixes = traces.groupby(["vehicle_id", spell])[["time_s", "x_m", "y_m"]].first()
    step = fixes.groupby(level="vehicle_id").diff()
    reached = (np.hypot(step["x_m"], step["y_m"]) / step["time_s"]).groupby(level="vehicle_id").quantile(0.85)
    moving = reached[np.isfinite(reached) & (reached > 3)]
    return float(moving.quantile(0.85)) if len(moving) else DEFAULT_SPEED_MPS
