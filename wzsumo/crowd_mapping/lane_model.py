"""LaneStructure: a model of the open lanes and of the lanes that end, as a value that further traces update.

`fit_lane_structure` makes it from traces, `update` gives the next one, `fit_of` scores a trace by it.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
import pandas as pd
from pydantic import Field

from wzsumo.crowd_mapping.common_path import CommonPath, departures, extend, fit_common_path, lanes_along
from wzsumo.crowd_mapping.kinks import Shift, find_shifts
from wzsumo.crowd_mapping.lane_ends import LaneEnds, fit_lane_ends
from wzsumo.crowd_mapping.lane_levels import LaneLevels, fit_lane_levels, refresh
from wzsumo.crowd_mapping.lane_use import LaneUse, fit_lane_use
from wzsumo.crowd_mapping.map_before import WIDTH_SD_M, Anchor, MapBefore, anchored, lanes_that_close, with_level_ends
from wzsumo.crowd_mapping.reference_line import reference_line_from_traces
from wzsumo.crowd_mapping.station_table import StationTable, tabulate
from wzsumo.crowd_mapping.turning_errors import turning_of
from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray
from wzsumo.road import Road
from wzsumo.spec import Spec
from wzsumo.tables import check_traces
from wzsumo.units import mps_from_mph

DEFAULT_SPEED_MPS = 26.8  # 60 mph, where neither the posted speed nor the traces' own says more
SPEED_SPELL_S = 3.0
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
    before: MapBefore | None  # the road before the zone, where it is known: `axis` is its line then
    table: StationTable
    weights: FloatArray  # (traces,) 1 for a fresh trace, less for one that fades
    speed_mps: float
    path: CommonPath
    levels: LaneLevels
    shifts: tuple[Shift, ...]
    ends: LaneEnds  # of the lanes beside those that go through
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


def fit_lane_structure(
    traces: pd.DataFrame, *, spec: LaneStructureSpec, nominal: Road | None = None, before: MapBefore | None = None
) -> LaneStructure:
    """The model of a trace table. Raises TraceError where no trace can be used.

    `before` says what is known of the road and of where the zone is announced; `nominal` is the road's line alone.
    """
    checked = check_traces(traces, source="traces")
    axis = before.road if before else nominal or reference_line_from_traces(checked)
    table = tabulate(checked, axis)
    weights = np.ones(len(table.offsets))
    path = _path(table, weights, turning_of(axis, table.stations), spec=spec, before=before)
    basis = _Basis(
        spec=spec, axis=axis, before=before, table=table, weights=weights, speed_mps=_speed(checked, spec), path=path
    )
    return _model(basis)


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
    lanes = np.vstack([model.path.lanes[alive], lanes_along(model.path, new.offsets, width=width)])
    path = extend(model.path, table.offsets, lanes, width=width, weights=weights)
    basis = replace(_basis_of(model), table=table, weights=weights, path=path)
    likely = [(one.chance, refresh(one.levels, path, weights=weights)) for one in (model, *model.alternatives)]
    return _of_likeliest(basis, likely, shifts=model.shifts)


def refit(model: LaneStructure) -> LaneStructure:
    """The model fitted anew, from lane changes to tapers, to the traces and weights that it holds."""
    path = _path(model.table, model.weights, model.path.turning, spec=model.spec, before=model.before)
    return _model(replace(_basis_of(model), path=path))


def fit_of(model: LaneStructure, trace: pd.DataFrame) -> TraceFit:
    """How one vehicle's trace fits the model, in whichever lanes it drove."""
    row = tabulate(check_traces(trace, source="trace"), model.axis, stations=model.table.stations).offsets[:1]
    outer = model.levels.outer_width
    rest = departures(model.path, row, lanes_along(model.path, row, width=outer), width=outer)[0]
    rest = rest[np.isfinite(rest)]
    width, levels = model.levels.width, model.levels
    level = float(np.median(rest)) - levels.right
    shift = level - width * np.clip(np.rint(level / width), 0, levels.n_lanes - 1)
    within = rest - np.median(rest)
    # Half of a random walk's variance over the trace stays about its own middle.
    variance = model.path.noise_m**2 + model.path.drift_m**2 * len(rest) / 6
    square = float((within**2).mean() / variance * (len(rest) - 1) + (shift / levels.spread) ** 2) / len(rest)
    return TraceFit(mean_square=square, shift_m=float(shift), n_stations=len(rest))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Basis:
    """What all lanes that the traces leave possible have in common."""

    spec: LaneStructureSpec
    axis: Road
    before: MapBefore | None
    table: StationTable
    weights: FloatArray
    speed_mps: float
    path: CommonPath


def _basis_of(model: LaneStructure) -> _Basis:
    return _Basis(**{field.name: getattr(model, field.name) for field in fields(_Basis)})


def _width(spec: LaneStructureSpec, before: MapBefore | None) -> tuple[float, float]:
    """Mean and standard deviation [m] of the lanes' width outside the zone, beforehand."""
    return (before.lane_width, WIDTH_SD_M) if before else (spec.lane_width_m, spec.lane_width_sd_m)


def _path(
    table: StationTable, weights: FloatArray, turning: FloatArray | None, *, spec: LaneStructureSpec, before: MapBefore | None
) -> CommonPath:
    path = fit_common_path(table.offsets, width=_width(spec, before)[0], weights=weights, turning=turning)
    return with_level_ends(path, table.stations, before) if before else path


def _model(basis: _Basis) -> LaneStructure:
    likely = fit_lane_levels(
        basis.path, width=_width(basis.spec, basis.before), weights=basis.weights, n_lanes=basis.spec.open_lanes
    )
    shifts = find_shifts(basis.table.stations, basis.path.course, speed_mps=basis.speed_mps)
    return _of_likeliest(basis, likely, shifts=tuple(shifts))


def _of_likeliest(basis: _Basis, likely: list[tuple[float, LaneLevels]], *, shifts: tuple[Shift, ...]) -> LaneStructure:
    """The model of the likeliest of (chance, levels), with the others as its alternatives."""
    anchors = [_anchor(basis, levels) for _, levels in likely]
    fits = np.array([anchor.log_fit for anchor in anchors])
    chances = np.array([chance for chance, _ in likely])
    if np.isfinite(fits).any():  # else no hypothesis fits the road before: the traces alone have to say
        chances = chances * np.exp(fits - fits.max())
    chances /= chances.sum()
    models = [
        _of_levels(basis, anchors[i], float(chances[i]), shifts=shifts)
        for i in np.argsort(-chances, kind="stable")
        if chances[i]
    ]
    return replace(models[0], alternatives=tuple(models[1:]))


def _anchor(basis: _Basis, levels: LaneLevels) -> Anchor:
    if basis.before is None:
        return Anchor(levels=levels, first_lane=None, log_fit=0.0)
    return anchored(levels, basis.path, basis.table, basis.before, basis.weights)


def _of_levels(basis: _Basis, anchor: Anchor, chance: float, *, shifts: tuple[Shift, ...]) -> LaneStructure:
    levels, vehicle_m = anchor.levels, basis.spec.vehicle_width_m
    before = basis.before if anchor.first_lane is not None else None
    ends = fit_lane_ends(
        basis.table, basis.weights, levels, lanes=lanes_that_close(levels, anchor, before) if before else levels.closed,
        announced=before.announced if before else None, shifts=shifts, speed_mps=basis.speed_mps,
        vehicle_width_m=vehicle_m,
    )  # fmt: skip
    return LaneStructure(
        **vars(basis), levels=levels, shifts=shifts, ends=ends, chance=chance, alternatives=(),
        use=fit_lane_use(basis.table, basis.weights, levels, half_vehicle_m=vehicle_m / 2),
    )  # fmt: skip


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
