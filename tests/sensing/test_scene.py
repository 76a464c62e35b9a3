from collections.abc import Mapping

import numpy as np
import pandas as pd
import pytest
from builders import paper_layout
from pydantic import ValidationError
from sensing.roadside import LEVEL, SMOOTH, cone_line, straight_road

from wzsumo.errors import InputError
from wzsumo.frames import FloatArray
from wzsumo.sensing.scene import DeviceFaults, SceneSpec, road_scene, scene_of, with_vehicles


def rims(frustum: FloatArray, n: int = 200) -> FloatArray:
    """Points on both rims of a frustum."""
    axis = frustum[3:6]
    u = np.cross(axis, [1, 0, 0] if abs(axis[0]) < 0.9 else [0, 1, 0])
    u /= np.linalg.norm(u)
    turn = np.linspace(0, 2 * np.pi, n)[:, None]
    ring = np.cos(turn) * u + np.sin(turn) * np.cross(axis, u)
    return np.vstack([frustum[:3] + frustum[7] * ring, frustum[:3] + frustum[6] * axis + frustum[8] * ring])


def test_faulty_devices_are_missing_lying_and_tilted_in_their_shares() -> None:
    faults = DeviceFaults(missing_share=0.2, lying_share=0.3, tilted_share=0.1, tilt_deg=20, seed=4)
    spec = SceneSpec(ground=SMOOTH, faults=faults, pole_spacing_m=0)
    scene = road_scene(straight_road(9000), cone_line(2000), spec, seed=1)
    lean = np.degrees(np.arccos(scene.frusta[:, 5]))
    shares = [(scene.device_id == 0).mean(), (lean > 80).sum() / 2000, ((lean > 1) & (lean < 80)).sum() / 2000]
    np.testing.assert_allclose(shares, [0.2, 0.3, 0.1], atol=0.04)
    assert len(scene.kinds) == len(scene.frusta) == (scene.device_id > 0).sum()


def test_of_a_sparse_set_up_every_nth_device_stands() -> None:
    spec = SceneSpec(ground=SMOOTH, faults=DeviceFaults(set_up_every=3), pole_spacing_m=0)
    there = road_scene(straight_road(), cone_line(10), spec, seed=1).device_id > 0
    assert there.tolist() == [True, False, False] * 3 + [True]


@pytest.mark.parametrize("fault", [{}, {"lying_share": 1.0}, {"tilted_share": 1.0, "tilt_deg": 30}])
def test_every_device_touches_level_ground_without_sinking_in(fault: Mapping[str, float]) -> None:
    spec = SceneSpec(ground=LEVEL, faults=DeviceFaults.model_validate(fault), pole_spacing_m=0)
    for frustum in road_scene(straight_road(), cone_line(), spec, seed=1).frusta:
        assert rims(frustum)[:, 2].min() == pytest.approx(0.0, abs=1e-3)


def test_faults_that_exceed_all_devices_are_refused() -> None:
    with pytest.raises(ValidationError, match="must not exceed 1"):
        DeviceFaults(missing_share=0.7, lying_share=0.4)


def test_guardrail_follows_the_pavement_edge_at_its_offset() -> None:
    road = straight_road()
    scene = road_scene(road, cone_line(), SceneSpec(ground=SMOOTH, guardrail="both", pole_spacing_m=0), seed=1)
    beams, posts = scene.boxes[scene.boxes[:, 3] > 0.5], scene.boxes[scene.boxes[:, 3] < 0.5]
    edges = np.array([road.left_edge + 0.6, -road.right_shoulder - 0.6])
    beyond = [np.abs(road.to_sd(boxes[:, :2])[1] - edges.mean()) - np.ptp(edges) / 2 for boxes in (beams, posts)]
    np.testing.assert_allclose(beyond[0], 0.0, atol=1e-6)
    # Posts stand behind half the beam, an 8 in block and half the post.
    np.testing.assert_allclose(beyond[1], 0.04 + 8 * 0.0254 + 0.1, atol=1e-6)
    np.testing.assert_allclose(2 * posts[:, 3:5], [[0.15, 0.2]] * len(posts))
    np.testing.assert_allclose(np.diff(posts[: len(posts) // 2, 0]), 1.905)  # 6 ft 3 in
    foot = posts[:, 2] - posts[:, 5] - scene.ground.height(posts[:, :2])
    np.testing.assert_allclose(foot, -0.1, atol=1e-6)
    np.testing.assert_allclose(2 * beams[:, 5], 0.312)
    top = beams[:, 2] + beams[:, 5] - scene.ground.height(beams[:, :2])
    np.testing.assert_allclose(top, 0.7874, atol=1e-3)  # 31 in


def test_vehicle_box_has_its_outline_its_default_height_and_a_gap_below() -> None:
    scene = road_scene(straight_road(), cone_line(), SceneSpec(ground=SMOOTH), seed=1)
    columns = {"x_m": [50.0, 80.0], "y_m": 1.8, "heading_rad": 0.3, "length_m": [6.9, 7.0], "width_m": [1.8, 2.5]}
    boxes = with_vehicles(scene, pd.DataFrame(columns)).boxes[-2:]
    np.testing.assert_allclose(boxes[:, 3:5] * 2, [[6.9, 1.8], [7.0, 2.5]])
    height = boxes[:, 2] - scene.ground.height(boxes[:, :2])
    np.testing.assert_allclose(height + boxes[:, 5], [1.5, 3.5], atol=1e-6)  # vehicles from 7 m on are trucks
    np.testing.assert_allclose(height - boxes[:, 5], 0.2, atol=1e-6)  # the ground shows below them
    with pytest.raises(InputError, match="width_m missing"):
        with_vehicles(scene, pd.DataFrame({"x_m": [0.0], "y_m": 0.0, "heading_rad": 0.0, "length_m": 4.0}))


def test_barrier_beside_the_work_is_a_wall_without_gaps_in_the_scene() -> None:
    layout = paper_layout(work_space_device="barrier")
    scene = scene_of(layout, SceneSpec(), seed=1)
    pieces = layout.devices["kind"].to_numpy() == "barrier"
    kinds = np.array(scene.kinds)[scene.device_id - 1]
    assert (kinds == layout.devices["kind"].to_numpy()).all()
    walls = scene.boxes[scene.device_id[pieces] - 1 - len(scene.frusta)]
    x, length = walls[:, 0], 2 * walls[:, 3]
    assert x[1:] - length[1:] / 2 == pytest.approx(x[:-1] + length[:-1] / 2)
    assert 2 * walls[:, 4] == pytest.approx(24 * 0.0254)  # 24 in wide
    top = walls[:, 2] + walls[:, 5]
    assert top - scene.ground.height(walls[:, :2]) == pytest.approx(32 * 0.0254)  # 32 in high


def test_cone_narrows_to_a_tip_of_3_in_and_a_drum_is_as_wide_at_its_top() -> None:
    spec = SceneSpec(ground=LEVEL, pole_spacing_m=0)
    cone, drum = (road_scene(straight_road(), cone_line(1, kind), spec, seed=1).frusta[0] for kind in ("cone_36in", "drum"))
    assert cone[6:].tolist() == pytest.approx([0.914, 0.178, 1.5 * 0.0254])
    assert drum[6:].tolist() == pytest.approx([0.914, 0.178, 0.178])


def test_poles_stand_on_both_verges_3_m_beyond_the_pavement_at_their_spacing() -> None:
    scene = road_scene(straight_road(1000), cone_line(0), SceneSpec(ground=LEVEL, pole_spacing_m=50.0), seed=1)
    assert scene.kinds == ("pole",) * len(scene.frusta)
    right, left = scene.frusta[scene.frusta[:, 1] < 0], scene.frusta[scene.frusta[:, 1] > 0]
    np.testing.assert_allclose(right[:, :2], [[25.0 + 50 * k, -3.048 - 3.0] for k in range(6)], atol=1e-6)
    np.testing.assert_allclose(left[:, :2], [[25.0 + 50 / 3 + 50 * k, 9.144 + 3.0] for k in range(6)], atol=1e-6)
    np.testing.assert_allclose(scene.frusta[:, 2], -0.1, atol=1e-6)  # buried
    np.testing.assert_allclose(scene.frusta[:, 6:], [[2.2, 0.05, 0.05]] * 12)


def test_default_scene_has_poles_every_60_m_no_guardrail_and_no_fault() -> None:
    spec = SceneSpec()
    assert spec.model_dump(exclude={"ground", "faults"}) == {
        "guardrail": "none", "guardrail_offset_m": 0.6, "post_spacing_m": 1.905, "pole_spacing_m": 60.0, "pole_offset_m": 3.0,
    }  # fmt: skip
    assert spec.faults.model_dump() == {
        "set_up_every": 1, "missing_share": 0.0, "tilted_share": 0.0, "lying_share": 0.0, "tilt_deg": 20.0, "seed": 0,
    }  # fmt: skip
