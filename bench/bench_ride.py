"""Speed of rides beside scipy on the same work, and what a thousand rides cost: python bench/bench_ride.py."""

from __future__ import annotations

import os

# One thread of linear algebra for all, else the times tell what else the machine is doing.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import time
from statistics import median

import numpy as np
from promises import Kept, at_most, report
from scipy import signal
from side_by_side import Row, agree, compare, kept, show

from fourpole.campaign.vehicle import vehicle_named
from fourpole.core.recursion import driven
from fourpole.models.maxwell import GeneralisedMaxwell, Zener
from fourpole.ride.response import Condensed, frequencies_of, ride
from fourpole.ride.road import ClassRoad
from fourpole.ride.time import ride_in_time, whole_system

SEED = 1982
STEP, DURATION, SPEED = 1e-3, 60.0, 80 / 3.6
ZENER = (180e3, 120e3, 700.0)
MAXWELL = np.array([150e3, 20e3, 40e3, 60e3, 0.5, 0.02, 1e-3])
#: Peer -> least ratio that is promised.
PROMISED = {"scipy lsim": 100.0}
#: Most time of a thousand rides [s]: on a spectrum by drawn models, and in time over 20 roads by 50 drawn models.
MOST = {"spectrum": 5.0, "time": 20.0}

NOTES = {
    "quarter car": """60 s at 1 kHz of a class C road on a Zener tyre: acceleration, wheel load, suspension travel and
        deflection of the tyre at each sample. Both take the road as straight between samples. Difference: of the output
        that differs most, over its largest value."""
}


def in_time() -> list[Row]:
    body = vehicle_named("golden-car").vehicle.body
    road = ClassRoad.of("C").realisation(DURATION, STEP, SPEED, SEED)
    road -= road[0]
    system = whole_system(body, Zener().state_space(ZENER))
    times = STEP * np.arange(road.size)

    def ours():
        return driven(whole_system(body, Zener().state_space(ZENER)), road[None], STEP)

    def lsim():
        return signal.lsim((system.a, system.b, system.c, system.d), road, times)[1].T

    wanted = lsim()
    off = np.max(np.abs(ours() - wanted), axis=1) / np.max(np.abs(wanted), axis=1)
    return compare("quarter car, 60 s at 1 kHz", ours, {"scipy lsim": (lsim, agree(float(off.max()), 1e-9))}, rounds=5)


def thousand() -> list[Kept]:
    """A thousand rides: draws of a model with three arms on one road class, and draws times roads in time."""
    rng = np.random.default_rng(SEED)
    body, road = vehicle_named("golden-car").vehicle.body, ClassRoad.of("C")
    omega = 2 * np.pi * frequencies_of(road, SPEED)
    draws = MAXWELL * (1 + 0.02 * rng.standard_normal((1000, MAXWELL.size)))

    def on_spectrum():
        vehicle = Condensed.of(body, omega)
        for at in range(0, 1000, 50):
            ride(body, GeneralisedMaxwell(3).stiffness(draws[at : at + 50], omega), road, SPEED, vehicle=vehicle)

    def over_time():
        for seed in range(20):
            height = road.realisation(DURATION, STEP, SPEED, seed)[None]
            for values in draws[:50]:
                ride_in_time(body, GeneralisedMaxwell(3).state_space(values), height, STEP)

    lines = []
    for name, way, rounds in (("spectrum", on_spectrum, 5), ("time", over_time, 1)):
        took = []
        for _ in range(rounds):
            start = time.process_time()
            way()
            took.append(time.process_time() - start)
        what = "drawn models on a road class" if name == "spectrum" else "50 drawn models on 20 roads of 60 s at 1 kHz"
        found = median(took)
        lines.append(at_most(f"1000 rides: {what}", "CPU time", found, MOST[name], f"{found:.2f} ms each", unit="s"))
    return lines


def main() -> None:
    rows = in_time()
    show(rows, NOTES, ["numpy", "scipy"])
    report([*kept(rows, {(row.work, row.peer): PROMISED[row.peer] for row in rows}), *thousand()])


if __name__ == "__main__":
    main()
