"""Receivers and what is wrong with them: the positions that vehicles report of their true drives.

RECEIVERS are errors by name, a standard deviation [m] on each axis: constant, slowly drifting (Gauss-Markov, 40 s) and white
parts. A mixed crowd has several. FAULTS are what one vehicle of the crowd does beside it.
"""

from dataclasses import dataclass

import numpy as np
from drivers import Drive, gauss_markov
from layouts import Layout, smooth

from wzsumo.frames import FloatArray

BURST_LENGTH_S, BURST_EVERY_S = 4.0, 40.0  # of heavy tails: multipath for some seconds


@dataclass(frozen=True, kw_only=True)
class Receiver:
    """One kind of receiver: total error [m] on each axis, and the shares of its variance that are constant and that drift."""

    error: float
    constant: float = 0.50
    drifting: float = 0.45
    drifts_s: float = 40.0  # correlation time of the drifting part
    bursts: bool = False  # for some seconds the error is drawn from Student's t with 2 degrees of freedom

    def errors(self, t: FloatArray, random: np.random.Generator) -> FloatArray:
        """Errors (n, 2) [m] at times t (n,) [s]."""
        white = 1.0 - self.constant - self.drifting
        slow = np.column_stack([gauss_markov(t, self.drifts_s, random) for _ in range(2)])
        constant, noise = random.standard_normal(2), random.standard_normal((len(t), 2))
        error = self.error * (np.sqrt(self.constant) * constant + np.sqrt(self.drifting) * slow + np.sqrt(white) * noise)
        if self.bursts:
            period = np.floor(t / BURST_LENGTH_S).astype(int)
            _, of_fix = np.unique(period, return_inverse=True)
            jumps = np.clip(random.standard_t(2, (int(of_fix.max()) + 1, 2)), -20, 20) * 2 * self.error
            jumps *= random.random((len(jumps), 1)) < BURST_LENGTH_S / BURST_EVERY_S
            error = error + jumps[of_fix]
        return np.asarray(error)


Crowd = tuple[tuple[float, Receiver], ...]  # (share, receiver)
RECEIVERS: dict[str, Crowd] = {
    "0": ((1.0, Receiver(error=0.0)),),
    "0.5": ((1.0, Receiver(error=0.5)),),
    "1": ((1.0, Receiver(error=1.0)),),
    "2": ((1.0, Receiver(error=2.0)),),
    "2_drift": ((1.0, Receiver(error=2.0, constant=0.0, drifting=1.0)),),
    "mixed": ((0.5, Receiver(error=0.5)), (0.3, Receiver(error=1.5)), (0.2, Receiver(error=4.0))),
    "heavy": ((1.0, Receiver(error=0.5, bursts=True)),),
}  # fmt: skip
FAULTS = ("jump", "stray", "half_change", "truck1", "truck2")
JUMP_M, JUMP_S = 3.6, 7.0
STRAY_M = 5.5  # one and a half lanes to the left, all the way
HALF_CHANGE_M = 1.7


def receiver_of(receivers: str | Crowd, *, seed: int, number: int) -> Receiver:
    """The receiver of vehicle `number` in a crowd, or in that of a name."""
    crowd = RECEIVERS[receivers] if isinstance(receivers, str) else receivers
    drawn = np.random.default_rng([seed, number, 3]).choice(len(crowd), p=[share for share, _ in crowd])
    return crowd[int(drawn)][1]


def reported(drive: Drive, layout: Layout, receiver: Receiver, *, interval_s: float, seed: int, number: int) -> FloatArray:
    """Fixes (n, 3): time [s], x and y [m] that a receiver reports of a drive, one every `interval_s`."""
    random = np.random.default_rng([seed, number, 5])
    t = np.arange(drive.t[0] + random.uniform(0, min(interval_s, 0.5 * np.ptp(drive.t))), drive.t[-1], interval_s)
    xy = layout.to_xy(np.interp(t, drive.t, drive.s), np.interp(t, drive.t, drive.d))
    return np.column_stack([t, xy + receiver.errors(t, random)])


def with_fault(drive: Drive, layout: Layout, fault: str, *, seed: int) -> Drive:
    """The drive as it is reported with a fault of its receiver, or of its driver."""
    s, d = drive.s, drive.d
    if fault == "jump":
        closure = layout.closures[-1] if layout.closures else None
        middle = (closure.at[1] + closure.at[2]) / 2 if closure else layout.length / 2
        begin = float(np.interp(np.random.default_rng([seed, 11]).uniform(middle - 150, middle + 50), s, drive.t))
        during = (drive.t >= begin) & (drive.t < begin + JUMP_S)
        towards = -1.0 if closure and closure.side == "right" else 1.0
        return Drive(t=drive.t, s=s, d=d + towards * JUMP_M * during)
    if fault == "stray":
        return Drive(t=drive.t, s=s, d=d + STRAY_M)
    if fault == "half_change":
        return Drive(t=drive.t, s=s, d=d + HALF_CHANGE_M * (1.0 - smooth((s - s[0]) / 100.0)))
    raise ValueError(f"fault {fault!r}: must be one of {', '.join(FAULTS)}")
