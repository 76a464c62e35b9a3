"""LaneStructures from traces: `fit_lane_structure` makes one, `update` the next one of further traces, `refit` looks anew."""

from dataclasses import fields, replace

import numpy as np
import pandas as pd

from wzsumo.crowd_mapping.closing.lane_ends import fit_lane_ends
from wzsumo.crowd_mapping.closing.lane_use import fit_lane_use
from wzsumo.crowd_mapping.closing.map_before import WIDTH_SD_M, Anchor, MapBefore, anchored, lanes_that_close, with_level_ends
from wzsumo.crowd_mapping.course.common_path import CommonPath, extend_path, lanes_along
from wzsumo.crowd_mapping.course.gnss_bias import bias_effect_along
from wzsumo.crowd_mapping.course.path_fit import STRADDLING, fit_common_path, straddling_traces
from wzsumo.crowd_mapping.course.reference_line import reference_line_from_traces
from wzsumo.crowd_mapping.course.shifts import Shift, find_shifts
from wzsumo.crowd_mapping.course.station_table import StationTable, percentile_85_speed, tabulate
from wzsumo.crowd_mapping.hypotheses.closures import ClosurePrior
from wzsumo.crowd_mapping.hypotheses.lane_levels import LaneLevels, fit_lane_levels, refresh
from wzsumo.crowd_mapping.lane_model import LaneStructure, LaneStructureSpec, TraceBasis
from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray
from wzsumo.tables import check_traces
from wzsumo.tapers import merging_taper_m
from wzsumo.units import mps_from_mph

FADED = 0.01  # weight below which an old trace is dropped


def fit_lane_structure(traces: pd.DataFrame, *, spec: LaneStructureSpec, before: MapBefore | None = None) -> LaneStructure:
    """The model of a trace table. Raises TraceError where no trace can be used.

    `before` says what is known of the road and of where the zone is announced.
    """
    checked = check_traces(traces, source="traces")
    axis = before.road if before else reference_line_from_traces(checked)
    table = tabulate(checked, axis)
    weights = np.ones(len(table.offsets))
    bias_effect = bias_effect_along(axis, table.stations)
    path = _path(table, weights, bias_effect, spec=spec, before=before)
    if (odd := straddling_traces(path, table.offsets, width=_width(spec, before)[0])).any():
        table, weights = table.without(odd, reason=STRADDLING), weights[~odd]
        path = _path(table, weights, bias_effect, spec=spec, before=before)
    basis = TraceBasis(
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
    known = model.path
    added, _ = lanes_along(known.course, new.offsets, width=width, errors=known.errors, bias_effect=known.bias_effect)
    path = extend_path(known, table.offsets, np.vstack([known.lanes[alive], added]), width=width, weights=weights)
    odd = straddling_traces(path, table.offsets, width=width)
    odd[: alive.sum()] = False  # they have been looked at
    if odd.any():
        table, weights = table.without(odd, reason=STRADDLING), weights[~odd]
        path = replace(path, lanes=path.lanes[~odd], levels=path.levels[~odd])
    basis = replace(_basis_of(model), table=table, weights=weights, path=path)
    likely = [(one.chance, refresh(one.levels, path, weights=weights)) for one in (model, *model.alternatives)]
    return _of_likeliest(basis, likely, shifts=model.shifts)


def refit(model: LaneStructure) -> LaneStructure:
    """The model fitted anew, from lane changes to tapers, to the traces and weights that it holds."""
    path = _path(model.table, model.weights, model.path.bias_effect, spec=model.spec, before=model.before)
    return _model(replace(_basis_of(model), path=path))


def _speed(traces: pd.DataFrame, spec: LaneStructureSpec) -> float:
    """The speed [m/s] that decides how long tapers are: the posted one where it is known."""
    return percentile_85_speed(traces) if spec.posted_speed_mph is None else mps_from_mph(spec.posted_speed_mph)


def _basis_of(model: LaneStructure) -> TraceBasis:
    return TraceBasis(**{field.name: getattr(model, field.name) for field in fields(TraceBasis)})


def _width(spec: LaneStructureSpec, before: MapBefore | None) -> tuple[float, float]:
    """Mean and standard deviation [m] of the lanes' width outside the zone, beforehand."""
    return (before.lane_width, WIDTH_SD_M) if before else (spec.lane_width_m, spec.lane_width_sd_m)


def _path(
    table: StationTable,
    weights: FloatArray,
    bias_effect: FloatArray | None,
    *,
    spec: LaneStructureSpec,
    before: MapBefore | None,
) -> CommonPath:
    path = fit_common_path(table.offsets, width=_width(spec, before)[0], weights=weights, bias_effect=bias_effect)
    return with_level_ends(path, table.stations, before) if before else path


def _model(basis: TraceBasis) -> LaneStructure:
    width = _width(basis.spec, basis.before)
    closure = ClosurePrior(
        stations=basis.table.stations,
        announced=basis.before.announced if basis.before else None,
        merging_m=merging_taper_m(basis.speed_mps, width_m=width[0]),
    )
    likely = fit_lane_levels(basis.path, width=width, weights=basis.weights, closure=closure, n_lanes=basis.spec.open_lanes)
    shifts = find_shifts(basis.table.stations, basis.path.course, speed_mps=basis.speed_mps)
    return _of_likeliest(basis, likely, shifts=tuple(shifts))


def _of_likeliest(basis: TraceBasis, likely: list[tuple[float, LaneLevels]], *, shifts: tuple[Shift, ...]) -> LaneStructure:
    """The model of the likeliest of (chance, levels), with the others as its alternatives."""
    anchors = [_anchor(basis, levels, shifts) for _, levels in likely]
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


def _anchor(basis: TraceBasis, levels: LaneLevels, shifts: tuple[Shift, ...]) -> Anchor:
    if basis.before is None:
        return Anchor(levels=levels, first_lane=None, log_fit=0.0)
    return anchored(levels, basis.path, basis.table, basis.before, weights=basis.weights, shifts=shifts)


def _of_levels(basis: TraceBasis, anchor: Anchor, chance: float, *, shifts: tuple[Shift, ...]) -> LaneStructure:
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
