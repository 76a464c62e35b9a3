"""What held the ego back on a drive, from the files of a run."""

import numpy as np
import pandas as pd

from wzsumo.control.controller import ControlSpec
from wzsumo.control.speed_profile import SpeedProfile
from wzsumo.ego import EgoRun, Outcome
from wzsumo.figures.slowing import Slowing, slowings
from wzsumo.files.result_folder import ResultFolder
from wzsumo.frames import FloatArray, arc_length
from wzsumo.path import ReferencePath
from wzsumo.spec import parse_spec, read_toml

BEND_KEYS = ("max_lateral_mps2", "slowdown_mps2", "stop_at_goal")


def slowings_of(run: ResultFolder, method: str) -> list[Slowing]:
    """The slowings of a method's drive; none where it was not driven.

    The speed that bends allow is that of the line that was driven, so that it holds also where the ego planned anew on the way.
    """
    log, traffic = run.drive_of(method), run.drive_traffic_of(method)
    if log is None or traffic is None or len(log) < 2:
        return []
    outcome = Outcome(run.methods[method].get("outcome") or Outcome.TIMED_OUT)
    drive = EgoRun(log=log, traffic=traffic, followers=traffic.iloc[:0], replans=(), outcome=outcome, reason="")
    control = _control(run, log)
    wished = _wished(log, control)
    line = next((float(each["s_m"]) for each in run.stop_lines if not each["opposing"]), None)
    speed = control.target_speed_mps
    return slowings(drive, run.vehicle, road=run.road, wished=wished, on_straights_mps=speed, stop_line_m=line)


def _control(run: ResultFolder, log: pd.DataFrame) -> ControlSpec:
    """What the run's scenario.toml says of the speeds that the ego keeps; without a speed, the highest of the drive.

    Keys that decide no speed are not read, so that a run is told also where those have changed since.
    """
    path = run.folder / "scenario.toml"
    said = read_toml(path).get("control", {}) if path.exists() else {}
    regulated = {key: value for key, value in said.get("regulated", {}).items() if key in BEND_KEYS}
    kept = {key: said[key] for key in ("lateral", "target_speed_mps") if key in said} | {"regulated": regulated}
    return parse_spec(ControlSpec, {"target_speed_mps": float(log["speed_mps"].max())} | kept, source=f"{path}, control")


def _wished(log: pd.DataFrame, control: ControlSpec) -> FloatArray:
    """Speeds (n,) [m/s] that the ego keeps at the rows of its log if nobody hinders it."""
    target = np.full(len(log), control.target_speed_mps)
    poses = log[["x_m", "y_m", "heading_rad"]].to_numpy(dtype=float)
    driven = arc_length(poses[:, :2])
    if control.lateral == "paper" or driven[-1] <= 0:
        return target
    moved = np.append(True, np.diff(driven) > 1e-3)  # an ego that stands has no curvature
    profile = SpeedProfile.of(ReferencePath(poses=poses[moved]), spec=control.regulated)
    return np.minimum(target, profile.speeds_at(arc_length(poses[moved, :2])[np.cumsum(moved) - 1]))
