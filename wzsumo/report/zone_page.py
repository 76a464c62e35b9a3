"""zone.html: the lanes of a map on a plain vector map, and what was announced of the zone beside what the traces verify."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wzsumo.announced_zone import AnnouncedZone
from wzsumo.feeds.publication import VERIFIED_WITHIN_M
from wzsumo.feeds.verified import VerifiedZone, verified_zone
from wzsumo.files.lanes import LanesFile
from wzsumo.lane_map import LaneMap
from wzsumo.report.page import page_template
from wzsumo.report.zone_drawings import WIDTHS, detail_drawing, map_drawing

PAGE = "zone.html"
Z_95 = 1.96


@dataclass(frozen=True, kw_only=True)
class Difference:
    """One end of the zone: announced and verified [m along the road], and verified less announced with its 95 % interval."""

    name: str
    announced_m: float
    announced_sd_m: float
    verified_m: float
    verified_sd_m: float

    @property
    def off_m(self) -> float:
        """Verified less announced: positive where it lies farther along the road than announced."""
        return self.verified_m - self.announced_m

    @property
    def interval_m(self) -> tuple[float, float]:
        """95 % interval of that difference, from the map's standard deviation."""
        return self.off_m - Z_95 * self.verified_sd_m, self.off_m + Z_95 * self.verified_sd_m

    @property
    def is_explained(self) -> bool:
        """Whether the accuracy of the announcement and of the map together explain the difference at 95 %."""
        return bool(abs(self.off_m) <= Z_95 * np.hypot(self.announced_sd_m, self.verified_sd_m))


def differences(announced: AnnouncedZone, verified: VerifiedZone) -> tuple[Difference, Difference]:
    """How far the ends of a zone that a map verifies are from those that were announced."""
    start, end = (
        Difference(
            name=name,
            announced_m=getattr(announced, f"{name}_m"),
            announced_sd_m=getattr(announced, f"{name}_sd_m"),
            verified_m=getattr(verified, f"{name}_m"),
            verified_sd_m=getattr(verified, f"{name}_sd_m"),
        )
        for name in ("start", "end")
    )
    return start, end


def zone_page(content: LanesFile, *, announced: AnnouncedZone | None, title: str, words: Sequence[str] = ()) -> str:
    """The page as HTML. `words` are the warnings and notes of the map."""
    lanes, verified = content.lanes, verified_zone(content.lanes)
    compared = differences(announced, verified) if announced and verified else ()
    return page_template("zone.html.j2").render(
        title=title,
        frame=content.frame.as_json() if content.frame else None,
        n_traces=lanes.n_traces,
        maps={kind: map_drawing(content, announced, width=width) for kind, width in WIDTHS.items()},
        details={kind: detail_drawing(lanes, announced, width=width) for kind, width in WIDTHS.items()},
        announced=announced,
        verified=verified,
        compared=compared,
        verified_within_m=VERIFIED_WITHIN_M,
        lanes=_lane_rows(lanes, announced, verified),
        words=[*lanes.warnings, *words],
    )


def write_zone_page(content: LanesFile, folder: Path, *, announced: AnnouncedZone | None, words: Sequence[str] = ()) -> None:
    """Write zone.html."""
    page = zone_page(content, announced=announced, title="Work zone as driven", words=words)
    (folder / PAGE).write_text(page, encoding="utf-8")


def _lane_rows(lanes: LaneMap, announced: AnnouncedZone | None, verified: VerifiedZone | None) -> list[dict[str, Any]]:
    """What was announced and what is verified of each lane, from the left."""
    rows = []
    for number in reversed(range(len(lanes.lanes))):
        said = "not said"
        if announced is not None and announced.closed_lanes is not None:
            said = "closed" if number in announced.closed_lanes else "open"
        found = "open"
        if verified is not None:
            found = "closed" if number in verified.closed_lanes else "shifted" if number in verified.shifted else "open"
        spans = [f"{first:.0f} to {last:.0f} m" for first, last in lanes.closed_intervals(number)]
        rows.append({"lane": number, "announced": said, "verified": found, "closed": ", ".join(spans) or "-",
                     "n_traces": lanes.lanes[number].n_traces})  # fmt: skip
    return rows
