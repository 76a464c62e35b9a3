"""LaneStructures from traces: `fit_lane_structure` fits one, `update` adds traces to it quickly, `refit` fits it anew.

A fit goes through four steps. (1) A common path: the course that all traces share, and each trace's lane changes about it.
(2) Lane hypotheses: levels of the lanes, with their probabilities. (3) With a map before, each hypothesis is anchored to the
road's lanes, which also says how well it suits the road. (4) For each hypothesis, the ends and the use of its lanes.
"""

from dataclasses import fields, replace

import numpy as np
import pandas as pd

from wzsumo.crowd_mapping.closing.lane_ends import fit_lane_ends
from wzsumo.crowd_mapping.closing.lane_use import fit_lane_use
from wzsumo.crowd_mapping.closing.map_before import (
    STRIPED_WIDTH_SD_M,
    Anchor,
    MapBefore,
    anchor_levels,
    closing_lanes,
    course_in_one_lane,
)
from wzsumo.crowd_mapping.course.common_path import CommonPath, extend_path, lanes_along
from wzsumo.crowd_mapping.course.gnss_bias import bias_effect_along
from wzsumo.crowd_mapping.course.path_fit import STRADDLING, fit_common_path, straddling_traces
from wzsumo.crowd_mapping.course.reference_line import reference_line_from_traces
from wzsumo.crowd_mapping.course.shifts import Shift, find_shifts
from wzsumo.crowd_mapping.course.station_table import StationTable, percentile_85_speed, tabulate
from wzsumo.crowd_mapping.hypotheses.closures import ClosurePrior
from wzsumo.crowd_mapping.hypotheses.lane_levels import LaneLevels, fit_lane_levels, refit_levels
from wzsumo.crowd_mapping.lane_model import LaneStructure, LaneStructureSpec, TraceBasis
from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray
from wzsumo.tables import check_traces
from wzsumo.tapers import merging_taper_m
from wzsumo.units import mps_from_mph

MIN_TRACE_WEIGHT = 0.01  # below which an update drops an old trace


def fit_lane_structure(traces: pd.DataFrame, *, spec: LaneStructureSpec, before: MapBefore | None = None) -> LaneStructure:
    """The model of a trace table. Raises TraceError where no trace can be used.

    `before` is the road before the zone and where the zone is announced, where that is known.
    """
    checked = check_traces(traces, source="traces")
    axis = before.road if before else reference_line_from_traces(checked)
    table = tabulate(checked, axis)
    weights = np.ones(len(table.offsets))
    bias_effect = bias_effect_along(axis, table.stations)
    path = _fit_path(table, weights, bias_effect, spec=spec, before=before)
    if (straddling := straddling_traces(path, table.offsets, width=_width_prior(spec, before)[0])).any():
        table, weights = table.without(straddling, reason=STRADDLING), weights[~straddling]
        path = _fit_path(table, weights, bias_effect, spec=spec, before=before)
    basis = TraceBasis(
        spec=spec, axis=axis, before=before, table=table, weights=weights, speed_mps=_zone_speed(checked, spec), path=path
    )
    return _fit_structure(basis)


def update(model: LaneStructure, traces: pd.DataFrame, *, keep: float) -> LaneStructure:
    """The model with further traces; its old traces' weights are multiplied by `keep` (0 to 1).

    It takes milliseconds: axis, stations, patterns and width of the lanes, and the shifts stay as they are. `refit` looks for
    those again.
    """
    if not 0 <= keep <= 1:
        raise TraceError(f"keep={keep} of the old traces' weight must be between 0 (forget them) and 1 (keep them)")
    new = tabulate(check_traces(traces, source="traces"), model.axis, stations=model.table.stations)
    kept = model.weights * keep > MIN_TRACE_WEIGHT
    table = replace(
        new,
        offsets=np.vstack([model.table.offsets[kept], new.offsets]),
        vehicle_ids=(*(v for v, k in zip(model.table.vehicle_ids, kept, strict=True) if k), *new.vehicle_ids),
    )
    weights = np.concatenate([model.weights[kept] * keep, np.ones(len(new.offsets))])
    width = model.levels.outer_width
    known = model.path
    new_lanes, _ = lanes_along(known.course, new.offsets, width=width, errors=known.errors, bias_effect=known.bias_effect)
    path = extend_path(known, table.offsets, np.vstack([known.lanes[kept], new_lanes]), width=width, weights=weights)
    straddling = straddling_traces(path, table.offsets, width=width)
    straddling[: kept.sum()] = False  # the old traces have been checked
    if straddling.any():
        table, weights = table.without(straddling, reason=STRADDLING), weights[~straddling]
        path = replace(path, lanes=path.lanes[~straddling], levels=path.levels[~straddling])
    basis = replace(_basis_of(model), table=table, weights=weights, path=path)
    likely = [(one.chance, refit_levels(one.levels, path, weights=weights)) for one in (model, *model.alternatives)]
    return _weigh_hypotheses(basis, likely, shifts=model.shifts)


def refit(model: LaneStructure) -> LaneStructure:
    """The model fitted anew, from lane changes to tapers, to the traces and weights that it holds."""
    path = _fit_path(model.table, model.weights, model.path.bias_effect, spec=model.spec, before=model.before)
    return _fit_structure(replace(_basis_of(model), path=path))


def _basis_of(model: LaneStructure) -> TraceBasis:
    return TraceBasis(**{field.name: getattr(model, field.name) for field in fields(TraceBasis)})


def _zone_speed(traces: pd.DataFrame, spec: LaneStructureSpec) -> float:
    """The speed [m/s] that decides the tapers' lengths: the posted one where it is known."""
    return percentile_85_speed(traces) if spec.posted_speed_mph is None else mps_from_mph(spec.posted_speed_mph)


def _width_prior(spec: LaneStructureSpec, before: MapBefore | None) -> tuple[float, float]:
    """Mean and standard deviation [m] of the lanes' width outside the zone."""
    return (before.lane_width, STRIPED_WIDTH_SD_M) if before else (spec.lane_width_m, spec.lane_width_sd_m)


def _fit_path(
    table: StationTable,
    weights: FloatArray,
    bias_effect: FloatArray | None,
    *,
    spec: LaneStructureSpec,
    before: MapBefore | None,
) -> CommonPath:
    path = fit_common_path(table.offsets, width=_width_prior(spec, before)[0], weights=weights, bias_effect=bias_effect)
    return course_in_one_lane(path, table.stations, before) if before else path


def _fit_structure(basis: TraceBasis) -> LaneStructure:
    """The model of traces with their common path."""
    width = _width_prior(basis.spec, basis.before)
    closure_prior = ClosurePrior(
        stations=basis.table.stations,
        announced=basis.before.announced if basis.before else None,
        merging_length_m=merging_taper_m(basis.speed_mps, width_m=width[0]),
    )
    likely = fit_lane_levels(
        basis.path, width=width, weights=basis.weights, closure_prior=closure_prior, n_lanes=basis.spec.open_lanes
    )
    shifts = find_shifts(basis.table.stations, basis.path.course, speed_mps=basis.speed_mps)
    return _weigh_hypotheses(basis, likely, shifts=tuple(shifts))


def _weigh_hypotheses(basis: TraceBasis, likely: list[tuple[float, LaneLevels]], *, shifts: tuple[Shift, ...]) -> LaneStructure:
    """The model of the likeliest of (probability, levels), with the others as its alternatives.

    With a map before, each probability is multiplied by how well the hypothesis suits the road.
    """
    anchors = [_anchor(basis, levels, shifts) for _, levels in likely]
    fits = np.array([anchor.log_fit for anchor in anchors])
    chances = np.array([chance for chance, _ in likely])
    if np.isfinite(fits).any():  # otherwise no hypothesis fits on the road, and the traces alone decide
        chances = chances * np.exp(fits - fits.max())
    chances /= chances.sum()
    models = [
        _structure_of(basis, anchors[i], float(chances[i]), shifts=shifts)
        for i in np.argsort(-chances, kind="stable")
        if chances[i]
    ]
    return replace(models[0], alternatives=tuple(models[1:]))


def _anchor(basis: TraceBasis, levels: LaneLevels, shifts: tuple[Shift, ...]) -> Anchor:
    if basis.before is None:
        return Anchor(levels=levels, first_lane=None, log_fit=0.0)
    return anchor_levels(levels, basis.path, basis.table, basis.before, weights=basis.weights, shifts=shifts)


def _structure_of(basis: TraceBasis, anchor: Anchor, chance: float, *, shifts: tuple[Shift, ...]) -> LaneStructure:
    """The model of one hypothesis, with the ends and the use of its lanes."""
    levels, vehicle_m = anchor.levels, basis.spec.vehicle_width_m
    before = basis.before if anchor.first_lane is not None else None
    ends = fit_lane_ends(
        basis.table, basis.weights, levels, lanes=closing_lanes(anchor, before) if before else levels.closed,
        announced=before.announced if before else None, shifts=shifts, speed_mps=basis.speed_mps,
        vehicle_width_m=vehicle_m,
    )  # fmt: skip
    return LaneStructure(
        **vars(basis), levels=levels, shifts=shifts, ends=ends, chance=chance, alternatives=(),
        use=fit_lane_use(basis.table, basis.weights, levels, half_vehicle_m=vehicle_m / 2),
    )  # fmt: skip
