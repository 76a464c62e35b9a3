"""Fits and observations by hand: what a module of lanes is told, without the modules before it."""

import numpy as np

from wzsumo.crowd_mapping.lanes.course import Course, CoursePrior
from wzsumo.crowd_mapping.lanes.fit import LaneFit, LaneSetting
from wzsumo.crowd_mapping.lanes.observations import Observations
from wzsumo.crowd_mapping.lanes.receivers import Receivers
from wzsumo.crowd_mapping.reference_line import axis_of
from wzsumo.frames import FloatArray

SPACING_M = 20.0
WIDTH_M = 3.6


def seen(
    offset: FloatArray, *, eta: FloatArray | float = 1.0, variance: float = 0.1, slowness: FloatArray | float = 0.05,
    spacing: float = SPACING_M,
) -> Observations:  # fmt: skip
    """Offsets (traces, stations) [m] beside the x axis."""
    n, m = offset.shape
    stations: FloatArray = np.arange(m, dtype=np.float64) * np.float64(spacing)
    return Observations(
        axis=axis_of(np.array([[0.0, 0.0], [stations[-1] + 1.0, 0.0]])), stations=stations,
        offset=np.asarray(offset, dtype=float),
        eta=np.broadcast_to(np.asarray(eta, dtype=float), (n, m)).copy(), variance=np.full((n, m), variance),
        speed=np.full(n, 20.0), slowness=np.broadcast_to(np.asarray(slowness, dtype=float), (n, m)).copy(),
        stated_sd=np.full(n, np.nan), ids=tuple(f"v{i}" for i in range(n)),
    )  # fmt: skip


def fit_of(
    in_lane: FloatArray, *, burst: FloatArray | None = None, sigma: FloatArray | float = 0.3, stray: FloatArray | float = 0.0
) -> LaneFit:
    """A fit with shares of lanes (traces, stations, lanes); lane k's middle is at k times 3.6 m. Each receiver is sure."""
    n, m, n_lanes = in_lane.shape
    sigmas = np.unique(np.broadcast_to(sigma, n))
    stray_share = np.broadcast_to(np.asarray(stray, dtype=float), n)
    share = (np.broadcast_to(sigma, n)[:, None] == sigmas).astype(float) * (1 - stray_share)[:, None]
    classes = np.column_stack([share, stray_share])
    known = np.full(m, 1e-9)
    course = Course(
        offset=np.zeros(m), sd=np.full(m, 0.1), shift=0.0, shift_sd=0.1, width=WIDTH_M, width_sd=0.02, log_prior=0.0
    )
    prior = CoursePrior(known=known, width=WIDTH_M, width_sd=0.1, spacing=SPACING_M)
    middle = in_lane @ np.arange(n_lanes, dtype=float)
    return LaneFit(
        setting=LaneSetting(n_lanes=n_lanes, base=0.0, prior=prior), course=course, in_lane=in_lane,
        position=np.stack([middle, middle**2], axis=-1), burst=np.zeros((n, m)) if burst is None else burst,
        class_share=classes,
        receivers=Receivers(sigma=np.r_[sigmas, 8.0], rho=np.full((n, len(sigmas) + 1), 0.9), stated=np.full(n, np.nan)),
        changes=np.zeros((n, n_lanes - 1, 2)), log_likelihood=np.zeros(n),
        log_posterior=0.0,
    )  # fmt: skip


def always_in(lanes: list[int], *, n_stations: int, n_lanes: int = 2) -> FloatArray:
    """Shares (traces, stations, lanes) of traces that each keep a lane."""
    in_lane = np.zeros((len(lanes), n_stations, n_lanes))
    for i, lane in enumerate(lanes):
        in_lane[i, :, lane] = 1.0
    return in_lane
