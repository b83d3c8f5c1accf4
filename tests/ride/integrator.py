"""A ride by Runge-Kutta, written from the equations of motion alone; it shares nothing with `fourpole.ride`."""

import numpy as np

WK = (  # natural frequency [Hz], and the coefficients of s², s and 1 of each numerator and damping of each denominator
    (0.4, (1, 0, 0), np.sqrt(2)), (100.0, (0, 0, 1), np.sqrt(2)), (12.5, (0, 1, 1), 1 / 0.63),
    (3.35, None, 1 / 0.91),
)  # fmt: skip


def weighting_stage(u, state, at):
    """Output and derivative of the state of one filter of Wk, in phase variables."""
    f, top, damping = WK[at]
    w = 2 * np.pi * f
    x0, x1 = state
    x2 = u - damping * w * x1 - w**2 * x0
    if top is None:
        v = 2 * np.pi * 2.37
        return x2 + v / 0.91 * x1 + v**2 * x0, (x1, x2)
    return top[0] * x2 + top[1] * w * x1 + top[2] * w**2 * x0, (x1, x2)


def integrate_half(car, k1, k2, tau, roads, step, fine):
    """Seat acceleration and dynamic load of both wheels of a half car, on tyres with one arm, by Runge-Kutta.

    `car` has the keys of the vehicle; coordinates are the heights of both ends of the body and of both wheels.
    """
    a, b = car["front_distance"], car["rear_distance"]
    k = np.array([car[f"{side}_suspension_stiffness"] for side in ("front", "rear")])
    c = np.array([car[f"{side}_suspension_damping"] for side in ("front", "rear")])
    m = np.array([car[f"{side}_unsprung_mass"] for side in ("front", "rear")])
    arms, h = np.array([a, -b]), step / fine

    def rates(y, height):
        heave, pitch, v, spin = y[:4]
        wheels, speeds, z = y[4:6], y[6:8], y[8:10]
        strut = k * (wheels - heave - arms * pitch) + c * (speeds - v - arms * spin)
        x = height - wheels
        load = k1 * x + k2 * (x - z)
        up, turn = strut.sum() / car["sprung_mass"], arms @ strut / car["pitch_inertia"]
        change = np.concatenate([[v, spin, up, turn], speeds, (load - strut) / m, (x - z) / tau])
        return change, (up + car["seat_ahead"] * turn, *load)

    y, out = np.zeros(10), []
    for at in range(roads.shape[1]):
        out.append(rates(y, roads[:, at] - roads[:, 0])[1])
        if at == roads.shape[1] - 1:
            break
        rise = (roads[:, at + 1] - roads[:, at]) / fine
        for part in range(fine):
            low = roads[:, at] - roads[:, 0] + part * rise
            one = rates(y, low)[0]
            two = rates(y + h / 2 * one, low + rise / 2)[0]
            three = rates(y + h / 2 * two, low + rise / 2)[0]
            four = rates(y + h * three, low + rise)[0]
            y = y + h / 6 * (one + 2 * two + 2 * three + four)
    return np.array(out).T


def integrate(car, k1, arms, road, step, fine, *, lift=False, static=None, damper=0.0):
    """Weighted acceleration, acceleration, tyre force and deflection at each sample of a quarter car.

    `arms` are pairs of a spring and a relaxation time, `damper` stands beside k1. `static` replaces k1 by a function.
    The road is straight between its samples. With `lift` the road does not pull; a tyre of arms alone is free then.
    """
    ms, mu, ks, cs = car
    springs, times = (np.array(one, dtype=float) for one in zip(*arms, strict=True)) if arms else (np.zeros(0),) * 2
    weight = (ms + mu) * 9.80665
    size = 4 + springs.size
    h = step / fine

    def tyre(x, rate, z):
        rest = static(x) if static is not None else weight + k1 * x
        return rest + damper * rate + np.sum(springs * (x - z))

    def free(z, guess):
        low, high = guess - 0.2, guess + 0.2
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if tyre(middle, 0.0, z) < 0 else (low, middle)
        return 0.5 * (low + high)

    def rates(t, y, place):
        zs, vs, zu, vu = y[:4]
        z, filters = y[4:size], y[size:].reshape(4, 2)
        part = t / step - place
        height = road[place] + part * (road[place + 1] - road[place]) - road[0]
        slope = (road[place + 1] - road[place]) / step
        x = height - zu
        force = tyre(x, slope - vu, z)
        if lift and force < 0:
            x, force = free(z, x), 0.0
        strut = ks * (zu - zs) + cs * (vu - vs)
        a = strut / ms
        u, moving = a, []
        for at in range(4):
            u, change = weighting_stage(u, filters[at], at)
            moving.extend(change)
        wheel = (force - weight - strut) / mu
        return np.concatenate([[vs, a, vu, wheel], (x - z) / times, moving]), (u, a, force, x)

    y, out = np.zeros(size + 8), []
    for at in range(road.size):
        out.append(rates(at * step, y, min(at, road.size - 2))[1])
        if at == road.size - 1:
            break
        for part in range(fine):
            t = at * step + part * h
            one = rates(t, y, at)[0]
            two = rates(t + h / 2, y + h / 2 * one, at)[0]
            three = rates(t + h / 2, y + h / 2 * two, at)[0]
            four = rates(t + h, y + h * three, at)[0]
            y = y + h / 6 * (one + 2 * two + 2 * three + four)
    return np.array(out).T
