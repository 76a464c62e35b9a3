"""The stretches of a zone one after the other, tapers, tangents, buffer, activity area, and the lines at the end of each.

Offsets e are counted from the open side, see `closure`.
"""

from dataclasses import dataclass, field, replace
from typing import Any

from wzsumo.errors import SpecError
from wzsumo.mutcd.closure import Closure
from wzsumo.mutcd.spacing import SHORT_TAPER_SPACING_FT, tangent_spacing_ft, taper_spacing_ft
from wzsumo.tapers import (
    buffer_length_ft,
    downstream_taper_length_ft,
    merging_taper_length_ft,
    one_lane_two_way_taper_length_ft,
    shifting_taper_length_ft,
    shoulder_taper_length_ft,
)
from wzsumo.units import METRES_PER_FOOT, feet_from_metres
from wzsumo.work_zone import WorkZone

# Between two tapers of one zone, as shares of the merging taper's L. TA-37 draws 2 L between merging tapers; for a
# merging taper followed by a shift no number is printed; chosen by us: the length of the shifting taper, L/2.
TANGENT_BETWEEN_MERGING_TAPERS_L = 2.0
TANGENT_BEFORE_SHIFT_L = 0.5


@dataclass(frozen=True, kw_only=True)
class Lines:
    """Where the lines of a zone lie at one station, offsets e [m]."""

    outer: float | None  # devices along the closed side; None: nothing is closed there
    open_edge: float = 0.0  # edge line of the open side
    gore: tuple[float, float] | None = None  # the two lines of devices around closed lanes between open ones


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """One stretch of the zone: its length [m], its lines at its end, and the largest device spacing on it [m]."""

    name: str
    length: float
    end: Lines
    spacing: float


@dataclass
class _Sequence:
    """The stretches so far; `lines` are where the last one ends."""

    work_zone: WorkZone
    lines: Lines
    stretches: list[Stretch] = field(default_factory=list)

    def add(self, name: str, length_ft: float, *, spacing_ft: float | None = None, **lines: Any) -> None:
        """Append a stretch that ends with some lines changed: in a taper, unless another spacing is given."""
        self.lines = replace(self.lines, **lines)
        if length_ft > 0:
            spacing = (spacing_ft or taper_spacing_ft(self.work_zone.posted_speed_mph)) * METRES_PER_FOOT
            self.stretches.append(Stretch(name=name, length=length_ft * METRES_PER_FOOT, end=self.lines, spacing=spacing))

    def add_tangent(self, name: str, length_ft: float) -> None:
        """Append a stretch along which the lines go straight on."""
        self.add(name, length_ft, spacing_ft=tangent_spacing_ft(self.work_zone.posted_speed_mph))


def stretches_of(work_zone: WorkZone, closure: Closure) -> tuple[Lines, tuple[Stretch, ...]]:
    """(lines where the zone begins, its stretches from there on). Raises SpecError where a shift does not fit."""
    begin = Lines(outer=closure.outer)
    sequence = _Sequence(work_zone=work_zone, lines=begin)
    _close_shoulder(sequence, closure)
    if closure.takes_turns:
        _share_a_lane(sequence, closure)
    elif closure.is_interior:
        _pass_on_both_sides(sequence, closure)
    else:
        _pass_on_one_side(sequence, closure)
    return begin, tuple(sequence.stretches)


def _close_shoulder(sequence: _Sequence, closure: Closure) -> None:
    width_ft = feet_from_metres(closure.outer - closure.travelled)
    length_ft = shoulder_taper_length_ft(sequence.work_zone.posted_speed_mph, offset_ft=width_ft)
    sequence.add("shoulder taper", length_ft, outer=closure.travelled)


def _merge(sequence: _Sequence, closure: Closure) -> float:
    """Close the outermost lanes, as many as the zone closes; returns the last merging taper's L [ft]."""
    zone, merging_ft = sequence.work_zone, 0.0
    for number in range(closure.count):
        outer, inner = closure.lines[closure.n_lanes - number], closure.lines[closure.n_lanes - number - 1]
        merging_ft = merging_taper_length_ft(zone.posted_speed_mph, offset_ft=feet_from_metres(outer - inner))
        if number:
            sequence.add_tangent(
                f"tangent {number}", _given(zone.taper_tangent_ft, TANGENT_BETWEEN_MERGING_TAPERS_L * merging_ft)
            )
        sequence.add(f"merging taper {number + 1}" if number else "merging taper", merging_ft, outer=inner)
    return merging_ft


def _pass_on_one_side(sequence: _Sequence, closure: Closure) -> None:
    zone, speed = sequence.work_zone, sequence.work_zone.posted_speed_mph
    merging_ft = _merge(sequence, closure)
    before_shift = sequence.lines
    shifted = _shifted(zone, closure, before_shift)
    moved_ft = max(zone.shift_ft, feet_from_metres(abs(shifted.open_edge)))
    shift_back_ft = 0.0
    if shifted != before_shift:
        if closure.count:
            sequence.add_tangent("tangent", _given(zone.taper_tangent_ft, TANGENT_BEFORE_SHIFT_L * merging_ft))
        shift_back_ft = shifting_taper_length_ft(speed, offset_ft=moved_ft)
        sequence.add("shifting taper", shift_back_ft, outer=shifted.outer, open_edge=shifted.open_edge)
    _work(sequence)
    sequence.add("shift back", shift_back_ft, outer=before_shift.outer, open_edge=before_shift.open_edge)
    sequence.add(
        "downstream taper",
        downstream_taper_length_ft(max(closure.count, 1), per_lane_ft=zone.downstream_taper_ft),
        spacing_ft=SHORT_TAPER_SPACING_FT,
        outer=closure.travelled if closure.count else closure.outer,
    )


def _pass_on_both_sides(sequence: _Sequence, closure: Closure) -> None:
    """As in TA-38: outer lanes close first; then the traffic that would meet the work moves out to their place."""
    zone = sequence.work_zone
    merging_ft = _merge(sequence, closure)
    inner, outer = closure.lines[closure.first], closure.lines[closure.first + closure.count]
    sequence.add_tangent("tangent", _given(zone.taper_tangent_ft, TANGENT_BEFORE_SHIFT_L * merging_ft))
    shift_ft = shifting_taper_length_ft(zone.posted_speed_mph, offset_ft=feet_from_metres(outer - inner))
    sequence.add("shifting taper", shift_ft, outer=closure.travelled, gore=(inner, outer))
    sequence.lines = replace(sequence.lines, outer=None)
    _work(sequence)
    sequence.add(
        "downstream taper",
        downstream_taper_length_ft(closure.count, per_lane_ft=zone.downstream_taper_ft),
        spacing_ft=SHORT_TAPER_SPACING_FT,
        gore=(inner, inner),
    )


def _share_a_lane(sequence: _Sequence, closure: Closure) -> None:
    """As in TA-10 and TA-12: the own lane closes by a short taper, and its traffic takes turns on the opposing one."""
    zone = sequence.work_zone
    length_ft = one_lane_two_way_taper_length_ft(zone.one_lane_two_way_taper_ft)
    sequence.add("one-lane two-way taper", length_ft, spacing_ft=SHORT_TAPER_SPACING_FT, outer=closure.lines[closure.first])
    _work(sequence)
    downstream_ft = downstream_taper_length_ft(1, per_lane_ft=zone.downstream_taper_ft)
    sequence.add("downstream taper", downstream_ft, spacing_ft=SHORT_TAPER_SPACING_FT, outer=closure.travelled)


def _work(sequence: _Sequence) -> None:
    zone = sequence.work_zone
    sequence.add_tangent("buffer", _given(zone.buffer_ft, buffer_length_ft(zone.posted_speed_mph)))
    sequence.add_tangent("activity area", zone.work_length_ft)


def _given(value: float | None, otherwise: float) -> float:
    return otherwise if value is None else value


def _shifted(work_zone: WorkZone, closure: Closure, lines: Lines) -> Lines:
    """The lines where the open lanes run shifted; the same lines where nothing shifts."""
    width_ft = work_zone.shifted_lane_width_ft
    if work_zone.shift_ft == 0 and width_ft is None:
        return lines
    needed = closure.lines[closure.n_open] if width_ft is None else closure.n_open * width_ft * METRES_PER_FOOT
    device = closure.lines[closure.n_open] - work_zone.shift_ft * METRES_PER_FOOT
    edge = device - needed
    beyond_ft = feet_from_metres(-edge - closure.open_shoulder)
    if beyond_ft > 1e-5:
        raise SpecError(
            f"shift_ft={work_zone.shift_ft:g}: {closure.n_open} open lane(s), {feet_from_metres(needed):.1f} ft wide together, "
            f"would end {feet_from_metres(-edge):.1f} ft beyond the edge line, on a shoulder of "
            f"{feet_from_metres(closure.open_shoulder):.1f} ft; shift by at most "
            f"{work_zone.shift_ft - beyond_ft:.1f} ft or set a smaller shifted_lane_width_ft"
        )
    return replace(lines, outer=device, open_edge=max(edge, -closure.open_shoulder))
