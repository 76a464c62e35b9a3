"""live.html: what a live map noticed, the map before and now, and its evidence over space and time."""

import base64
import io
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from wzsumo.figures.live_figures import evidence_over_time, lanes_before_and_now
from wzsumo.figures.narrow import narrow_png
from wzsumo.files.lanes import read_lanes
from wzsumo.files.output import write_whole
from wzsumo.live.charts.findings import Family
from wzsumo.live.charts.thresholds import calibrated_thresholds
from wzsumo.live.live_map import LiveMap
from wzsumo.live.stream.log_folder import ALARMS, FOLDER, VERSIONS, read_evidence
from wzsumo.report.page import page_template

PAGE = "live.html"
RAREST_PER_TRACE = 1e-9  # chance alarms that are rarer are told as a bound


def write_live_page(folder: Path, live: LiveMap) -> None:
    """Write live.html of a live map's folder."""
    alarms = [json.loads(line) for line in (folder / ALARMS).read_text(encoding="utf-8").splitlines()]
    versions = [json.loads(line) for line in (folder / VERSIONS).read_text(encoding="utf-8").splitlines()]
    first, now = read_lanes(folder / FOLDER / f"{1:06d}"), read_lanes(folder)
    figures = [
        {
            "title": "Lanes", **_images(lanes_before_and_now(first.lanes, now.lanes)),
            "caption": "Offsets are stretched. Broken lines part lanes. Ground without recent witnesses fades to "
            "P(open) = 0.5.",
        }
    ]  # fmt: skip
    numbers, _, shares = read_evidence(folder, len(live.ground.cells))
    if len(numbers) > 1:
        figures.append(
            {
                "title": "Evidence", **_images(evidence_over_time(live.ground.cells, numbers, shares, alarms)),
                "caption": "The strongest evidence for any kind of change at each place, from light (none) to dark (an "
                "alarm's threshold). Orange bars are alarms over their stretch; a black line goes back to the first trace that "
                "supports the alarm.",
            }
        )  # fmt: skip
    html = page_template("live.html.j2").render(
        number=live.number, alarms=[_row(alarm, utc=now.utc) for alarm in alarms], versions=versions, figures=figures,
        error_m=live.error_m, one_in=1 / (len(Family) * calibrated_thresholds().rate_per_trace),
    )  # fmt: skip
    write_whole(folder / PAGE, html.encode())


def _row(alarm: dict[str, Any], *, utc: bool) -> dict[str, Any]:
    since = datetime.fromtimestamp(alarm["since_s"], UTC).strftime("%Y-%m-%d %H:%M:%SZ") if utc else f"{alarm['since_s']:.0f} s"
    return alarm | {
        "start": _with_sd(alarm["start_m"], alarm["start_sd_m"]), "end": _with_sd(alarm["end_m"], alarm["end_sd_m"]),
        "since": since, "once_in": _once_in(alarm["false_alarms_per_trace"]),
    }  # fmt: skip


def _once_in(rate_per_trace: float) -> str:
    """In how many traces chance alone says as much once; very rare chances as a bound."""
    return f"{1 / rate_per_trace:,.0f}" if rate_per_trace > RAREST_PER_TRACE else f"over {1 / RAREST_PER_TRACE:,.0f}"


def _with_sd(value: float | None, sd: float | None) -> str:
    return "" if value is None else f"{value:.0f} ± {sd or 0:.0f}"


def _images(figure: Figure) -> dict[str, str]:
    """The figure for a wide and for a narrow screen, PNG in base64."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    images = {"png": buffer.getvalue(), "narrow": narrow_png(figure)}
    return {name: base64.b64encode(image).decode("ascii") for name, image in images.items()}
