"""Images in which programs could see different things are refused: which is meant, only their owner knows."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from wzsumo.errors import MapError
from wzsumo.files.map_image import read_map_image
from wzsumo.files.ros_map import read_map

GREY = np.repeat(np.array([[0, 205, 254]], dtype=np.uint8), 4, axis=0)


@pytest.mark.parametrize("suffix", ["png", "jpg", "tif"])
def test_image_that_a_tag_turns_is_refused(tmp_path: Path, suffix: str) -> None:
    tags = Image.Exif()
    tags[274] = 3  # upside down
    Image.fromarray(GREY).save(tmp_path / f"turned.{suffix}", exif=tags)
    with pytest.raises(MapError, match="orientation tag is 3"):
        read_map_image(tmp_path / f"turned.{suffix}")
    tags[274] = 1
    Image.fromarray(GREY).save(tmp_path / f"upright.{suffix}", exif=tags)
    assert read_map_image(tmp_path / f"upright.{suffix}").levels.shape == (4, 3)


@pytest.mark.parametrize("suffix", ["png", "tif"])
def test_file_of_several_images_is_refused(tmp_path: Path, suffix: str) -> None:
    other = [Image.fromarray(255 - GREY)]
    Image.fromarray(GREY).save(tmp_path / f"two.{suffix}", save_all=True, append_images=other)
    with pytest.raises(MapError, match="holds 2 images"):
        read_map_image(tmp_path / f"two.{suffix}")


@pytest.mark.parametrize(("full", "kind"), [(100, "u1"), (250, "u1"), (1000, ">u2")])
def test_levels_above_the_full_scale_of_the_header_are_no_white(tmp_path: Path, full: int, kind: str) -> None:
    """Pillow takes them for white, which is free: unknown ground (205 of 255) would be."""
    levels = np.array([[0, full // 2, full]])
    (tmp_path / "m.pgm").write_bytes(b"P5\n3 1\n%d\n" % full + levels.astype(kind).tobytes())
    image = read_map_image(tmp_path / "m.pgm")
    assert (image.levels / image.full).tolist() == [[0, pytest.approx(0.5, abs=0.003), 1]]
    (tmp_path / "m.pgm").write_bytes(b"P5\n3 1\n%d\n" % full + (levels + 1).astype(kind).tobytes())
    with pytest.raises(MapError, match=f"levels up to {full + 1}, but its header says that {full} is white"):
        read_map_image(tmp_path / "m.pgm")


def test_key_of_a_map_file_that_is_given_twice_is_refused(tmp_path: Path) -> None:
    (tmp_path / "m.pgm").write_bytes(b"P5\n3 4\n255\n" + GREY.tobytes())
    text = "image: m.pgm\nresolution: 0.5\norigin: [0, 0, 0]\nnegate: 0\n"
    (tmp_path / "m.yaml").write_text(text)
    assert read_map(tmp_path / "m.yaml").p_occupied[0].tolist() == [1, 0.5, 0]
    (tmp_path / "m.yaml").write_text(text + "negate: 1\n")
    with pytest.raises(MapError, match="negate given more than once"):
        read_map(tmp_path / "m.yaml")
