"""The tables of drives on the pages: the paper's case, and every zone of the library."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import beta, bootstrap

RESULTS = Path(__file__).parents[2] / "docs" / "results"
# Column of library_drives.csv of a column of the table, which drive of several is shown, and its format.
SHOWN: dict[str, tuple[str, str, str]] = {
    "clearance m": ("driven_min_clearance_devices_m", "min", ".2f"),
    "median": ("driven_min_clearance_devices_m", "median", ".2f"),
    "below 0.5 m": ("driven_min_clearance_devices_m", "below_half_metre", "d"),
    "TTC s": ("driven_min_ttc_s", "min", ".2f"),
    "DRAC m/s²": ("driven_max_drac_mps2", "max", ".2f"),
    "lateral m/s²": ("driven_max_lateral_acceleration_mps2", "max", ".2f"),
    "braking m/s²": ("driven_max_braking_mps2", "max", ".2f"),
    "jerk m/s³": ("driven_max_jerk_mps3", "max", ".2f"),
    "above 5": ("driven_max_jerk_mps3", "above_five", "d"),
    "off path m": ("max_cross_track_m", "max", ".2f"),
    "delay behind s": ("driven_delay_behind_per_vehicle_s", "median", ".2f"),
}
CHOICES: dict[str, Callable[["pd.Series[float]"], float]] = {
    "min": lambda values: float(values.min()),
    "max": lambda values: float(values.max()),
    "median": lambda values: float(values.median()),
    "below_half_metre": lambda values: int((values < 0.5).sum()),
    "above_five": lambda values: int((values > 5).sum()),
}


def paper_case() -> str:
    """Quality and outcome of `swept` and `lanes` on the paper's zone, over seeds."""
    rows = pd.read_csv(RESULTS / "paper_case_seeds.csv")
    parts = [rows[rows["method"] == method] for method in ("swept", "lanes")]
    n, first, last = rows["seed"].nunique(), rows["seed"].min(), rows["seed"].max()
    lines = [f"| 5 traces, seeds {first}-{last} (n = {n}), mean [95 % interval] | `swept` | `lanes` |", "|---|---|---|"]
    for title, name in (("precision", "precision"), ("recall", "recall"), ("IoU", "iou")):
        lines.append(f"| {title} | {' | '.join(_mean_with_interval(part[name]) for part in parts)} |")
    reached = [f"**{(part['outcome'] == 'REACHED_GOAL').sum()} of {len(part)}**" for part in parts]
    lines.append(f"| **ego reached its goal in traffic** | {' | '.join(reached)} |")
    clean = [f"{part['clean'].sum()} of {len(part)}" for part in parts]
    lines.append(f"| drives that were clean | {' | '.join(clean)} |")
    hurt = ("COLLIDED", "STRUCK_DEVICE", "ENTERED_CLOSED_AREA")
    struck = [f"{part['outcome'].isin(hurt).sum()} of {len(part)}" for part in parts]
    lines.append(f"| overlapped a vehicle, struck a device, entered the closed area | {' | '.join(struck)} |")
    clearances = [part["min_clearance_devices_m"] for part in parts]
    least = [f"{clearance.min():.2f} m ({clearance.mean():.2f} m)" for clearance in clearances]
    lines.append(f"| least clearance of the drive to a device, worst seed (mean) | {' | '.join(least)} |")
    recalls = [f"{part['recall'].min():.2f}" for part in parts]
    lines.append(f"| least recall | {' | '.join(recalls)} |")
    return "\n".join(lines)


def _mean_with_interval(values: "pd.Series[float]") -> str:
    """Mean and 95 % bootstrap interval over seeds."""
    drawn = bootstrap((values.to_numpy(dtype=float),), np.mean, rng=np.random.default_rng(0)).confidence_interval
    return f"{values.mean():.3f} [{drawn.low:.3f}, {drawn.high:.3f}]"


def paper_squares() -> str:
    """Precision, recall, pieces and planned path of the maps of one run of the paper's zone."""
    maps = json.loads((RESULTS / "paper_case.json").read_text(encoding="utf-8"))["methods"]
    titles = {
        "paper_literal": "`paper_literal`, 5 by 5 inch", "paper": "`paper`, 5 by 5 foot",
        "swept": "`swept`", "lanes": "`lanes`",
    }  # fmt: skip
    lines = ["| map | precision | recall | pieces | planned path |", "|---|---|---|---|---|"]
    for name, title in titles.items():
        made = maps[name]
        path = {"NO_PATH": "none", "REACHED_GOAL": "reached the goal"}.get(made["outcome"], made["outcome"])
        lines.append(f"| {title} | {made['precision']:.3f} | {made['recall']:.3f} | {made['n_fragments']:,} | {path} |")
    return "\n".join(lines)


def conduct_of_states() -> str:
    """How the drives of each state of the code were driven, a row a state and choice of its drives."""
    rows = pd.read_csv(RESULTS / "conduct.csv", dtype={"speed": str})
    keys = ["scenario", "seed", "method", "speed"]
    of = {state: part.set_index(keys) for state, part in rows.groupby("code")}
    chosen = {
        "A": of["A"], "A, drives of B": of["A"].loc[of["A"].index.isin(of["B"].index)], "B": of["B"],
        "A, drives of C (`lanes`)": of["A"].loc[of["A"].index.isin(of["C"].index)],
        "B, drives of C": of["B"].loc[of["B"].index.isin(of["C"].index)], "C": of["C"],
    }  # fmt: skip
    chosen |= {f"{state}, `{method}`": part for state in "DE" for method, part in of[state].groupby(level="method")}
    titles = (
        "n", "reached", "clean", "bound", "also at most 4 m/s² behind", "over a line, mean / worst", "braking m/s²",
        "of the one behind", "asked of it", "jerk m/s³", "off the middle m", "SDLP m, worst", "drives with spare lane changes",
        "clearance m",
    )  # fmt: skip
    lines = [f"| | {' | '.join(titles)} |", f"|---|{'---:|' * len(titles)}"]
    for title, part in chosen.items():
        n, clean, over = len(part), part["clean"].astype(bool), 100 * part["over_line_share"]
        spare = (part["n_lane_changes"] > part["n_needed_changes"]).sum()
        asked = part["braking_asked_behind_mps2"].max()
        cells = (
            n, (part["outcome"] == "REACHED_GOAL").sum(), clean.sum(), f"{share_above(int(clean.sum()), n):.0%}",
            (clean & (part["braking_behind_mps2"] <= 4)).sum(), f"{over.mean():.1f} / {over.max():.0f} %",
            f"{part['braking_unprompted_mps2'].max():.1f}", f"{part['braking_behind_mps2'].max():.1f}",
            "–" if np.isnan(asked) else f"{asked:.1f}", f"{part['max_jerk_1s_mps3'].max():.1f}",
            f"{part['mean_off_middle_m'].mean():.2f}", f"{part['sd_off_middle_m'].max():.2f}", int(spare),
            f"{part['min_clearance_devices_m'].min():.2f}",
        )  # fmt: skip
        lines.append(f"| {title} | {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


def conduct_summary() -> str:
    """How many drives of the present state were clean, in a sentence."""
    rows = pd.read_csv(RESULTS / "conduct.csv")
    rows = rows[rows["code"] == "E"]
    told = []
    for method, part in rows.groupby("method"):
        n, n_clean = len(part), int(part["clean"].astype(bool).sum())
        told.append(f"{n_clean} of {n} drives on `{method}` maps (above {share_above(n_clean, n):.0%} with 95 %)")
    return f"{' and '.join(told)} were\n  clean, in {rows['scenario'].nunique()} zones of the library"


def share_above(n_clean: int, n: int) -> float:
    """The share that the share of clean drives is above, with 95 % (Clopper & Pearson 1934)."""
    return float(beta.ppf(0.05, n_clean, n - n_clean + 1)) if n_clean else 0.0


def made_up_zones() -> str:
    """How the drives in zones made up by their seeds ended, and how many were clean."""
    rows = pd.read_csv(RESULTS / "made_up_zones.csv")
    n, n_clean, ended = len(rows), int(rows["clean"].astype(bool).sum()), rows["outcome"].value_counts()
    others = ", ".join(f"{count} {outcome}" for outcome, count in ended.items() if outcome != "REACHED_GOAL")
    reached = f"{ended['REACHED_GOAL']} reached their goal" + (f" ({others})" if others else "")
    bound = f"{share_above(n_clean, n):.0%}"
    return f"of {n} drives, each in a zone of its own,\n{reached} and {n_clean} were clean (above {bound} with 95 %)"


def library_by_method(first: str, last: str) -> str:
    """Worst drives of the seeds from `first` to `last` in all zones, a row a map method and speed."""
    rows = _library(first, last)
    lines = [f"| | n | reached | {' | '.join(SHOWN)} |", f"|---|{'---:|' * (2 + len(SHOWN))}"]
    for (method, speed), part in rows.groupby(["method", "speed"]):
        title = f"`{method}`, {'10 m/s' if speed == '10' else 'posted speed'}"
        cells = [format(CHOICES[choice](part[column]), form) for column, choice, form in SHOWN.values()]
        reached = int((part["outcome"] == "REACHED_GOAL").sum())
        lines.append(f"| {title} | {len(part)} | {reached} | {' | '.join(cells)} |")
    return "\n".join(lines)


def library_by_zone(first: str, last: str) -> str:
    """Worst drives of the seeds from `first` to `last`, a row a zone."""
    rows = _library(first, last)
    kinds = [(method, speed) for method in ("lanes", "swept") for speed in ("10", "zone")]
    told = [f"`{method}`, {'10 m/s' if speed == '10' else 'posted'}" for method, speed in kinds]
    told[0] = f"clearance m: {told[0]}"
    shown = ("TTC s", "braking m/s²", "jerk m/s³")
    lines = [
        f"| scenario | n | reached | {' | '.join(told)} | {' | '.join(shown)} | delay behind s, 10 m/s | posted |",
        f"|---|{'---:|' * (2 + len(kinds) + len(shown) + 2)}",
    ]
    for name, part in rows.groupby("scenario"):
        by_kind = [part[(part["method"] == method) & (part["speed"] == speed)] for method, speed in kinds]
        cells = [str(len(part)), str((part["outcome"] == "REACHED_GOAL").sum())]
        cells += [f"{drives['driven_min_clearance_devices_m'].min():.2f}" for drives in by_kind]
        cells += [format(CHOICES[choice](part[column]), form) for column, choice, form in map(SHOWN.__getitem__, shown)]
        delay = part.groupby("speed")["driven_delay_behind_per_vehicle_s"].median()
        lines.append(f"| {name} | {' | '.join(cells)} | {delay['10']:.2f} | {delay['zone']:.2f} |")
    return "\n".join(lines)


def library_summary(first: str, last: str) -> str:
    """How the drives of the seeds from `first` to `last` ended, in a sentence."""
    rows = _library(first, last)
    reached = int((rows["outcome"] == "REACHED_GOAL").sum())
    least = rows.groupby("method")["driven_min_clearance_devices_m"].min()
    return (
        f"the ego\n  reached its goal in {reached} of {len(rows)} drives. On `lanes` maps it left {least['lanes']:.2f} m "
        f"and more to every device, on `swept`\n  maps {least['swept']:.2f} m."
    )


def _library(first: str, last: str) -> pd.DataFrame:
    rows = pd.read_csv(RESULTS / "library_drives.csv", dtype={"speed": str})
    return rows[rows["seed"].between(int(first), int(last))]
