import pytest
from placement.networks import freeway, freeway_on_earth

from wzsumo.errors import PlacementError
from wzsumo.placement.net import Net
from wzsumo.placement.place_on_net import edge_near

METRES_PER_DEGREE = 90_164.0  # of longitude at 36 degrees north: cos(36) a / sqrt(1 - e^2 sin^2(36)) of WGS 84


def test_place_in_degrees_is_the_nearest_edge_and_the_distance_from_its_beginning() -> None:
    net = Net.read(freeway_on_earth())
    eastward, position = edge_near(net, 35.99995, -86.59)
    westward, _ = edge_near(net, 36.00005, -86.59)
    assert (eastward, westward) == ("ab", "ba")
    assert position == pytest.approx(0.01 * METRES_PER_DEGREE, abs=5)


@pytest.mark.parametrize(
    ("latitude", "longitude", "words"),
    [
        (36.1, -86.59, "no road lies within 30 m"),
        (-86.59, 36.0, "no road lies within 30 m"),
        (136.0, 0.0, "latitude of -90..90"),
    ],
)
def test_places_that_are_on_no_road_are_refused(latitude: float, longitude: float, words: str) -> None:
    with pytest.raises(PlacementError, match=words):
        edge_near(Net.read(freeway_on_earth()), latitude, longitude)


def test_network_without_a_projection_is_refused() -> None:
    with pytest.raises(PlacementError, match="no geographic frame"):
        edge_near(Net.read(freeway()), 36.0, -86.6)
