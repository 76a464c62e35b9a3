"""The traffic light that lets the two directions of a road take turns on one lane."""

from xml.etree import ElementTree as ET

from wzsumo.units import mps_from_mph
from wzsumo.work_zone import WorkZoneLayout

SIGNAL_ID = "taking_turns"
OWN_LINK = 0  # the signal's link of traffic along the stations
GREEN_S = 30.0  # of a fixed-time signal; chosen by us, of the order used at one-lane sections of a few hundred metres
FLAGGER_GREEN_S = (10.0, 60.0)  # shortest and longest: a flagger keeps the lane open while vehicles keep coming; chosen by us
YELLOW_S = 4.0  # MUTCD 11th ed., Section 4F.17: 3 to 6 s
START_UP_MPS2 = 1.0  # of the slowest vehicle, the loaded truck of `demand`
CLEARING_SPEED_MPS = 10.0  # for which red intervals are timed: slow drivers beside workers, and the ego of the paper


def turns_program(layout: WorkZoneLayout, links: list[ET.Element]) -> ET.Element:
    """The signal's program in SUMO's XML: each link in turn has green and yellow, then all have red until the lane is clear.

    `links` are the connections onto the shared lane, that of traffic along the stations first.
    """
    turns = layout.taking_turns
    if turns is None:
        raise ValueError("no lane of this layout is shared")
    root = ET.Element("tlLogics")
    kind = "static" if turns.control == "signal" else "actuated"
    program = ET.SubElement(root, "tlLogic", id=SIGNAL_ID, programID=turns.control, offset="0", type=kind)
    speed = min(CLEARING_SPEED_MPS, mps_from_mph(layout.work_zone.posted_speed_mph))
    clearance = clearance_s(turns.end - turns.start, speed=speed)
    for number in range(len(links)):
        for light, seconds in (("G", GREEN_S), ("y", YELLOW_S), ("r", clearance)):
            state = "".join(light if link == number else "r" for link in range(len(links)))
            phase = ET.SubElement(program, "phase", duration=f"{seconds:.1f}", state=state)
            if light == "G" and turns.control == "flaggers":
                phase.set("minDur", f"{FLAGGER_GREEN_S[0]:g}")
                phase.set("maxDur", f"{FLAGGER_GREEN_S[1]:g}")
    for number, link in enumerate(links):
        ends = {key: link.attrib[key] for key in ("from", "to", "fromLane", "toLane")}
        ET.SubElement(root, "connection", ends, tl=SIGNAL_ID, linkIndex=str(number))
    return root


def clearance_s(length: float, *, speed: float) -> float:
    """Time [s] in which a vehicle that starts at one stop line has passed the other, `length` [m] further on.

    It accelerates at START_UP_MPS2 to `speed` [m/s]. No vehicle may enter from the other side before that: MUTCD 11th ed.,
    typical application 12, wants red intervals that clear the one-lane section.

    >>> clearance_s(100.0, speed=100.0)  # all of it under acceleration: sqrt(2 x 100 / 1)
    14.142135623730951
    """
    run_up = speed**2 / (2 * START_UP_MPS2)
    if length <= run_up:
        return float((2 * length / START_UP_MPS2) ** 0.5)
    return speed / START_UP_MPS2 + (length - run_up) / speed
