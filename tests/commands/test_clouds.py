import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wzsumo.cli import main
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.rigid import inverse, moved, rigid, rotation_from_rpy


def run(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    """(exit code, stdout, stderr) of one command."""
    with pytest.raises(SystemExit) as stopped:
        main([str(word) for word in words])
    out = capsys.readouterr()
    return int(stopped.value.code or 0), out.out, out.err


def house_on_a_slope(n: int = 8000) -> tuple[FloatArray, BoolArray]:
    """Points of a slope of 5 % with a house of 10 x 10 m, 6 m high, and which are ground."""
    rng = np.random.default_rng(1)
    xy = rng.uniform(0, 60, (n, 2))
    house = (np.abs(xy - 30) < 5).all(axis=1)
    return np.column_stack([xy, 0.05 * xy[:, 0] + 6.0 * house]), np.asarray(~house)


def courtyard(seed: int, n: int = 6000) -> FloatArray:
    """Points of a floor, two walls and three posts, no two clouds with the same points."""
    rng = np.random.default_rng(seed)
    floor = np.column_stack([rng.uniform(-15, 15, (n, 2)), np.zeros(n)])
    walls = np.column_stack([rng.uniform(-15, 15, n), np.full(n, 15.0), rng.uniform(0, 4, n)])
    walls[::2] = walls[::2, [1, 0, 2]]
    turn, height = rng.uniform(-np.pi, np.pi, n // 4), rng.uniform(0, 2, n // 4)
    feet = np.array([(-8, -3), (2, -9), (6, 4)])[rng.integers(0, 3, n // 4)]
    posts = np.column_stack([feet + 0.2 * np.column_stack([np.cos(turn), np.sin(turn)]), height])
    return np.vstack([floor, walls, posts]) + 0.01 * rng.standard_normal((2 * n + n // 4, 3))


@pytest.mark.parametrize("kind", ["npy", "csv"])
def test_ground_command_labels_a_house_0_and_its_slope_1(tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str) -> None:
    points, is_ground = house_on_a_slope()
    if kind == "npy":
        np.save(tmp_path / "in.npy", points)
    else:
        np.savetxt(tmp_path / "in.csv", points, delimiter=",", header="x,y,z", comments="")
    code, out, _ = run(capsys, "ground", tmp_path / f"in.{kind}", "--out", tmp_path / "out.npy", "--json")
    labels = np.load(tmp_path / "out.npy")
    assert code == 0
    assert labels.dtype == np.uint8
    np.testing.assert_array_equal(labels, is_ground)
    assert json.loads(out)["n_ground"] == is_ground.sum()


def test_ground_command_passes_every_parameter_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    points, _ = house_on_a_slope()
    np.save(tmp_path / "in.npy", points)
    words = ("--cell-m", 2, "--slope", 0.3, "--window-m", 2, "--elevation-threshold-m", 0.4, "--elevation-scalar", 0)
    code, out, _ = run(capsys, "ground", tmp_path / "in.npy", "--out", tmp_path / "out.npy", "--json", *words)
    assert code == 0
    assert list(json.loads(out)["parameters"].values()) == [2, 0.3, 2, 0.4, 0]
    middle = (np.abs(points[:, :2] - 30) < 1.5).all(axis=1)
    assert np.load(tmp_path / "out.npy")[middle].all()  # a window of 2 m is narrower than the house: its roof is ground


@pytest.mark.parametrize(
    ("points", "words", "says"),
    [
        (np.zeros((0, 3)), (), "0 point(s)"),
        (np.zeros((1, 3)), (), "1 point(s)"),
        (np.array([[0, 0, 0], [1, 1, np.nan], [2, 0, 0]]), (), "point 1"),
        (np.array([[0, 0, 0], [1, 0, 100], [0, 0, 0.0]]), (), "no ground"),
        (np.zeros((9, 2)), (), "shape (9, 2)"),
        (np.zeros((9, 3)), ("--slope", -1), "slope=-1.0"),
        (np.zeros((9, 3)), ("--cell-m", 0), "cell_m=0.0"),
    ],
)
def test_ground_command_refuses_a_bad_cloud_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], points: Any, words: tuple[object, ...], says: str
) -> None:
    np.save(tmp_path / "in.npy", points)
    code, out, err = run(capsys, "ground", tmp_path / "in.npy", "--out", tmp_path / "out.npy", *words)
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert says in err
    assert [p.name for p in tmp_path.iterdir()] == ["in.npy"]


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("in.las", b"LASF", "unknown cloud format '.las'"),
        ("in.csv", b"", "0 point(s)"),
        ("in.csv", b"east,north,up\n1,2,3\n", "columns x, y, z"),
        ("in.ply", b"ply\nformat\nelement vertex\nend_header\n", "cannot be read"),
        ("in.npy", b"\x93NUMPY", "cannot be read"),
    ],
)
def test_file_that_is_no_cloud_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, content: bytes, says: str
) -> None:
    (tmp_path / name).write_bytes(content)
    code, _, err = run(capsys, "ground", tmp_path / name, "--out", tmp_path / "out.npy")
    assert code == 2
    assert err.count("\n") == 1
    assert says in err


def test_labels_go_to_an_npy_file_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    np.save(tmp_path / "in.npy", house_on_a_slope()[0])
    code, _, err = run(capsys, "ground", tmp_path / "in.npy", "--out", tmp_path / "labels.txt")
    assert code == 2
    assert ".npy" in err


def test_register_command_writes_the_transform_that_takes_source_to_target(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    truth = rigid(rotation_from_rpy([0.01, 0.02, 0.2]), [1.5, -0.8, 0.2])
    np.save(tmp_path / "source.npy", moved(courtyard(1), inverse(truth)))
    np.savetxt(tmp_path / "target.csv", courtyard(2), delimiter=",")
    words = (tmp_path / "source.npy", tmp_path / "target.csv", "--out", tmp_path / "T.txt", "--json")
    code, out, _ = run(capsys, "register", *words)
    assert code == 0
    assert json.loads(out)["status"] == "converged"
    np.testing.assert_allclose(np.loadtxt(tmp_path / "T.txt"), truth, atol=0.01)


@pytest.mark.parametrize(
    ("source", "says"),
    [
        (courtyard(1), "identical clouds"),
        (courtyard(1)[:8] + 0.3, "too few features"),
        (np.zeros((1, 3)), "1 point(s)"),
        (np.full((5, 3), np.inf), "must be finite"),
    ],
)
def test_register_command_writes_no_identity_where_clouds_tell_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], source: Any, says: str
) -> None:
    np.save(tmp_path / "source.npy", source)
    np.save(tmp_path / "target.npy", courtyard(1))
    code, _, err = run(capsys, "register", tmp_path / "source.npy", tmp_path / "target.npy", "--out", tmp_path / "T.txt")
    assert code == 2
    assert says in err
    assert err.count("\n") == 1
    assert not (tmp_path / "T.txt").exists()
