"""The channelizing devices of a zone: where each stands, written down from the manual's spacings."""

import numpy as np
import pytest
from builders import paper_layout, paper_road, paper_work_zone

from wzsumo.frames import FloatArray
from wzsumo.mutcd.layout import lay_out
from wzsumo.work_zone import DEVICE_COLUMNS, WorkZoneLayout

UNSHIFTED = {"shift_ft": 0, "shifted_lane_width_ft": None}
CONE_FT = 7 / 12  # radius


def stations_ft(layout: WorkZoneLayout) -> FloatArray:
    return (layout.devices["s_m"].to_numpy() - layout.start) / 0.3048


def offset_ft(layout: WorkZoneLayout, at_ft: float) -> float:
    """Lateral offset of the one device that stands so far from the zone's start."""
    (offset,) = layout.devices["d_m"].to_numpy()[np.abs(stations_ft(layout) - at_ft) < 0.01]
    return float(offset) / 0.3048


def test_devices_of_the_paper_zone_stand_at_the_manuals_spacings_one_at_each_joint() -> None:
    # 240 ft at 60 ft, 720 at 60, 360 at 120, 360 at 60, 570 at 114, 650 at 108.3, 360 at 60, 100 at 20 ft.
    gaps = [60] * 4 + [60] * 12 + [120] * 3 + [60] * 6 + [114] * 5 + [650 / 6] * 6 + [60] * 6 + [20] * 5
    layout = paper_layout()
    assert stations_ft(layout) == pytest.approx(np.cumsum([0, *gaps]))
    assert tuple(layout.devices.columns) == DEVICE_COLUMNS


@pytest.mark.parametrize(
    ("at_ft", "line_ft", "slope"),
    [
        (120, 42, 12 / 240),  # in the shoulder taper
        (1080, 24, 0),  # in the tangent
        (3260, 24, 12 / 100),  # where the shift back, 12 in 360 ft, meets the downstream taper: the steeper counts
        (3300, 24 + 4.8, 12 / 100),
    ],
)
def test_device_touches_its_line_from_the_closed_side(at_ft: float, line_ft: float, slope: float) -> None:
    assert offset_ft(paper_layout(), at_ft) == pytest.approx(line_ft + CONE_FT * np.hypot(1, slope), abs=1e-6)


def test_devices_of_a_closure_on_the_right_stand_right_of_the_line() -> None:
    layout = paper_layout(closed_lanes=(0,), closed_shoulder="right", **UNSHIFTED)
    assert offset_ft(layout, 1034) == pytest.approx(12 - CONE_FT)  # 200 + 720 ft, then 114 ft on in the buffer


def test_devices_of_an_interior_closure_line_both_sides_of_the_gore_but_for_its_tips() -> None:
    layout = lay_out(paper_work_zone(closed_lanes=(1,), **UNSHIFTED), paper_road())
    # Along the outer line 4 + 12 + 3 + 6 gaps; along each line of the gore 6 + 5 + 6 + 5 gaps without a device at either tip.
    assert len(layout.devices) == 26 + 2 * 21
    at, d = stations_ft(layout), layout.devices["d_m"].to_numpy() / 0.3048
    tips = [240 + 720 + 360, 240 + 720 + 360 + 360 + 570 + 650 + 100]
    for tip in tips:
        assert not ((np.abs(at - tip) < 0.01) & (d < 20)).any()
    beside_work = (at > 1700) & (at < 2800)
    assert set(np.round(d[beside_work], 4)) == {round(12 + CONE_FT, 4), round(24 - CONE_FT, 4)}


@pytest.mark.parametrize(("kind", "height_in", "radius_in"), [("cone_28in", 28, 7), ("cone_36in", 36, 7), ("drum", 36, 9)])
def test_device_has_the_size_of_its_kind(kind: str, height_in: float, radius_in: float) -> None:
    devices = paper_layout(device=kind).devices
    assert set(devices["kind"]) == {kind}
    assert devices["height_m"].to_numpy() / 0.0254 == pytest.approx(height_in)
    assert devices["radius_m"].to_numpy() / 0.0254 == pytest.approx(radius_in)
    assert (devices["length_m"] == 0).all()


def test_barrier_beside_the_work_is_laid_in_pieces_of_12_ft_6_in() -> None:
    layout = paper_layout(work_space_device="barrier")
    pieces = layout.devices[layout.devices["kind"] == "barrier"]
    from_start_ft = (pieces["s_m"].to_numpy() - layout.area("activity area").start) / 0.3048
    assert from_start_ft == pytest.approx(12.5 * (np.arange(52) + 0.5))  # 650 ft
    assert pieces["length_m"].to_numpy() / 0.3048 == pytest.approx(12.5)
    assert pieces["d_m"].to_numpy() / 0.3048 == pytest.approx(13)  # 2 ft wide, its face on the line at 12 ft
    assert pieces["height_m"].to_numpy() / 0.0254 == pytest.approx(32)
    assert pieces["heading_rad"].to_numpy() == pytest.approx(0)
    others = layout.devices[layout.devices["kind"] != "barrier"]
    assert not others["s_m"].between(layout.area("activity area").start + 1, layout.area("activity area").end - 1).any()


def test_other_device_beside_the_work_leaves_the_tapers_as_they_are() -> None:
    devices = paper_layout(work_space_device="drum").devices
    area = paper_layout().area("activity area")
    inside = devices["s_m"].between(area.start + 1, area.end + 1)
    assert set(devices["kind"][inside]) == {"drum"}
    assert set(devices["kind"][~inside]) == {"cone_36in"}


def test_devices_between_the_ends_of_a_gap_are_missing() -> None:
    at = stations_ft(paper_layout(device_gaps_ft=((299, 421), (959, 961))))
    assert not np.isclose(at[:, None], [300, 360, 420, 960], rtol=0, atol=0.01).any()
    assert np.isclose(at[:, None], [240, 480, 900, 1080], rtol=0, atol=0.01).any(axis=0).all()
