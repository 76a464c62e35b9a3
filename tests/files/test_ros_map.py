from contextlib import suppress
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from PIL import Image

from wzsumo.errors import MapError
from wzsumo.files.ros_map import read_map, write_map
from wzsumo.grid import OccupancyGrid

SIDES = array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=12)
MAPS = arrays(np.float32, SIDES, elements=st.floats(0, 1, width=32))


def hand_made_map(folder: Path, rows: list[list[int]], *, image: bytes | None = None, **metadata: object) -> Path:
    """A ROS map whose image holds `rows`, the top one first, written without the code under test."""
    height, width = len(rows), len(rows[0])
    pgm = f"P5\n{width} {height}\n255\n".encode() + bytes(grey for row in rows for grey in row)
    (folder / "hand.pgm").write_bytes(pgm if image is None else image)
    given = {"image": "hand.pgm", "resolution": 0.5, "origin": [-10.0, 3.0, 0.0], "negate": 0, "occupied_thresh": 0.65,
             "free_thresh": 0.196}  # fmt: skip
    kept = {key: value for key, value in (given | metadata).items() if value is not None}
    (folder / "hand.yaml").write_text(yaml.safe_dump(kept))
    return folder / "hand.yaml"


@given(p=MAPS)
def test_map_comes_back_from_its_ros_files_within_half_a_grey_level(
    tmp_path_factory: pytest.TempPathFactory, p: npt.NDArray[np.float32]
) -> None:
    grid = OccupancyGrid(p_occupied=p, resolution=0.127, origin=(-12.3, 4.56))
    back = read_map(write_map(grid, tmp_path_factory.mktemp("map")))
    assert np.abs(back.p_occupied.astype(float) - p).max() <= 1 / 510 + 1e-6
    assert (back.resolution, back.origin, back.shape) == (grid.resolution, grid.origin, grid.shape)


def test_written_image_has_the_highest_y_in_its_first_row_and_free_white(tmp_path: Path) -> None:
    write_map(OccupancyGrid(p_occupied=np.array([[0.0, 1.0], [1.0, 1.0]]), resolution=1, origin=(0, 0)), tmp_path)
    pixels = np.asarray(Image.open(tmp_path / "map.pgm"))
    assert pixels.tolist() == [[0, 0], [255, 0]]


# Grey 254 is free, 205 unknown and 0 occupied in maps that map_saver writes.
SAVED_ROWS = [[254, 205, 0], [0, 0, 254]]


def test_trinary_map_of_map_saver_reads_as_free_unknown_and_occupied_from_the_bottom_up(tmp_path: Path) -> None:
    grid = read_map(hand_made_map(tmp_path, SAVED_ROWS))
    assert grid.p_occupied.tolist() == [[1, 1, 0], [0, 0.5, 1]]
    assert (grid.resolution, grid.origin) == (0.5, (-10.0, 3.0))


def test_negated_trinary_map_reads_white_as_occupied(tmp_path: Path) -> None:
    grid = read_map(hand_made_map(tmp_path, [[254, 0, 120]], negate=1))
    assert grid.p_occupied.tolist() == [[1, 0, 0.5]]


def test_trinary_map_is_cut_by_the_files_own_thresholds(tmp_path: Path) -> None:
    # p = (255 - grey) / 255: 0.4, 0.6, 0.2
    grid = read_map(hand_made_map(tmp_path, [[153, 102, 204]], occupied_thresh=0.55, free_thresh=0.45))
    assert grid.p_occupied.tolist() == [[0, 1, 0]]


def test_thresholds_left_out_are_map_servers_defaults(tmp_path: Path) -> None:
    grid = read_map(hand_made_map(tmp_path, SAVED_ROWS, occupied_thresh=None, free_thresh=None))
    assert grid.p_occupied.tolist() == [[1, 1, 0], [0, 0.5, 1]]


def test_scale_map_reads_grey_as_probability(tmp_path: Path) -> None:
    grid = read_map(hand_made_map(tmp_path, [[0, 51, 255]], mode="scale"))
    assert grid.p_occupied[0] == pytest.approx([1, 0.8, 0])


def test_raw_map_reads_occupancy_in_per_cent_and_255_as_unknown(tmp_path: Path) -> None:
    grid = read_map(hand_made_map(tmp_path, [[0, 40, 100, 255]], mode="raw"))
    assert grid.p_occupied[0] == pytest.approx([0, 0.4, 1, 0.5])


def test_transparent_pixel_of_a_png_is_unknown(tmp_path: Path) -> None:
    path = hand_made_map(tmp_path, [[0]], image=b"", mode="scale")
    Image.fromarray(np.array([[[255, 255], [255, 0]]], dtype=np.uint8)).save(tmp_path / "clear.png")
    path.write_text(path.read_text().replace("hand.pgm", "clear.png"))
    assert read_map(path).p_occupied.tolist() == [[0, 0.5]]


def test_scale_map_is_free_below_its_own_threshold_and_occupied_above_its_own(tmp_path: Path) -> None:
    # p = (255 - grey) / 255: 0.2510, 0.2471, 0.5490, 0.5529
    grid = read_map(hand_made_map(tmp_path, [[191, 192, 115, 114]], mode="scale", free_thresh=0.25, occupied_thresh=0.55))
    assert grid.free.tolist() == [[False, True, False, False]]
    assert (grid.p_occupied > 0.65).tolist() == [[False, False, False, True]]


@given(free=st.floats(0, 1), occupied=st.floats(0, 1), negate=st.booleans())
def test_cell_of_a_scale_map_is_free_where_its_file_calls_it_free_and_keeps_the_order(
    tmp_path_factory: pytest.TempPathFactory, free: float, occupied: float, negate: bool
) -> None:
    free, occupied = min(free, occupied), max(free, occupied)
    path = hand_made_map(
        tmp_path_factory.mktemp("map"),
        [list(range(256))],
        mode="scale",
        free_thresh=free,
        occupied_thresh=occupied,
        negate=negate,
    )
    p_file = np.arange(256) / 255 if negate else 1 - np.arange(256) / 255
    grid = read_map(path)
    assert (grid.free[0] == (p_file < free)).all()
    assert ((grid.p_occupied[0] > 0.65) == (p_file > occupied)).all()
    assert (np.diff(grid.p_occupied[0].astype(float)) * (1 if negate else -1) >= 0).all()


WALL = np.array([[0, 1, 0, 0.5]])  # p(occupied) of the cells of one row: free, occupied, free, unknown
GREY_16 = np.round(65535 * (1 - WALL)).astype(np.uint16)


def _image_of_kind(kind: str, path: Path) -> None:
    """The row WALL as an image of a kind."""
    grey = np.round(255 * (1 - WALL)).astype(np.uint8)
    if kind == "PGM of 16 bits":
        path.write_bytes(b"P5\n4 1\n65535\n" + GREY_16.astype(">u2").tobytes())
    elif kind == "PGM of 10 bits":
        path.write_bytes(b"P5\n4 1\n1000\n" + np.round(1000 * (1 - WALL)).astype(">u2").tobytes())
    elif kind == "PGM of maxval 100":
        path.write_bytes(b"P5\n4 1\n100\n" + np.round(100 * (1 - WALL)).astype(np.uint8).tobytes())
    elif kind == "PNG of 16 bits":
        Image.fromarray(GREY_16).save(path, format="PNG")
    elif kind == "palette":
        image = Image.fromarray(np.array([[2, 0, 2, 1]], dtype=np.uint8), mode="P")
        image.putpalette([0, 0, 0, 127, 127, 127, 255, 255, 255])
        image.save(path, format="PNG")
    elif kind == "palette with a transparent entry":
        image = Image.fromarray(np.array([[2, 0, 2, 1]], dtype=np.uint8), mode="P")
        image.putpalette([0, 0, 0, 255, 255, 255, 255, 255, 255])
        image.save(path, format="PNG", transparency=1)
    elif kind == "RGB whose mean is the grey":
        rgb = np.stack([grey] * 3, axis=-1)
        rgb[0, 3] = (28, 100, 254)  # mean 127.3; by their luminance 96
        Image.fromarray(rgb).save(path, format="PNG")
    else:
        alpha = np.array([[255, 255, 255, 0]], dtype=np.uint8)
        bands = [grey] if kind == "grey and alpha" else [grey] * 3
        Image.fromarray(np.stack([*bands, alpha], axis=-1)).save(path, format="PNG")


@pytest.mark.parametrize("mode", ["trinary", "scale"])
@pytest.mark.parametrize(
    "kind",
    ["PGM of 16 bits", "PGM of 10 bits", "PGM of maxval 100", "PNG of 16 bits", "palette", "palette with a transparent entry",
     "RGB whose mean is the grey", "grey and alpha", "RGB and alpha"],
)  # fmt: skip
def test_image_of_every_kind_is_read_on_its_own_full_scale(tmp_path: Path, kind: str, mode: str) -> None:
    path = hand_made_map(tmp_path, [[0]], image=b"", mode=mode)
    _image_of_kind(kind, tmp_path / "hand.pgm")
    grid = read_map(path)
    assert grid.free.tolist() == [[True, False, True, False]]
    assert grid.p_occupied[0] == pytest.approx(WALL[0], abs=0.005)


def test_transparent_grey_of_16_bits_is_unknown(tmp_path: Path) -> None:
    path = hand_made_map(tmp_path, [[0]], image=b"", mode="scale")
    Image.fromarray(GREY_16).save(tmp_path / "hand.pgm", format="PNG", transparency=65535)
    assert read_map(path).p_occupied[0].tolist() == pytest.approx([0.5, 1, 0.5, 0.5], abs=0.005)


@pytest.mark.parametrize("kind", ["floats", "whole numbers of 32 bits", "CMYK", "16 bits with white as zero"])
def test_image_without_a_known_full_scale_is_refused(tmp_path: Path, kind: str) -> None:
    path = hand_made_map(tmp_path, [[0]], image=b"")
    pixels = {
        "floats": Image.fromarray(WALL.astype(np.float32)),
        "whole numbers of 32 bits": Image.fromarray(GREY_16.astype(np.int32)),
        "CMYK": Image.new("CMYK", (4, 1)),
        "16 bits with white as zero": Image.fromarray(GREY_16),
    }[kind]
    tags = {262: 0} if kind == "16 bits with white as zero" else {}
    pixels.save(tmp_path / "hand.pgm", format="TIFF", tiffinfo=tags)
    with pytest.raises(MapError, match="have no known full scale; give a PGM or PNG"):
        read_map(path)


def test_image_of_16_bits_in_mode_raw_is_refused(tmp_path: Path) -> None:
    path = hand_made_map(tmp_path, [[0]], image=b"", mode="raw")
    _image_of_kind("PNG of 16 bits", tmp_path / "hand.pgm")
    with pytest.raises(MapError, match="mode raw is percent in 8 bits"):
        read_map(path)


@pytest.mark.parametrize(
    "text",
    [
        "negate: 'no'", "negate: 'false'", "negate: 2", "negate: [1]", "negate:", "resolution: true",
        "resolution: 1" + "0" * 400, "resolution: 1" + "0" * 5000, "resolution: 2001-01-01", "resolution: 2001-99-99",
        "origin: 3", "origin: {a: 1}",
        "origin: [[1], 2, 3]", "origin: [true, 0, 0]", "origin: [1" + "0" * 400 + ", 0, 0]", "mode: [scale]", "mode: {}",
        "free_thresh: true", "free_thresh: 0.9", "free_thresh: .nan", "image: [a]", "image: ''", "image: 3", "image: .",
        "image: /dev/zero", "image: \"a\\0b\"", "? [a, b]\n: 1", "a: &a [1]\nb: *c", "!!python/object:os.system x",
        "k: " + "[" * 5000 + "]" * 5000,
    ],
)  # fmt: skip
def test_odd_value_in_a_map_file_is_refused_on_one_short_line(tmp_path: Path, text: str) -> None:
    path = hand_made_map(tmp_path, SAVED_ROWS)
    key = text.split(":", maxsplit=1)[0]
    kept = [line for line in path.read_text().splitlines() if not line.startswith(key)]
    if key == "origin":
        kept = [line for line in kept if not line.startswith("- ")]
    path.write_text("\n".join([*kept, text]))
    with pytest.raises(MapError, match=r"hand\.yaml") as refused:
        read_map(path)
    assert len(str(refused.value)) < 700
    assert "\n" not in str(refused.value)


def test_aliases_that_stand_for_millions_of_values_are_refused_at_once(tmp_path: Path) -> None:
    path = hand_made_map(tmp_path, SAVED_ROWS)
    layers = "\n".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9) if n else 1}]" for n in range(12))
    kept = path.read_text().replace("origin:\n- -10.0\n- 3.0\n- 0.0\n", "")
    path.write_text(f"{layers}\n{kept}origin: *a11\n")
    with pytest.raises(MapError, match="origin=") as refused:
        read_map(path)
    assert len(str(refused.value)) < 500


@given(cut=st.integers(0, 200), flip=st.integers(0, 199), bit=st.integers(0, 7))
def test_damaged_png_is_read_or_refused_and_never_breaks(
    tmp_path_factory: pytest.TempPathFactory, cut: int, flip: int, bit: int
) -> None:
    folder = tmp_path_factory.mktemp("map")
    path = hand_made_map(folder, SAVED_ROWS)
    Image.fromarray(np.arange(600, dtype=np.uint8).reshape(20, 30)).save(folder / "hand.pgm", format="PNG")
    content = bytearray((folder / "hand.pgm").read_bytes())
    content[flip % len(content)] ^= 1 << bit
    (folder / "hand.pgm").write_bytes(bytes(content[: len(content) - cut]))
    with suppress(MapError):
        read_map(path)


def changed_map(folder: Path, changes: dict[str, object]) -> Path:
    """A map of map_saver with other keys, or with other content of its image."""
    image = changes.get("image")
    metadata = {key: value for key, value in changes.items() if key != "image"}
    return hand_made_map(folder, SAVED_ROWS, image=image if isinstance(image, bytes) else None, **metadata)


@pytest.mark.parametrize(
    ("changes", "rule"),
    [
        ({"image": b"P5\n3 2\n255\n\x00\x00"}, "cannot be read"),  # two pixels of six
        ({"image": b"not an image"}, "cannot be read"),
        ({"width": 4}, r"width=4 but the image .* has 3"),
        ({"height": 7}, r"height=7 but the image .* has 2"),
        ({"resolution": 0}, "resolution=0 must"),
        ({"resolution": "fine"}, "resolution='fine' must"),
        ({"resolution": None}, "resolution missing"),
        ({"origin": [0.0]}, "origin="),
        ({"origin": [0.0, float("nan"), 0.0]}, "origin="),
        ({"origin": [0.0, 0.0, 0.3]}, r"yaw 0\.3 rad"),
        ({"mode": "binary"}, "mode='binary' must be trinary, scale or raw"),
        ({"resolution": float("inf")}, "resolution=inf"),
        ({"free_thresh": "low"}, "free_thresh='low' must"),
        ({"occupied_thresh": 65}, "occupied_thresh=65 must"),
    ],
)
def test_ros_map_that_cannot_be_is_refused_with_the_rule(tmp_path: Path, changes: dict[str, object], rule: str) -> None:
    with pytest.raises(MapError, match=rule):
        read_map(changed_map(tmp_path, changes))


def test_missing_map_image_is_refused_with_its_path(tmp_path: Path) -> None:
    path = hand_made_map(tmp_path, SAVED_ROWS)
    (tmp_path / "hand.pgm").unlink()
    with pytest.raises(MapError, match=r"hand\.yaml: image .*hand\.pgm: no such file"):
        read_map(path)


def test_missing_map_file_is_refused_with_its_path(tmp_path: Path) -> None:
    with pytest.raises(MapError, match=r"none\.yaml: no such file"):
        read_map(tmp_path / "none.yaml")


@pytest.mark.parametrize("text", ["just words", "a: [1", ""])
def test_yaml_that_is_no_map_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "bad.yaml").write_text(text)
    with pytest.raises(MapError, match="name the YAML file of a ROS map"):
        read_map(tmp_path / "bad.yaml")


@pytest.mark.parametrize("side", [10_000, 20_000], ids=["Pillow warns", "Pillow refuses"])
def test_map_of_a_hundred_million_pixels_is_refused_before_it_is_read(tmp_path: Path, side: int) -> None:
    path = hand_made_map(tmp_path, SAVED_ROWS)
    image = tmp_path / yaml.safe_load(path.read_text())["image"]
    image.write_bytes(b"P5\n%d %d\n255\n" % (side, side))  # nothing but the header
    with pytest.raises(MapError, match=r"has more than \d+ pixels; crop it"):
        read_map(path)


def test_written_yaml_holds_map_servers_keys_and_the_images_size(tmp_path: Path) -> None:
    path = write_map(
        OccupancyGrid(p_occupied=np.zeros((2, 3), dtype=np.float32), resolution=0.25, origin=(1.5, -2.0)), tmp_path, name="zone"
    )
    assert path == tmp_path / "zone.yaml"
    assert yaml.safe_load(path.read_text()) == {
        "image": "zone.pgm", "mode": "scale", "resolution": 0.25, "origin": [1.5, -2.0, 0.0], "negate": 0,
        "occupied_thresh": 0.65, "free_thresh": 0.196, "width": 3, "height": 2,
    }  # fmt: skip


@pytest.mark.parametrize(("grey", "p"), [(88, 1.0), (90, 0.5), (204, 0.5), (206, 0.0)])
def test_default_thresholds_cut_a_trinary_map_at_65_and_19_6_percent(tmp_path: Path, grey: int, p: float) -> None:
    # p = (255 - grey) / 255: 0.655, 0.647, 0.2, 0.192.
    path = hand_made_map(tmp_path, [[grey]], occupied_thresh=None, free_thresh=None)
    assert read_map(path).p_occupied.tolist() == [[p]]
