"""Whether the maps of a study reach the bars set beforehand: medians over seeds, none worse with more traces, no bad map.

    python analysis/lane_map/bars.py results/lane_map/rows.csv

Prints, and writes beside the rows as bars.csv: each bar with the medians of its groups (kind, receivers, n, variant, mode), the
worst of them, and how many groups reach it. Then the groups whose median falls by more than FALL with more traces, and the maps
of MANY traces and more with a precision below LEAST_PRECISION.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

FALL = 0.01
FAULT = "fault: "  # begins the error of a map that raised anything but a refusal of its input
MANY, LEAST_PRECISION = 30, 0.90
FOREIGN = ("left", "right", "middle", "double", "shift", "none", "shoulder", "crossover", "crossover_2")
CROWDS = ("0.5", "mixed")
RAMPS = ("on_ramp", "off_ramp")
SENSITIVITIES = ("early_100", "early_300", "late_100", "late_300", "offset_1", "offset_1.5", "offset_2", "truck_1", "truck_2")


@dataclass(frozen=True, kw_only=True)
class Bar:
    """Least medians of precision and IoU of the groups with one of these values each; empty means any."""

    name: str
    precision: float
    iou: float = 0.0
    kinds: tuple[str, ...]
    receivers: tuple[str, ...] = ()
    modes: tuple[str, ...]
    n: tuple[int, ...] = ()
    least_n: int = 0
    variants: tuple[str, ...] = ("exact",)

    def of(self, table: pd.DataFrame) -> pd.DataFrame:
        """The groups of a table that it is about."""
        wanted = table["variant"].isin(self.variants) & table["n"].ge(self.least_n)
        for column, values in (("kind", self.kinds), ("receivers", self.receivers), ("mode", self.modes), ("n", self.n)):
            if values:
                wanted &= table[column].isin(values)
        return table[wanted]


BARS = (
    Bar(name="I-80 joined", precision=0.97, iou=0.93, kinds=("i80",), receivers=("0", "1"), modes=("joined",), least_n=10),
    Bar(name="I-80 alone, clean", precision=0.95, iou=0.88, kinds=("i80",), receivers=("0",), modes=("alone",), least_n=10),
    Bar(name="I-80 alone, 1 m", precision=0.92, iou=0.78, kinds=("i80",), receivers=("1",), modes=("alone",), least_n=30),
    Bar(name="foreign joined", precision=0.96, iou=0.90, kinds=FOREIGN, receivers=CROWDS, modes=("joined",), least_n=30),
    Bar(name="foreign alone", precision=0.94, iou=0.78, kinds=FOREIGN, receivers=CROWDS, modes=("alone",), least_n=30),
    Bar(name="ramps joined", precision=0.95, iou=0.80, kinds=RAMPS, receivers=CROWDS, modes=("joined",), least_n=30),
    Bar(
        name="2 m drift on a bend, joined", precision=0.95, iou=0.90, kinds=("left_r900",), receivers=("2_drift",),
        modes=("joined",), n=(100,),
    ),
    Bar(
        name="2 m drift on a bend, alone", precision=0.93, iou=0.84, kinds=("left_r900",), receivers=("2_drift",),
        modes=("alone",), n=(100,),
    ),
    Bar(name="sensitivities joined", precision=0.93, kinds=(), modes=("joined",), variants=SENSITIVITIES),
)  # fmt: skip


def medians(rows: pd.DataFrame) -> pd.DataFrame:
    """Medians of precision and IoU by group; a failed map counts as 0, one without free ground has no wrong ground."""
    failed = rows["error"].notna()
    filled = rows.assign(precision=rows["precision"].mask(failed, 0.0).fillna(1.0), iou=rows["iou"].mask(failed, 0.0))
    keys = ["kind", "receivers", "variant", "mode", "n"]
    return filled.groupby(keys, as_index=False)[["precision", "iou"]].median()


def reached(table: pd.DataFrame) -> pd.DataFrame:
    """One row a bar: medians over its groups, the least of its groups, and how many of them reach it."""
    rows = []
    for bar in BARS:
        groups = bar.of(table)
        if groups.empty:
            continue
        good = groups["precision"].ge(bar.precision) & groups["iou"].ge(bar.iou)
        row: dict[str, object] = {"bar": bar.name, "groups": len(groups), "reached": int(good.sum())}
        for name in ("precision", "iou"):
            row |= {f"{name}_bar": getattr(bar, name), name: groups[name].median(), f"{name}_least": groups[name].min()}
        worst = groups.sort_values("precision").iloc[0]
        row["least_precision_in"] = " ".join(str(worst[key]) for key in ("kind", "receivers", "n", "variant", "mode"))
        rows.append(row)
    return pd.DataFrame(rows).round(3)


def falls(table: pd.DataFrame) -> Iterator[str]:
    """Where a median falls by more than FALL from some number of traces to the next larger one."""
    for key, part in table.groupby(["kind", "receivers", "variant", "mode"]):
        in_order = part.sort_values("n")
        for name in ("precision", "iou"):
            steps = in_order[name].diff()
            for at in steps.index[steps < -FALL]:
                before, after = in_order[name].shift()[at], in_order[name][at]
                yield f"{' '.join(map(str, key))}: {name} falls from {before:.3f} to {after:.3f} at n = {in_order['n'][at]}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", type=Path, help="rows.csv of measure.py")
    args = parser.parse_args()
    rows = pd.read_csv(args.rows, dtype={"receivers": str})
    table = medians(rows)
    bars = reached(table)
    bars.to_csv(args.rows.with_name("bars.csv"), index=False)
    print(bars.to_string(index=False))
    lost = list(falls(table))
    print(f"\n{len(lost)} medians fall with more traces", *lost, sep="\n  ")
    many = rows[rows["n"].ge(MANY) & rows["variant"].eq("exact")]
    bad = many[many["precision"].lt(LEAST_PRECISION)]
    print(f"\n{len(bad)} of {len(many)} maps of {MANY} traces and more have a precision below {LEAST_PRECISION:.2f}")
    errors = rows["error"].dropna().astype(str)
    print(
        f"{len(errors)} of {len(rows)} maps failed, {sum(text.startswith(FAULT) for text in errors)} of them by a fault of ours"
    )


if __name__ == "__main__":
    main()
