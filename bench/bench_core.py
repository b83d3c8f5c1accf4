"""Speed of the core beside peers that do the same work: python bench/bench_core.py."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

# One thread of linear algebra for all, else the times tell what else the machine is doing.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import lmfit
import numpy as np
import polars as pl
import pyfar
import pyFRF
import skrf
from ieee_1057 import ieee_1057
from promises import report
from scipy import signal
from scipy.optimize import curve_fit, least_squares
from side_by_side import Row, agree, compare, kept, show

import fourpole
from fourpole import twoport
from fourpole.core.demodulation.tracks import tracks_of
from fourpole.core.phasor import Phasors
from fourpole.core.spectra.average import cross_spectra
from fourpole.core.tyre import transmissibility, zener_mobility, zener_stiffness
from fourpole.io.columns import read_columns

SEED = 1982
STIFFNESS = {"k1": 180e3, "k2": 120e3, "c": 700.0}
MASS, PRELOAD = 15.0, 12440.0
REFERENCE_IMPEDANCE = 1e3  # N s/m, in the middle of the rig's, where scikit-rf loses fewest digits
FREQUENCIES = 100_000
#: Work and peer -> how many times faster at least.
PROMISED = {
    ("demodulate, 10 harmonics", "scipy curve_fit, per channel"): 5.0,
    ("demodulate, 10 harmonics", "IEEE 1057 by QR, per channel"): 5.0,
    ("cascade, product of parts", "scikit-rf **"): 1.0,
    ("cascade, from values", "scikit-rf Network, **, .a"): 1.5,
    ("de-embed m and K3", "scikit-rf .inv, **, .a"): 20.0,
    ("H1 and coherence, 58 segments", "pyFRF"): 2.0,
    ("H1 and coherence, 58 segments", "scipy csd, welch"): 2.0,
    ("identify 1000 tests", "scipy least_squares, loop"): 25.0,
    ("read 1 000 000 rows x 4", "polars read_csv"): 0.3,
    ("read 1 000 000 rows x 4", "numpy loadtxt"): 1.0,
}

NOTES = {
    "demodulate": """3 channels x 10 000 samples, one frequency, white noise of 1 %. The peers fit a sine of 4
        parameters to each channel by itself, from good starts. Fourpole finds the frequency itself, fits one to all
        channels with harmonics and a cubic drift, looks for hum and gives the 6x6 covariance. Difference: of
        amplitudes, in their standard uncertainty; what one model has and the other has not (harmonics, drift, a
        frequency of its own) overlaps with the fundamental by about 1 / (pi 103 cycles), 21 terms thus by 0.015;
        five times that is 0.08. The fit of IEEE 1057 has ten harmonics, a mean and the frequency, by scipy's lstsq
        (gelsy) from a good start until the frequency changes by less than 1e-9, and ends with residual variance and
        covariance. pyfar gives the values of one bin, on which the frequency lies here, and no covariance.""",
    "cascade": f"""spring K*, mass and preload spring at 100 000 frequencies; force and velocity in place of voltage and
        current make a four-pole an ABCD matrix, z0 is {REFERENCE_IMPEDANCE:g} N s/m. 'product': of parts, or Networks,
        at hand. 'from values': K*, m, K3 to the chain's four-pole; a Network converts to S and back. Difference: of
        the four-poles, each entry relative; round-off (2e-16), ten operations, an entry near zero (1e4). Half of the
        peer's time goes to asking for memory anew: in a process that keeps it, 'product' has half this ratio.""",
    "de-embed": """mass and preload spring taken off that chain, both at hand as four-poles and as Networks; ends with
        the tyre's four-pole. Difference: of K* from the truth, Fourpole's and the peer's; round-off (2e-16), ten
        operations, the tyre's small share of the chain (2e5).""",
    "H1 and coherence": """2 channels x 120 000 samples, 58 Hann windows of 4096 that overlap by half. pyFRF's H1 is a
        receptance, and it transforms on all processors; the class of sdypy.FRF is the same. Difference: of H1 and of
        the coherence, relative, from the third bin on; its window is symmetric, which differs by 1/4096. More than half
        of its time goes to asking for memory anew: in a process that keeps it, as one that has freed large arrays, this
        ratio is 1.5.""",
    "identify": """1000 tests. The loop solves R, I for K2, C (start at 0.7 of the truth) and stops there; Fourpole also
        gives K*, TR and all covariances, from noise, rig and K1. Difference: of K2 and C, relative; round-off, the
        condition of K2 (1e4), and room for the peer's last step.""",
    "read": """1 000 000 rows x 4 columns of CSV with a header, in the page cache, all columns. Fourpole also finds
        delimiter, header and units, and checks that every row is whole. Difference: none, as a decimal has one nearest
        float.""",
}


def demodulation() -> list[Row]:
    rng = np.random.default_rng(SEED)
    rate, count, frequency, noise = 1000.0, 10_000, 10.3, 0.01
    time = (np.arange(count) - 0.5 * (count - 1)) / rate  # from the middle: amplitudes are those at time 0
    truth = np.array([60.0 * np.exp(1.5j), 0.06, 0.08 * np.exp(-0.1j)])
    signals = (truth[:, None] * np.exp(2j * np.pi * frequency * time)).real
    signals += noise * np.abs(truth)[:, None] * rng.standard_normal(signals.shape)
    recording = fourpole.Recording.from_arrays(time, force_in=signals[0], motion_in=signals[1], motion_out=signals[2])

    def wave(t, cosine, sine, omega, mean):
        return cosine * np.cos(omega * t) - sine * np.sin(omega * t) + mean

    starts = [
        {"cosine": 0.9 * x.real, "sine": 0.9 * x.imag + 0.1 * abs(x), "omega": 2 * np.pi * 10.29, "mean": 0.0}
        for x in truth
    ]
    model = lmfit.Model(wave)

    def by_curve_fit():
        found = [curve_fit(wave, time, x, p0=list(p.values()))[0] for x, p in zip(signals, starts, strict=True)]
        return np.array([p[0] + 1j * p[1] for p in found])

    def by_lmfit():
        found = [model.fit(x, t=time, **p).params for x, p in zip(signals, starts, strict=True)]
        return np.array([p["cosine"].value + 1j * p["sine"].value for p in found])

    def by_ieee_1057():
        return np.array([ieee_1057(time, x, 2 * np.pi * 10.3001, harmonics=10)[0] for x in signals])

    found = fourpole.demodulate(recording).phasors
    std = np.hypot(found.std[0::2], found.std[1::2])

    def by_pyfar():
        spectra = pyfar.Signal(signals, rate, fft_norm="amplitude")
        at = spectra.find_nearest_frequency(10.3)
        return spectra.freq[:, at] * np.exp(-2j * np.pi * spectra.frequencies[at] * time[0])

    def apart(amplitudes):
        return agree(float(np.max(np.abs(amplitudes - found.amplitudes) / std)), 0.08)

    peers = {
        "scipy curve_fit, per channel": (by_curve_fit, apart(by_curve_fit())),
        "lmfit, per channel": (by_lmfit, apart(by_lmfit())),
        "IEEE 1057 by QR, per channel": (by_ieee_1057, apart(by_ieee_1057())),
        "pyfar, a bin of the spectra": (by_pyfar, apart(by_pyfar())),
    }
    return [
        *compare("demodulate, 10 harmonics", lambda: fourpole.demodulate(recording), peers, rounds=15),
        *compare("demodulate, 1 harmonic", lambda: fourpole.demodulate(recording, harmonics=1), peers, rounds=15),
    ]


def four_poles() -> list[Row]:
    frequency = np.linspace(1.0, 100.0, FREQUENCIES)
    omega = 2 * np.pi * frequency
    stiffness = zener_stiffness(**STIFFNESS, omega=omega)
    grid = skrf.Frequency.from_f(frequency, unit="hz")

    def network(part):
        return skrf.Network(frequency=grid, a=part, z0=REFERENCE_IMPEDANCE)

    def parts():
        return twoport.spring(stiffness, omega), twoport.mass(MASS, omega), twoport.spring(PRELOAD, omega)

    tyre, mass, preload = parts()
    tyre_network, mass_network, preload_network = map(network, parts())

    def product():
        return tyre_network**mass_network**preload_network

    def from_values():
        first, second, third = map(network, parts())
        return (first**second**third).a

    chain, rig = twoport.cascade(tyre, mass, preload), twoport.cascade(mass, preload)
    chain_network, rig_network = network(chain), network(rig)

    def without_rig():
        return (chain_network**rig_network.inv).a

    same = agree(float(np.max(np.abs(from_values() / chain - 1))), 3e-11)
    ours, theirs = (
        float(np.max(np.abs(1j * omega / found[:, 1, 0] / stiffness - 1)))
        for found in (twoport.deembed(chain, after=rig), without_rig())
    )
    error = f"{ours:.0e} and {agree(theirs, 5e-10)}"
    return [
        *compare(
            "cascade, product of parts",
            lambda: twoport.cascade(tyre, mass, preload),
            {"scikit-rf **": (product, same)},
            rounds=15,
        ),
        *compare(
            "cascade, from values",
            lambda: twoport.cascade(*parts()),
            {"scikit-rf Network, **, .a": (from_values, same)},
            rounds=15,
        ),
        *compare(
            "de-embed m and K3",
            lambda: twoport.deembed(chain, after=rig),
            {"scikit-rf .inv, **, .a": (without_rig, error)},
            rounds=5,
        ),
    ]


def random_excitation() -> list[Row]:
    rng = np.random.default_rng(SEED)
    rate, count, size = 2000, 120_000, 4096
    force = rng.standard_normal(count)
    motion = np.convolve(force, np.exp(-np.arange(50) / 5.0), "same") + 0.1 * rng.standard_normal(count)
    recording = fourpole.Recording.from_arrays(np.arange(count) / rate, force_in=force, motion_in=motion)
    (track,) = tracks_of(recording, ["force_in", "motion_in"])

    def ours():
        spectra = cross_spectra(track, size / rate, (3.0 * rate / size, 0.49 * rate))
        return spectra.matrix[:, 1, 0] / spectra.matrix[:, 0, 0].real, spectra.coherence(0, 1)

    def by_pyfrf():
        peer = pyFRF.FRF(
            rate, exc=force, resp=motion, exc_type="f", resp_type="v", window="hann",
            fft_len=size, nperseg=size, noverlap=size // 2,
        )  # fmt: skip
        return peer.get_H1().ravel(), peer.get_coherence().ravel()

    def by_scipy():
        keys = {"fs": rate, "window": "hann", "nperseg": size, "noverlap": size // 2}
        cross = signal.csd(force, motion, **keys)[1]
        own = [signal.welch(x, **keys)[1] for x in (force, motion)]
        return cross / own[0], np.abs(cross) ** 2 / (own[0] * own[1])

    (mine, alike), (receptance, other) = ours(), by_pyfrf()
    kept = slice(3, 3 + mine.size)
    theirs = receptance[kept] * 2j * np.pi * np.arange(kept.start, kept.stop) * rate / size
    same = agree(max(float(np.max(np.abs(a / b - 1))) for a, b in ((mine, theirs), (alike, other[kept]))), 1 / size)
    h1, coherence = by_scipy()
    of_scipy = agree(max(float(np.max(np.abs(a[kept] / b - 1))) for a, b in ((h1, mine), (coherence, alike))), 1 / size)
    peers = {"pyFRF": (by_pyfrf, same), "scipy csd, welch": (by_scipy, of_scipy)}
    return compare("H1 and coherence, 58 segments", ours, peers, rounds=15)


def identification() -> list[Row]:
    rng = np.random.default_rng(SEED)
    count = 1000
    frequency = rng.uniform(5.0, 20.0, count)
    omega = 2 * np.pi * frequency
    k1, k2, c = (value * rng.uniform(0.7, 1.4, count) for value in STIFFNESS.values())
    mobility = zener_mobility(k1, k2, c, omega, mass=MASS, preload_stiffness=PRELOAD)
    stiffness = zener_stiffness(k1, k2, c, omega)
    ratio = transmissibility(stiffness, omega, mass=MASS, preload_stiffness=PRELOAD)

    amplitudes = np.stack([0.06 / mobility, np.full(count, 0.06 + 0j), 0.06 * ratio], axis=-1)
    variance = np.repeat(0.5 * (1e-3 * np.abs(amplitudes)) ** 2, 2, axis=-1)
    covariance = variance[:, :, None] * np.eye(6)
    phasors = Phasors(frequency, amplitudes, covariance, np.zeros(count), np.full(count, 60.0))
    rig = fourpole.Rig(
        moving_mass=MASS, preload_stiffness=PRELOAD, std={"moving_mass": 0.1, "preload_stiffness": 100.0}
    )

    def at_once():
        return fourpole.identify(phasors, rig, k1, k1_std=0.01 * k1)

    # Shares of the start are the unknowns, and 'lm' is the method: with SI units scipy's default one stops where it
    # starts, as the gradient is below gtol there; with shares it is up to 8 % off and no faster.
    starts = zip((0.7 * k2).tolist(), (0.7 * c).tolist(), strict=True)
    tests = list(zip(starts, mobility.tolist(), k1.tolist(), omega.tolist(), strict=True))

    def misfit(unknown, start, measured, k1_, omega_):
        k2_, jwc = unknown[0] * start[0], 1j * omega_ * unknown[1] * start[1]
        modelled = 1j * omega_ * (1 / (k1_ + jwc * k2_ / (k2_ + jwc)) + 1 / (PRELOAD - omega_**2 * MASS))
        difference = (modelled - measured) / abs(measured)
        return difference.real, difference.imag

    def one_by_one():
        return np.array([least_squares(misfit, (1.0, 1.0), method="lm", args=test).x * test[0] for test in tests])

    found = at_once()
    arms = np.stack([found.k2, found.c], axis=-1)
    same = agree(float(np.max(np.abs(one_by_one() / arms - 1))), 1e-10)
    return compare("identify 1000 tests", at_once, {"scipy least_squares, loop": (one_by_one, same)}, rounds=5)


def reading(folder: Path) -> list[Row]:
    rng = np.random.default_rng(SEED)
    count = 1_000_000
    names = ["t [s]", "F1 [N]", "V1 [m/s]", "V2 [m/s]"]
    columns = {"t [s]": np.arange(count) / 1000.0}
    columns |= {name: rng.standard_normal(count).round(6) for name in names[1:]}
    file = folder / "recording.csv"
    pl.DataFrame(columns).write_csv(file)

    def ours():
        return read_columns(file, names)

    def by_polars():
        return {name: column.to_numpy() for name, column in pl.read_csv(file).to_dict(as_series=True).items()}

    def by_loadtxt():
        return dict(zip(names, np.loadtxt(file, delimiter=",", skiprows=1, unpack=True), strict=True))

    mine = ours()

    def apart(found):
        return agree(max(float(np.max(np.abs(found[name] - mine[name]))) for name in names), 0.0)

    peers = {"polars read_csv": (by_polars, apart(by_polars())), "numpy loadtxt": (by_loadtxt, apart(by_loadtxt()))}
    return compare("read 1 000 000 rows x 4", ours, peers, rounds=9)


def main() -> None:
    random = random_excitation()  # first, as of a process that has just begun
    rows = [*demodulation(), *four_poles(), *random, *identification()]
    with tempfile.TemporaryDirectory() as folder:
        rows += reading(Path(folder))
    show(rows, NOTES, ["numpy", "scipy", "polars", "lmfit", "pyFRF", "pyfar", "scikit-rf"])
    report(kept(rows, PROMISED))


if __name__ == "__main__":
    main()
