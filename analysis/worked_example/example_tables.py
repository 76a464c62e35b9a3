"""The figures of docs/guide/worked_example.md from prairie_center.json."""

import json
from pathlib import Path

RESULTS = Path(__file__).parents[2] / "docs" / "results"


def ends() -> str:
    """Where the zone was announced, where the drivers marked it, and where the map has it."""
    found = json.loads((RESULTS / "prairie_center.json").read_text(encoding="utf-8"))
    said, marked, mapped = found["announced"], found["marked"], found["verified"]
    by_drivers = [f"{marked[end]['mean_m']:.0f} ± {marked[end]['sd_m']:.0f}" for end in ("start", "end")]
    by_map = [f"{mapped[f'{end}_m']:.0f} ± {mapped[f'{end}_sd_m']:.0f}" for end in ("start", "end")]
    return "\n".join([
        "| [m along the road] | start | end |", "|---|---|---|",
        f"| announced, estimated (± {said['start_sd_m']:.0f}) | {said['start_m']:.0f} | {said['end_m']:.0f} |",
        f"| marked by the drivers, n = {marked['start']['n']} (mean ± standard deviation) | {' | '.join(by_drivers)} |",
        f"| the map (± standard deviation) | {' | '.join(by_map)} |",
    ])  # fmt: skip


def apart() -> str:
    """How far what was announced lies from what the drivers marked, in a sentence."""
    found = json.loads((RESULTS / "prairie_center.json").read_text(encoding="utf-8"))
    said, marked = found["announced"], found["marked"]
    late, early = marked["start"]["mean_m"] - said["start_m"], said["end_m"] - marked["end"]["mean_m"]
    return f"The lane was closed {late:.0f} m later than announced, and opened {early:.0f} m earlier."
