from pathlib import Path

import numpy as np
import pytest

from wzsumo.errors import CloudError
from wzsumo.files.cloud import read_cloud

POINTS = np.array([[1.5, -2.25, 0.125], [3.0, 4.0, 5.0], [-1e3, 0.5, 7.75]])


def ply_header(form: str, *properties: str) -> bytes:
    lines = ["ply", f"format {form} 1.0", "comment made by hand", "element vertex 3", *properties]
    return "\n".join([*lines, "element face 0", "property list uchar int vertex_indices", "end_header", ""]).encode()


def test_same_points_come_back_from_every_format(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", POINTS)
    (tmp_path / "named.csv").write_text("t,z,y,x\n" + "\n".join(f"0,{z},{y},{x}" for x, y, z in POINTS))
    (tmp_path / "bare.csv").write_text("\n".join(",".join(map(str, p)) for p in POINTS))
    xyz = ("property double x", "property double y", "property double z")
    text = "\n".join(" ".join(map(str, p)) for p in POINTS).encode()
    (tmp_path / "text.ply").write_bytes(ply_header("ascii", *xyz) + text + b"\n")
    (tmp_path / "little.ply").write_bytes(ply_header("binary_little_endian", *xyz) + POINTS.astype("<f8").tobytes())
    rows = np.zeros(3, dtype=[("i", "u1"), ("x", ">f4"), ("y", ">f4"), ("z", ">f4")])
    for axis, values in zip("xyz", POINTS.T, strict=True):
        rows[axis] = values
    floats = ("property uchar i", "property float x", "property float y", "property float z")
    (tmp_path / "big.ply").write_bytes(ply_header("binary_big_endian", *floats) + rows.tobytes())
    for path in sorted(tmp_path.iterdir()):
        np.testing.assert_array_equal(read_cloud(path), POINTS, err_msg=path.name)


@pytest.mark.parametrize(
    ("name", "content", "part"),
    [
        ("a.las", b"", "unknown cloud format '.las'"),
        ("a.npy", b"not numpy", "cannot be read"),
        ("a.csv", b"x,y,z\n1,2,oops\n", "cannot be read"),
        ("a.csv", b"1,2\n3,4\n", "shape"),
        ("a.csv", b"", "0 point"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nend_header\n1\n2\n", "x, y and z"),
        ("a.ply", b"solid", "no PLY header"),
    ],
)
def test_unreadable_cloud_is_refused_with_file_and_reason(tmp_path: Path, name: str, content: bytes, part: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(CloudError, match=part) as error:
        read_cloud(tmp_path / name)
    assert str(tmp_path / name) in str(error.value)


def test_missing_cloud_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CloudError, match="no such file"):
        read_cloud(tmp_path / "none.npy")


@pytest.mark.parametrize(
    ("header", "part"),
    [
        (ply_header("ascii", "property list uchar float x"), "not one number"),
        (ply_header("ascii", "property half x"), "not one number"),
        (ply_header("binary", "property float x", "property float y", "property float z"), "format 'binary' is not of PLY"),
        (b"ply\nformat ascii 1.0\nelement face 3\nend_header\n", "first element must be vertex"),
        (ply_header("binary_little_endian", "property float x", "property float y", "property float z"), "cannot be read"),
    ],
)
def test_ply_file_of_another_kind_is_refused_with_the_reason(tmp_path: Path, header: bytes, part: str) -> None:
    (tmp_path / "a.ply").write_bytes(header)
    with pytest.raises(CloudError, match=part):
        read_cloud(tmp_path / "a.ply")


@pytest.mark.parametrize(("at_least", "refused"), [(3, False), (4, True)])
def test_cloud_with_fewer_points_than_needed_is_refused(tmp_path: Path, at_least: int, refused: bool) -> None:
    np.save(tmp_path / "a.npy", POINTS)
    if refused:
        with pytest.raises(CloudError, match="at least 4 needed"):
            read_cloud(tmp_path / "a.npy", at_least=at_least)
    else:
        assert len(read_cloud(tmp_path / "a.npy", at_least=at_least)) == 3


def test_columns_in_metres_are_read_by_name_and_windows_line_ends_of_a_ply_header_are_taken(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(" X_m,Y_m,Z_m\n" + "\n".join(",".join(map(str, p)) for p in POINTS))
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.csv"), POINTS)
    header = ply_header("binary_little_endian", "property double x", "property double y", "property double z")
    (tmp_path / "a.ply").write_bytes(header.replace(b"\n", b"\r\n") + POINTS.astype("<f8").tobytes())
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.ply"), POINTS)
