from contextlib import nullcontext
from typing import Any, Literal

import numpy as np
import pandas as pd
import pytest
from builders import straight_traces

from wzsumo.case.crowd import (
    Crowd,
    collection_figures,
    free_witnessed_ground,
    linked_ground,
    reported_traces,
    sets_out_s,
    traces_over_zone,
    with_traces_at_hand,
    witness_reach_m,
    witnessed_ground,
)
from wzsumo.crowd_mapping.mixture.maps import MixtureSpec
from wzsumo.crowd_mapping.mixture.mixture import Mixture
from wzsumo.errors import SpecError
from wzsumo.frames import BoolArray
from wzsumo.grid import OccupancyGrid, blank_grid
from wzsumo.scenario.scenario import Scenario, load_scenario
from wzsumo.scenario.site import Site, prepare_site

PAPER = load_scenario("scenarios/paper.toml")
MIDDLE = 5.49  # m, centre of the lane of start and goal
REACH_M = 0.93 + 0.25  # half a vehicle and the scatter of drivers


@pytest.fixture(scope="module")
def cells() -> OccupancyGrid:
    site: Site = prepare_site(PAPER)
    return site.cells


def with_error(error_m: float) -> Scenario:
    return PAPER.model_copy(update={"gnss": PAPER.gnss.model_copy(update={"error_m": error_m})})


def width_of(ground: BoolArray, cells: OccupancyGrid) -> float:
    """Width [m] of the cells beside x = 500 m."""
    (_,), (col,) = cells.cell_of((500.0, MIDDLE))
    return float(ground[:, col].sum() * cells.resolution)


def test_ground_that_two_vehicles_drove_over_is_as_wide_as_they_have_in_common(cells: OccupancyGrid) -> None:
    traces = straight_traces([MIDDLE - 0.2, MIDDLE + 0.2], length_m=1100.0)
    ground = witnessed_ground(cells, traces, reach_m=REACH_M)
    assert width_of(ground, cells) == pytest.approx(2 * REACH_M - 0.4, abs=cells.resolution)


def test_witnesses_of_half_a_metre_free_a_metre(cells: OccupancyGrid) -> None:
    ground = witnessed_ground(cells, straight_traces([MIDDLE, MIDDLE], length_m=1100.0), reach_m=0.5)
    assert width_of(ground, cells) == pytest.approx(1.0, abs=cells.resolution)


def test_ground_that_one_vehicle_drove_over_is_not_known_to_be_free(cells: OccupancyGrid) -> None:
    alone = straight_traces([MIDDLE], length_m=1100.0)
    assert not witnessed_ground(cells, alone, reach_m=REACH_M).any()
    assert witnessed_ground(cells, pd.concat([alone, alone.assign(vehicle_id="b")]), reach_m=REACH_M).any()


def two_stretches(gap_m: float, *, y: float = MIDDLE) -> Mixture:
    """From 400 m on for 100 m in the middle of a lane, and for 60 m after a gap; 2 sqrt(3) standard deviations long."""
    lengths = np.array([100.0, 60.0])
    middles = np.array([450.0, 500.0 + gap_m + 30.0])
    return Mixture(
        weights=np.array([0.6, 0.4]), means=np.column_stack([middles, [MIDDLE, y]]),
        covariances=np.array([np.diag([length**2 / 12, 0.01]) for length in lengths]),
        log_likelihood=0.0, n_points=100, converged=True,
    )  # fmt: skip


def links(gap_m: float, traces: pd.DataFrame, cells: OccupancyGrid, *, y: float = MIDDLE) -> BoolArray:
    crowd = Crowd(traces=traces, road=prepare_site(PAPER).layout.road, spec=MixtureSpec(), seed=1)
    vars(crowd)["mixture"] = two_stretches(gap_m, y=y)  # what is fitted when it is first asked for
    return linked_ground(cells, crowd, half_width_m=0.93)


@pytest.mark.parametrize("gap_m", [4.0, 25.0, 55.0])
def test_gap_between_stretches_is_linked_where_one_vehicle_drove_from_one_to_the_next(
    gap_m: float, cells: OccupancyGrid
) -> None:
    ground = links(gap_m, straight_traces([MIDDLE + 0.3], length_m=1100.0), cells)
    rows, columns = np.nonzero(ground)
    x, y = columns * cells.resolution + cells.origin[0], rows * cells.resolution + cells.origin[1]
    half = 0.93 + 0.612  # of a vehicle, and 2.448 standard deviations of 0.25 m
    assert (x.min(), x.max()) == pytest.approx((500.0 - half, 500.0 + gap_m + half), abs=2 * cells.resolution)
    assert (y.min(), y.max()) == pytest.approx((MIDDLE - half, MIDDLE + half), abs=2 * cells.resolution)


def test_gap_that_the_vehicle_passed_on_another_way_is_not_linked(cells: OccupancyGrid) -> None:
    trace = straight_traces([MIDDLE], length_m=1100.0)
    aside = np.interp(trace["x_m"], [505.0, 512.0, 520.0], [0.0, 1.0, 0.0])
    assert not links(25.0, trace.assign(y_m=trace["y_m"] + aside), cells).any()


@pytest.mark.parametrize(
    ("gap_m", "offset_m", "y"),
    [(70.0, 0.0, MIDDLE), (25.0, 1.0, MIDDLE), (25.0, 0.0, MIDDLE - 3.66), (-10.0, 0.0, MIDDLE)],
    ids=["longer than the next stretch", "nobody drove there", "another lane", "no gap"],
)
def test_stretches_are_not_linked(gap_m: float, offset_m: float, y: float, cells: OccupancyGrid) -> None:
    assert not links(gap_m, straight_traces([MIDDLE + offset_m], length_m=1100.0), cells, y=y).any()


def test_link_never_leaves_the_lines_that_vehicles_drove(cells: OccupancyGrid) -> None:
    """Stretches along a shift by 3.6 m: from before it to after it a straight link would be over ground of its own."""
    traces = straight_traces([0.0], length_m=1100.0)
    shifted = np.interp(traces["x_m"], [500.0, 560.0], [MIDDLE, MIDDLE - 3.6])
    begins, ends, offsets = np.array([380.0, 640.0]), np.array([499.0, 760.0]), np.array([MIDDLE, MIDDLE - 3.6])
    crowd = Crowd(
        traces=traces.assign(y_m=shifted), road=prepare_site(PAPER).layout.road, spec=MixtureSpec(), seed=1
    )  # the gap of 141 m is longer than both; one of 61 m is not
    for gap_shortened_by in (0.0, 80.0):
        vars(crowd)["mixture"] = Mixture(
            weights=np.full(2, 0.5), means=np.column_stack([(begins - [0, gap_shortened_by] + ends) / 2, offsets]),
            covariances=np.array([
                np.diag([length**2 / 12, 0.01]) for length in ends - begins + np.array([0, gap_shortened_by])
            ]),
            log_likelihood=0.0, n_points=100, converged=True,
        )  # fmt: skip
        ground = linked_ground(cells, crowd, half_width_m=0.93)
        x, y = cells.centre_of(*np.nonzero(ground)).T
        assert (np.abs(y - np.interp(x, [500.0, 560.0], [MIDDLE, MIDDLE - 3.6])) < 0.93 + 2 * 0.612).all()


def test_stretches_are_not_linked_by_two_vehicles_of_which_none_drove_from_one_to_the_next(cells: OccupancyGrid) -> None:
    both = straight_traces([MIDDLE, MIDDLE], length_m=1100.0)
    first = (both["vehicle_id"] == "v000") & (both["x_m"] < 510.0)
    second = (both["vehicle_id"] == "v001") & (both["x_m"] > 510.0)
    assert not links(25.0, both[first | second], cells).any()


def test_vehicle_that_waits_witnesses_no_more_ground_than_one_that_drives_by(cells: OccupancyGrid) -> None:
    # Two minutes at a stop line: 1,200 fixes that scatter by 0.1 m.
    driven = straight_traces([MIDDLE, MIDDLE], length_m=1100.0).sort_values(["vehicle_id", "x_m"], ignore_index=True)
    driven["time_s"] = driven["x_m"] / 10.0
    rng, waiting = np.random.default_rng(1), []
    for name in driven["vehicle_id"].unique():
        x, y = 600.0 + rng.normal(0, 0.1, 1200), MIDDLE + rng.normal(0, 0.1, 1200)
        waiting.append(pd.DataFrame({"vehicle_id": name, "time_s": 60.0 + np.arange(1200) * 1e-6, "x_m": x, "y_m": y}))
    waited = pd.concat([driven, *waiting], ignore_index=True)
    ground, more = (witnessed_ground(cells, traces, reach_m=0.5) for traces in (driven, waited))
    assert (ground != more).sum() <= 2 * round(0.5 / cells.resolution)  # of the one fix that is kept, 0.5 m of the way


def test_reach_of_a_witness_shrinks_by_two_standard_deviations_of_the_position_to_nothing() -> None:
    assert witness_reach_m(PAPER) == pytest.approx(1.18)  # half of 1.86 m, and the 0.25 m by which drivers scatter
    assert witness_reach_m(with_error(0.3)) == pytest.approx(1.18 - 2 * 0.3)
    assert witness_reach_m(with_error(1.0)) < 0


def test_map_that_doubts_ground_which_the_crowd_drove_over_has_it_free(cells: OccupancyGrid) -> None:
    doubtful = cells.with_p_occupied(np.full(cells.shape, 0.3))
    traces = straight_traces([MIDDLE, MIDDLE], length_m=1100.0)
    freed = free_witnessed_ground(doubtful, traces, reach_m=REACH_M)
    assert width_of(freed.free, cells) == pytest.approx(2 * REACH_M, abs=cells.resolution)
    assert free_witnessed_ground(doubtful, traces, reach_m=-0.8).p_occupied.min() == pytest.approx(0.3)


def test_minutes_to_collect_run_from_the_first_vehicle_to_the_last_of_those_that_are_used() -> None:
    trace = straight_traces([MIDDLE], length_m=1100.0)
    traces = pd.concat([trace.assign(vehicle_id=f"v{n}", time_s=trace["time_s"] + 60 * n) for n in range(5)])
    scenario = PAPER.model_copy(update={"crowd": PAPER.crowd.model_copy(update={"penetration": 1.0, "used": 4})})
    assert collection_figures(traces, scenario) == {"n_equipped": 5, "minutes_to_collect": pytest.approx(3.0)}
    more = PAPER.model_copy(update={"crowd": PAPER.crowd.model_copy(update={"penetration": 1.0, "used": 6})})
    with pytest.raises(SpecError, match=r"crowd\.used"):
        collection_figures(traces, more)


@pytest.mark.parametrize("k_max", [1, 2])
def test_share_of_the_work_that_is_learned_ends_at_one(k_max: int) -> None:
    shares: list[float] = []
    road = PAPER.layout().road
    _ = Crowd(
        traces=straight_traces([MIDDLE]),
        road=road,
        spec=MixtureSpec(k_max=k_max),
        seed=1,
        fitting=lambda: nullcontext(shares.append),
    ).sweep
    assert shares[-1] == 1.0


@pytest.mark.parametrize(
    ("start_ft", "first_m"),
    [(3000, 3000 * 0.3048 - 805), (1500, 0)],  # TA-33's half a mile; all of the road, where it begins nearer
)
def test_traces_begin_half_a_mile_ahead_and_are_those_of_vehicles_that_passed_the_zone_whole(
    start_ft: float, first_m: float
) -> None:
    content = PAPER.model_dump()
    content["work_zone"] |= {"start_ft": start_ft}
    content["road"] |= {"length_ft": 8000}
    layout = Scenario.model_validate(content).layout()
    whole = straight_traces([MIDDLE], length_m=layout.road.length, step_m=1.0)
    half = whole[whole["x_m"] < 1000].assign(vehicle_id="half")
    traces = traces_over_zone(pd.concat([whole, half], ignore_index=True), layout)
    assert set(traces["vehicle_id"]) == {"v000"}
    assert traces["x_m"].min() == pytest.approx(first_m, abs=1.0)
    assert traces["x_m"].max() == pytest.approx(layout.end + 50, abs=1.0)
    assert list(traces.index) == list(range(len(traces)))


@pytest.mark.parametrize(("which", "n"), [("collected", 4), ("used", 2)])
def test_reports_are_of_so_many_vehicles_as_are_collected_or_used(which: Literal["collected", "used"], n: int) -> None:
    crowd = PAPER.crowd.model_copy(update={"penetration": 1.0, "collected": 4, "used": 2})
    scenario = PAPER.model_copy(update={"crowd": crowd})
    over_zone = straight_traces(np.full(6, MIDDLE), length_m=1100.0)
    reported = reported_traces(over_zone, scenario, which=which)
    assert reported["vehicle_id"].nunique() == n
    few = over_zone[over_zone["vehicle_id"] == "v000"]
    with pytest.raises(SpecError, match=rf"crowd\.{which}={n} asks for more"):
        reported_traces(few, scenario, which=which)


def test_mixture_leaves_out_what_lies_ahead_of_its_first_station() -> None:
    traces, road = straight_traces([MIDDLE], length_m=400.0), PAPER.layout().road
    behind = traces[road.to_sd(traces[["x_m", "y_m"]])[0] >= 300.0]
    of_part = Crowd(traces=traces, road=road, spec=MixtureSpec(k_max=2), seed=1, mixed_from_m=300.0)
    of_rest = Crowd(traces=behind, road=road, spec=MixtureSpec(k_max=2), seed=1)
    pd.testing.assert_frame_equal(of_part.sweep.table, of_rest.sweep.table)


@pytest.mark.parametrize("criterion", ["aic", "bic"])
def test_mixture_is_the_one_with_the_lowest_criterion_of_the_scenario(criterion: str) -> None:
    traces = straight_traces([1.83, MIDDLE], length_m=200.0)
    crowd = Crowd(traces=traces, road=PAPER.layout().road, spec=MixtureSpec(k_max=6, criterion=criterion), seed=1)
    table = crowd.sweep.table
    assert crowd.mixture.n_components == table["n_components"].iloc[int(table[criterion].to_numpy().argmin())]


def test_no_component_is_narrower_than_its_least_standard_deviation() -> None:
    traces = straight_traces([MIDDLE], length_m=200.0)  # all on one line
    for least_sd_m in (0.1, 0.4):
        crowd = Crowd(traces=traces, road=PAPER.layout().road, spec=MixtureSpec(k_max=2, least_sd_m=least_sd_m), seed=1)
        assert np.sqrt(crowd.mixture.covariances[:, 1, 1]) == pytest.approx(least_sd_m, rel=1e-3)


def test_copies_of_a_trace_scatter_as_drivers_do_and_widen_the_mixture() -> None:
    traces = straight_traces([MIDDLE], length_m=200.0)
    one, many = (
        Crowd(traces=traces, road=PAPER.layout().road, spec=MixtureSpec(k_max=2, copies=copies), seed=1).mixture
        for copies in (0, 20)
    )
    assert one.covariances[0, 1, 1] < 0.1**2 < many.covariances[:, 1, 1].max()


@pytest.mark.parametrize(("scale", "rises"), [(0.005, False), (0.05, True)])
def test_trace_is_simplified_by_a_centimetre_at_most(scale: float, rises: bool) -> None:
    """Two vehicles drive the same zigzag: the ground that they have in common is wider where the zigzag is kept."""
    fine = blank_grid((495.0, MIDDLE - 2, 505.0, MIDDLE + 2), resolution=0.005, p_occupied=1.0)
    zigzag = straight_traces([MIDDLE], length_m=1100.0)
    zigzag["y_m"] += np.where(np.arange(len(zigzag)) % 2, scale, -scale)
    traces = pd.concat([zigzag, zigzag.assign(vehicle_id="b")])
    ground = witnessed_ground(fine, traces, reach_m=REACH_M)
    rows = np.flatnonzero(ground.any(axis=1))
    height = (rows[-1] - rows[0] + 1) * 0.005
    assert (height > 2 * REACH_M + 0.05) == rises


def test_mixture_is_fitted_when_it_is_first_asked_for() -> None:
    crowd = Crowd(traces=straight_traces([MIDDLE]), road=PAPER.layout().road, spec=MixtureSpec(k_max=1), seed=1)
    assert not crowd.is_fitted
    assert crowd.mixture.n_components == 1
    assert crowd.is_fitted


def passing(**known: Any) -> tuple[pd.DataFrame, Scenario]:
    """Six vehicles that pass the zone one after the other, v005 first, 100 s apart; all are equipped, three are used."""
    traces = straight_traces(np.full(6, MIDDLE), length_m=1100.0)
    after = traces["vehicle_id"].map({f"v00{n}": 100.0 * (5 - n) for n in range(6)})
    crowd = PAPER.crowd.model_copy(update={"penetration": 1.0, "collected": 4, "used": 3} | known)
    return traces.assign(time_s=traces["time_s"] + after), PAPER.model_copy(update={"crowd": crowd})


def test_map_is_made_of_the_first_traces_to_leave_the_zone_and_the_ego_waits_for_them() -> None:
    traces, scenario = passing()
    assert set(reported_traces(traces, scenario, which="used")["vehicle_id"]) == {"v005", "v004", "v003"}
    # v003 sets out at 200 s and leaves after 1100 m at 20 m/s: 255 s. The warm-up of 120 s is over by then.
    assert sets_out_s(traces, scenario) == 255.0
    for used, expected in ((1, 120.0), (4, 355.0), (9, 120.0)):
        asked = scenario.model_copy(update={"crowd": scenario.crowd.model_copy(update={"used": used})})
        assert sets_out_s(traces, asked) == expected


def test_traces_of_the_whole_run_are_drawn_by_the_seed_and_not_waited_for() -> None:
    traces, scenario = passing(known="any")
    drawn = [
        set(reported_traces(traces, scenario.model_copy(update={"seed": seed}), which="used")["vehicle_id"])
        for seed in range(8)
    ]
    assert len({frozenset(ids) for ids in drawn}) > 1
    assert sets_out_s(traces, scenario) == 120.0


def test_case_takes_the_traces_that_there_are_where_it_asks_for_more() -> None:
    over_zone, scenario = passing()
    n = over_zone["vehicle_id"].nunique()
    crowd = {"penetration": 1.0, "collected": n + 10, "used": n - 1}
    asked = scenario.model_copy(update={"crowd": scenario.crowd.model_copy(update=crowd)})
    taken, said = with_traces_at_hand(asked, over_zone)
    assert (taken.crowd.collected, taken.crowd.used) == (n, n - 1)
    assert said == [f"crowd.collected={n + 10}: {n} equipped vehicles passed the zone, whose {n} traces were taken"]
    assert reported_traces(over_zone, taken, which="collected")["vehicle_id"].nunique() == n
    enough = asked.model_copy(update={"crowd": asked.crowd.model_copy(update={"collected": n})})
    assert with_traces_at_hand(enough, over_zone) == (enough, [])


def test_case_without_any_equipped_vehicle_is_refused() -> None:
    over_zone, scenario = passing()
    nobody = scenario.model_copy(update={"crowd": scenario.crowd.model_copy(update={"penetration": 1e-12})})
    with pytest.raises(SpecError, match=r"crowd.collected=4 .* 0 equipped vehicles .* raise crowd.penetration"):
        with_traces_at_hand(nobody, over_zone)
