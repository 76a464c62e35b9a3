"""Tracking, margins and cost of the controllers and the plants. Prints tables; takes about two minutes on one core.

    python analysis/benchmarks/control.py

Peers, where they are installed: commonroad-vehicle-models (single track) and simple-pid.
"""

import math
import statistics
import time
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from itertools import product

import numpy as np

from wzsumo.control.controller import Controller, ControlSpec, allow_for_slip
from wzsumo.control.pid import PaperPidMemory, PaperPidSpec, paper_pid
from wzsumo.control.plant import PlantSpec, advance_ego
from wzsumo.ego import Command, EgoState
from wzsumo.path import ReferencePath
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
DT = 0.05
LATE = {"steering_lag_s": 0.2, "command_delay_s": 0.1, "max_steering_rate_radps": 0.4}
PAPER = ControlSpec(lateral="paper", longitudinal="paper")


def work_zone_path() -> ReferencePath:
    """Merging taper 3.66 m over 219 m, shifting taper 3.66 m over 110 m, and back: quintic steps."""
    x = np.arange(0.0, 900.5, 0.5)
    y, slope = np.zeros_like(x), np.zeros_like(x)
    for start, length, offset in ((93.0, 219.0, -3.66), (373.0, 110.0, -3.66), (680.0, 110.0, 3.66)):
        u = np.clip((x - start) / length, 0, 1)
        y += offset * u**3 * (10 - 15 * u + 6 * u**2)
        slope += offset / length * 30 * u**2 * (1 - u) ** 2
    return ReferencePath(poses=np.column_stack([x, y, np.arctan(slope)]))


def curved_path() -> ReferencePath:
    """Bends of 300 m radius to the left and to the right, with clothoids of 80 m."""
    step = 0.5
    s = np.arange(0.0, 900.5, step)
    bends = np.interp(s, [100, 180, 400, 480], [0, 1, 1, 0]) - np.interp(s, [500, 580, 800, 880], [0, 1, 1, 0])
    heading = np.concatenate([[0], np.cumsum((bends[1:] + bends[:-1]) / 2 * step / 300)])
    mean = (heading[1:] + heading[:-1]) / 2
    xy = np.vstack([[0, 0], np.cumsum(step * np.column_stack([np.cos(mean), np.sin(mean)]), axis=0)])
    return ReferencePath(poses=np.column_stack([xy, heading]))


PATHS = {"work zone": work_zone_path(), "R 300 m": curved_path()}


def regulated(plant: PlantSpec, speed: float, *, aware: bool = True, **rules: float) -> ControlSpec:
    """The regulated law, aware of the plant's slip or not."""
    spec = ControlSpec.model_validate({"target_speed_mps": speed, "regulated": rules})
    return allow_for_slip(spec, plant=plant) if aware else spec


def drive(
    path: ReferencePath, control: ControlSpec, plant: PlantSpec, *, speed: float, noise_m: float = 0.0, seconds: float = 200.0
) -> dict[str, np.ndarray]:
    """Log of a drive from the path's start; cross-track error is that of the true position, the controller sees noise."""
    controller, truth = Controller(path, CAR, control), Controller(path, CAR, control)
    rng = np.random.default_rng(1)
    state = EgoState(x=path.poses[0, 0], y=path.poses[0, 1], heading=path.poses[0, 2], speed=speed)
    rows = []
    for _ in range(int(seconds / DT)):
        x, y = (state.x, state.y) + noise_m * rng.standard_normal(2)
        seen = EgoState(x=x, y=y, heading=state.heading, speed=state.speed, steering=state.steering)
        command = controller.command(seen, dt=DT)
        if noise_m:
            truth.command(state, dt=DT)
        error = truth.cross_track_m if noise_m else controller.cross_track_m
        rows.append((error, state.steering, state.speed, command.throttle - command.brake, controller.station_m))
        if controller.reached_end or abs(error) > 10:
            break
        state = advance_ego(state, command, dt=DT, vehicle=CAR, spec=plant)
    return dict(zip(("error", "steering", "speed", "pedal", "station"), np.array(rows).T, strict=True))


def tracking() -> None:
    """The bar: cross-track <= 0.2 m at 10 and 24 m/s with 0.2 s steering lag and 0.1 s delay; paper < 0.05 m, ideal car."""
    print(
        "path        law        car                         m/s  max|error| m  rms m   steering rms after the last taper, deg"
    )
    for name, path in PATHS.items():
        cases = [("paper", "ideal", PlantSpec(), 10.0, PAPER), ("paper", "late", PlantSpec(**LATE), 10.0, PAPER)]
        cases += [("regulated", "ideal", PlantSpec(), speed, regulated(PlantSpec(), speed)) for speed in (10.0, 24.0)]
        for body, speed in product(("kinematic", "single_track"), (10.0, 24.0)):
            plant = PlantSpec.model_validate({"body": body, **LATE})
            cases.append(("regulated", f"late {body}", plant, speed, regulated(plant, speed)))
            if body == "single_track":
                unaware = regulated(plant, speed, aware=False)
                cases.append(("regulated", f"late {body}, unaware", plant, speed, unaware))
        for law, car, plant, speed, control in cases:
            log = drive(path, control, plant, speed=speed)
            settled = log["steering"][log["station"] > 845]
            tail = np.rad2deg(settled.std()) if name == "work zone" and settled.size else math.nan
            rms = np.sqrt(np.mean(log["error"] ** 2))
            print(f"{name:11} {law:10} {car:27} {speed:3.0f}  {np.abs(log['error']).max():12.3f} {rms:6.3f}   {tail:.4f}")


def largest_delay(control: Callable[[PlantSpec], ControlSpec], *, speed: float, **plant: float | str) -> float:
    """Largest delay [s] of the command, to 0.02 s, with which the error in the work zone stays below 0.3 m."""
    good, bad = -0.02, 1.0
    while bad - good > 0.03:
        delay = round((good + bad) / 2 / 0.02) * 0.02
        car = PlantSpec.model_validate(plant | {"command_delay_s": delay})
        fits = np.abs(drive(PATHS["work zone"], control(car), car, speed=speed)["error"]).max() < 0.3
        good, bad = (delay, bad) if fits else (good, delay)
    return good


def margins() -> None:
    """How much delay each law stands."""
    print("\nlargest delay with error < 0.3 m, s     no lag   lag 0.2 s   single track   single track, lag 0.2 s")
    laws: dict[str, Callable[[PlantSpec], ControlSpec]] = {"paper, 10 m/s": lambda _: PAPER}
    for speed, lookahead, prediction in product((10.0, 24.0), (0.6, 0.8, 1.2), (0.0, 0.2)):
        laws[f"{lookahead} s ahead, predicted {prediction} s, {speed:.0f} m/s"] = partial(
            regulated, speed=speed, lookahead_time_s=lookahead, prediction_s=prediction
        )
    for name, law in laws.items():
        speed = 24.0 if "24" in name else 10.0
        values = [
            largest_delay(law, speed=speed, body=body, steering_lag_s=lag)
            for body, lag in product(("kinematic", "single_track"), (0.0, 0.2))
        ]
        print(f"{name:38}  {values[0]:5.2f}  {values[1]:9.2f}  {values[2]:12.2f}  {values[3]:14.2f}")


def noise() -> None:
    """White noise of position at each step: the worst that a localisation can do to a pursuit."""
    print("\nwork zone, 10 m/s")
    print("noise m  law         look-ahead  car        steering rms deg  lateral acc. rms m/s2  max|error| m")
    cases: list[tuple[str, str, float, PlantSpec]] = [
        ("paper", "ideal", math.nan, PlantSpec()),
        ("paper", "0.4 rad/s", math.nan, PlantSpec(max_steering_rate_radps=0.4)),
    ]
    cases += [("regulated", "late", lookahead, PlantSpec(**LATE)) for lookahead in (0.4, 0.6, 0.8, 1.2)]
    for sigma, (law, car, lookahead, plant) in product((0.05, 0.2), cases):
        control = PAPER if law == "paper" else regulated(plant, 10.0, lookahead_time_s=lookahead)
        log = drive(PATHS["work zone"], control, plant, speed=10.0, noise_m=sigma)
        lateral = log["speed"] ** 2 * np.tan(log["steering"]) / CAR.wheelbase_m
        print(
            f"{sigma:7} {law:11} {lookahead:7.1f} s    {car:9}  {np.rad2deg(log['steering'].std()):8.2f}  "
            f"{lateral.std():18.2f}  {np.abs(log['error']).max():16.3f}"
        )


def speed_control() -> None:
    """What the paper's PID does under each reading of its units."""
    print("\nunit   time base  power-train lag s  speed at the end m/s (10 wanted)  pedal std")
    straight = ReferencePath(poses=np.array([[0.0, 0.0, 0.0], [1000.0, 0.0, 0.0]]))
    for unit, base, lag in product(("m/s", "km/h"), ("seconds", "steps"), (0.0, 0.3)):
        pid = PaperPidSpec.model_validate({"error_unit": unit, "time_base": base})
        control = PAPER.model_copy(update={"pid": pid})
        log = drive(straight, control, PlantSpec(powertrain_lag_s=lag), speed=10.0, seconds=60)
        print(f"{unit:6} {base:9}  {lag:17}  {log['speed'][-200:].mean():32.2f}  {log['pedal'][-200:].std():9.3f}")


def tuned_gains() -> None:
    """Overshoot from rest to 24 m/s and undershoot from 24 to 10 m/s, the worst over power trains; time to 0.1 m/s."""
    print("\ntuned PID: kp 1/s  ki 1/s2   kd   overshoot m/s  undershoot m/s  settled s")
    straight = ReferencePath(poses=np.array([[0.0, 0.0, 0.0], [5000.0, 0.0, 0.0]]))
    for kp, ki, kd in product((0.8, 1.0, 1.2), (0.1, 0.2, 0.3), (0.0, 0.1, 0.3)):
        gains = {"kp_1ps": kp, "ki_1ps2": ki, "kd": kd}
        over: list[float] = []
        under: list[float] = []
        settled: list[float] = []
        for lag in (0.3, 0.5):
            plant = PlantSpec(powertrain_lag_s=lag, command_delay_s=0.1)
            for start, target in ((0.0, 24.0), (24.0, 10.0)):
                control = ControlSpec.model_validate({"target_speed_mps": target, "tuned": gains})
                speed = drive(straight, control, plant, speed=start, seconds=40)["speed"]
                (over if start == 0 else under).append(speed.max() - target if start == 0 else target - speed.min())
                settled.append((np.flatnonzero(np.abs(speed - target) > 0.1)[-1] + 1) * DT)
        print(f"{kp:16.1f} {ki:8.1f} {kd:6.1f} {max(over):12.2f} {max(under):15.2f} {max(settled):11.1f}")


def median_us(action: Callable[[], object], *, repeats: int = 11, calls: int = 300) -> float:
    """Median over repeats of the time of one call [us]."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        for _ in range(calls):
            action()
        times.append((time.perf_counter() - begin) / calls * 1e6)
    return statistics.median(times)


def cost() -> None:
    """Time of one control step and of one plant step."""
    state = EgoState(x=400.0, y=-3.8, heading=0.0, speed=10.0)
    push = Command(throttle=0.2, brake=0.0, steering=0.01)
    print("\none step of 0.05 s                      median us (n = 11 x 300)")
    for name, control in (("controller, paper", PAPER), ("controller, regulated", ControlSpec())):
        controller = Controller(PATHS["work zone"], CAR, control)
        print(f"{name:38} {median_us(partial(controller.command, state, dt=DT)):8.1f}")
    for body in ("kinematic", "single_track"):
        plant = PlantSpec.model_validate({"body": body, **LATE})
        moving = advance_ego(state, push, dt=DT, vehicle=CAR, spec=plant)
        took = median_us(partial(advance_ego, moving, push, dt=DT, vehicle=CAR, spec=plant))
        print(f"{'plant, ' + body:38} {took:8.1f}")
    if find_spec("vehiclemodels"):
        from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
        from vehiclemodels.vehicle_dynamics_st import vehicle_dynamics_st

        parameters, six = parameters_vehicle2(), [0.0, 0.0, 0.01, 10.0, 0.0, 0.0, 0.0]
        took = median_us(lambda: [vehicle_dynamics_st(six, [0.0, 0.1], parameters) for _ in range(5)])
        print(f"{'commonroad single track, 5 Euler steps':38} {took:8.1f}")
    else:
        print("commonroad-vehicle-models: not installed")
    memory = PaperPidMemory(errors=(0.1,) * 10)
    print(f"{'PID of the paper':38} {median_us(lambda: paper_pid(memory, 0.1, dt=DT, spec=PaperPidSpec())):8.1f}")
    if find_spec("simple_pid"):
        from simple_pid import PID

        peer = PID(0.5, 0.018, 0.4, setpoint=10.0, sample_time=None, output_limits=(-1, 1))
        print(f"{'simple-pid':38} {median_us(lambda: peer(9.9, dt=DT)):8.1f}")
    else:
        print("simple-pid: not installed")


if __name__ == "__main__":
    tracking()
    margins()
    noise()
    speed_control()
    tuned_gains()
    cost()
