"""Pictures of signs: their shapes, colours and words, as far as pixels can tell."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from wzsumo.simulation.drawing.sign_faces import write_arrow_board, write_device, write_sign_face

ORANGE, BLACK = (255, 130, 0, 255), (0, 0, 0, 255)


def pixels(path: Path) -> npt.NDArray[np.uint8]:
    return np.asarray(Image.open(path).convert("RGBA"))


@pytest.mark.parametrize(
    ("code", "text"),
    [("W20-1", "ROAD WORK AHEAD"), ("W20-5aR", "2 RIGHT LANES CLOSED AHEAD"), ("W21-5bR", "RIGHT SHOULDER CLOSED AHEAD")],
)
def test_words_of_a_diamond_stay_within_its_border(tmp_path: Path, code: str, text: str) -> None:
    write_sign_face(code, text, tmp_path / "words.png")
    write_sign_face("W20-7", text, tmp_path / "symbol.png")
    face = pixels(tmp_path / "words.png")
    n = len(face)
    y, x = np.mgrid[:n, :n] / n - 0.5
    reach = np.abs(x) + np.abs(y)
    assert (face[reach > 0.52][:, 3] == 0).all()
    ring = (reach > 0.387) & (reach < 0.4)  # the orange inside the border, where no word may lie
    assert (np.abs(face[ring].astype(int) - ORANGE).sum(axis=1) < 200).all()
    assert (face[reach < 0.38] == BLACK).all(axis=1).mean() > 0.05
    assert (face != pixels(tmp_path / "symbol.png")).any()


def test_symbols_of_the_two_sides_are_mirrored(tmp_path: Path) -> None:
    for code in ("W4-2", "W1-4"):
        for side in "LR":
            write_sign_face(f"{code}{side}", "x", tmp_path / f"{side}.png")
        left, right = pixels(tmp_path / "L.png").astype(int), pixels(tmp_path / "R.png").astype(int)
        assert np.abs(left - right[:, ::-1]).mean() < 3
        assert np.abs(left - right).mean() > 3


def test_arrow_board_has_its_head_on_the_side_to_which_it_sends_traffic(tmp_path: Path) -> None:
    write_arrow_board(tmp_path / "left.png", to_the_left=True)
    lamps = pixels(tmp_path / "left.png")[..., 0] > 200
    heights = [int(np.ptp(np.flatnonzero(column))) if column.any() else 0 for column in lamps.T]
    assert np.argmax(heights) < lamps.shape[1] / 2


def test_cone_is_narrow_at_its_top_and_a_drum_is_not(tmp_path: Path) -> None:
    widths = {}
    for is_cone in (True, False):
        write_device(tmp_path / "device.png", is_cone=is_cone)
        solid = pixels(tmp_path / "device.png")[..., 3] > 0
        widths[is_cone] = solid[int(0.15 * len(solid))].sum() / solid[int(0.85 * len(solid))].sum()
    assert widths[True] < 0.4
    assert widths[False] > 0.8
