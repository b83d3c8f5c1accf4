"""Tyre property file (.tir) with the vertical block of MF-Tyre 6.1: stiffness over load and pressure, and a damping.

The file format is that of TeimOrbit files: blocks in brackets, KEY = value, comments behind ! and $. Only keys are
written whose values follow from the tests; comments name the others.

References
----------
H. B. Pacejka, "Tire and Vehicle Dynamics", third edition, 2012, eqs (4.E68) and (A3.3).
I. J. M. Besselink, A. J. C. Schmeitz, H. B. Pacejka, "An improved Magic Formula/Swift tyre model that can handle
inflation pressure changes", Vehicle System Dynamics 48, 2010, eqs (3) to (5).
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy

from fourpole import quantities as q
from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.specimen import Form, Specimen
from fourpole.errors import ModelError
from fourpole.export.source import MODEL_FILE, ascii_line, filled
from fourpole.export.systems import belt_note, belt_words
from fourpole.fitting.accuracy import Accuracy
from fourpole.fitting.byamplitude import depends_on_amplitude
from fourpole.fitting.modelfile import ModelFile
from fourpole.fitting.placed import PlacedModel, placed_models, specimens
from fourpole.fitting.query import maps_of
from fourpole.io.write import write_text
from fourpole.quantities import ShownUnits
from fourpole.units import shown
from fourpole.words import first_of

_LOAD, _PRESSURE = q.PRELOAD.head, q.PRESSURE.head
#: Steps to the frequency of the belt, whose spring depends on frequency: each leaves less than a tenth of the error.
_ROUNDS = 20
#: Conditions of the nominal point and the others count as one value within this fraction.
_SAME = 0.02
#: Frequencies at which the comments compare the file with the model; width of the columns; longest line of a comment.
_COMPARED, _WIDTH, _LONGEST = 9, 16, 110


@dataclass(frozen=True, eq=False)
class Vertical(ByValue):
    r"""The vertical stiffness of MF-Tyre 6.1 as it follows from that of some conditions.

    .. math:: K(F, s) = \sqrt{s^2 (K_0^2 - b F_0) + s b F}, \quad s = 1 + p \,\mathrm{dpi}

    is the tangent of its load-deflection curve, with K0 at the nominal load F0 and b = 4 Q_FZ2 F0/R0².

    Attributes
    ----------
    stiffness : float [N/m]
        K0, the one of the nominal point, which the curve takes exactly.
    load_term : float [N/m²]
        b; 0 if the tests show no dependence on load.
    pressure_term : float [1]
        p, PFZ1.
    departure : float [1]
        Largest relative departure of the tangent from the given stiffness.
    """

    stiffness: float
    load_term: float = 0.0
    pressure_term: float = 0.0
    departure: float = 0.0


def write(
    source: ModelFile,
    path: Path,
    points: Sequence[Mapping[str, float]] = (),
    specimen: str | None = None,
    frequency: float | None = None,
    radius: float | None = None,
    belt: Specimen | None = None,
) -> tuple[str, ...]:
    """Write the file of one specimen; the first of `points` is the nominal one; returns notes on what is lost.

    Raises
    ------
    ModelError
        If the frequency is not stated or outside the band, the file has several specimens and none is stated, or K*
        depends on the amplitude of the deflection.
    """
    if frequency is None:
        raise ModelError('a .tir file has one vertical damping: state its frequency, --frequency "20 Hz"')
    nominal, placed = _conditions(source, points, specimen, belt)
    for one in placed:
        if one.map.octaves_beyond([frequency])[0] > 0:
            low, high = one.band
            raise ModelError(
                f"{frequency:.6g} Hz is outside the measured band of {shown(one.label)}, {low:.4g} to {high:.4g} Hz: "
                "state a frequency inside it"
            )
    file = _File(source, placed[nominal], placed, frequency, radius)
    write_text(path, file.text())
    return tuple(file.notes())


def _conditions(
    source: ModelFile, points: Sequence[Mapping[str, float]], specimen: str | None, belt: Specimen | None
) -> tuple[int, list[PlacedModel]]:
    """All conditions of a specimen, and the place of the nominal one."""
    names = specimens(source, MODEL_FILE, specimen)
    if len(names) > 1:
        raise ModelError(f"a .tir file is of one tyre: state --specimen, one of {first_of(list(map(shown, names)), 8)}")
    if depends_on_amplitude(source, names[0]):
        raise ModelError(
            "K* depends on the amplitude of the deflection, which a .tir file cannot hold: fit --model zener"
        )
    mapped = next((one for one in source.maps if one.tyre == names[0] and one.axes), None)
    states: list[Mapping[str, float]] = []
    if mapped is not None:
        tested = maps_of(source, names[0], {}, ShownUnits()).axes
        states = [dict(zip(tested.names, one, strict=True)) for one in tested.points.tolist()]
    every = placed_models(source, MODEL_FILE, states, specimen=names[0], belt=belt)
    if not points:
        return _middle(every), every
    first = placed_models(source, MODEL_FILE, points, specimen=names[0], belt=belt)
    return 0, first if len(first) > 1 else [*first, *(one for one in every if one.state != first[0].state)]


def _middle(every: Sequence[PlacedModel]) -> int:
    """Place of the condition nearest to the middle of all loads and pressures."""
    table = np.array([[one.state.get(name, 0.0) for name in (_LOAD, _PRESSURE)] for one in every])
    span = np.ptp(table, axis=0)
    scaled = (table - (table.max(axis=0) + table.min(axis=0)) / 2) / np.where(span > 0, span, 1.0)
    return int(np.argmin(np.round(np.sum(scaled**2, axis=1), 9)))


def vertical(stiffness: FloatArray, load: FloatArray, pressure: FloatArray, nominal: int) -> Vertical:
    """The curve nearest to stiffnesses (B,) [N/m] at loads (B,) [N] and pressures (B,) [Pa], by their relative error.

    Not-a-number loads or pressures are unknown, so that the curve does not depend on them.
    """
    k0, f0, p0 = stiffness[nominal], load[nominal], pressure[nominal]
    loads, pressures = (bool(np.ptp(one) > _SAME * abs(at)) for one, at in ((load, f0), (pressure, p0)))
    ratio = load / f0 if loads else np.ones(load.size)
    dpi = (pressure - p0) / p0 if pressures else np.zeros(load.size)
    free = [at for at, used in enumerate((loads, pressures)) if used]

    def tangent(values: FloatArray) -> FloatArray:
        """Stiffness relative to K0, with b F0/K0² and p."""
        both = np.zeros(2)
        both[free] = values
        s = 1 + both[1] * dpi
        return np.sqrt(np.maximum(s**2 * (1 - both[0]) + s * both[0] * ratio, 1e-12))

    if not free:
        return Vertical(float(k0), departure=float(np.max(np.abs(stiffness / k0 - 1))))
    low, high = np.array([-50.0, -50.0])[free], np.array([1.0, 50.0])[free]
    wanted = stiffness / k0
    found = scipy.optimize.least_squares(
        lambda values: tangent(values) / wanted - 1, np.zeros(len(free)), bounds=(low, high), xtol=1e-14
    )
    both = np.zeros(2)
    both[free] = found.x
    departure = float(np.max(np.abs(tangent(found.x) / wanted - 1)))
    return Vertical(float(k0), float(both[0] * k0**2 / f0) if loads else 0.0, float(both[1]), departure)


@dataclass(frozen=True, eq=False)
class _File:
    """The content of a file: the nominal point, all conditions, the stated frequency [Hz] and radius [m]."""

    source: ModelFile
    nominal: PlacedModel
    every: list[PlacedModel]
    frequency: float
    radius: float | None

    def stiffness(self, one: PlacedModel, frequency: FloatArray) -> ComplexArray:
        """K* (N,) [N/m] of a condition at frequencies (N,) [Hz]."""
        return np.asarray(one.model.stiffness(one.values, 2 * np.pi * frequency))

    @property
    def stated(self) -> complex:
        """K* of the nominal point at the stated frequency [N/m]."""
        return complex(self.stiffness(self.nominal, np.array([self.frequency]))[0])

    @property
    def damping(self) -> float:
        """VERTICAL_DAMPING [N s/m]."""
        return self.stated.imag / (2 * np.pi * self.frequency)

    @property
    def belt_mode(self) -> tuple[float, float]:
        """Undamped frequency [Hz] of the belt on the spring at the rim, and its damping ratio [1] by K* there."""
        frequency = self.frequency
        for _ in range(_ROUNDS):
            k = self.stiffness(self.nominal, np.array([frequency]))
            frequency = float(self.nominal.belt.frequencies(k)[0, 0])
        return frequency, float(k[0].imag / k[0].real) / 2

    def column(self, name: str) -> FloatArray:
        """Loads or pressures (B,); not-a-number where one is not stated."""
        return np.array([one.state.get(name, np.nan) for one in self.every])

    @property
    def tangent(self) -> Vertical:
        """The stiffness over load and pressure; without a radius there is no term of the load."""
        at = self.every.index(self.nominal)
        stiffness = np.array([self.stiffness(one, np.array([self.frequency]))[0].real for one in self.every])
        load, pressure = self.column(_LOAD), self.column(_PRESSURE)
        if self.radius is None:
            load = np.full(load.size, np.nan)
        return vertical(stiffness, load, pressure, at)

    def text(self) -> str:
        """The text of the file."""
        state, made, found = self.nominal.state, self.source.provenance, self.tangent
        load, radius = state.get(_LOAD), self.radius
        model = f"model {self.nominal.model.name} of {made.source}, by fourpole {made.fourpole}"
        accuracy = Accuracy.joined([one.accuracy for one in self.every]).text
        ranges = ((_PRESSURE, "INFLATION_PRESSURE_RANGE", "PRES"), (_LOAD, "VERTICAL_FORCE_RANGE", "FZ"))
        columns = [(block, key, self.column(name)) for name, block, key in ranges]
        return filled(
            "specimen.tir",
            about=_comment(f"vertical block of {self.nominal.specimen or 'a specimen'}; {model}", accuracy),
            notes=_comment(*self.notes()),
            compared=list(self._compared()),
            radius=radius,
            load=load,
            pressure=state.get(_PRESSURE),
            stiffness=found.stiffness,
            damping=self.damping,
            load_term=None if load is None or radius is None else found.load_term * radius**2 / (4 * load),
            pressure_term=found.pressure_term,
            belt=(self.nominal.belt.mass, *self.belt_mode) if self.nominal.belt.form is Form.BELT else None,
            ranges=[(block, key, one.min(), one.max()) for block, key, one in columns if np.isfinite(one).all()],
        )

    def _compared(self) -> Iterator[str]:
        """Comments: K* of the nominal point and that of the file over frequency, and C of the model elsewhere."""
        low, high = self.nominal.band
        frequency = np.unique([*np.geomspace(low, high, _COMPARED), self.frequency]) if high > low else np.array([low])
        heads = (q.FREQUENCY.head, q.STORAGE.head, "of file", q.LOSS.head, "of file")
        yield "".join(one.rjust(_WIDTH) for one in heads)
        for f, k in zip(frequency, self.stiffness(self.nominal, frequency), strict=True):
            numbers = (f, k.real, self.stated.real, k.imag, 2 * np.pi * f * self.damping)
            yield "".join(f"{one:.6g}".rjust(_WIDTH) for one in numbers)
        if len(self.every) > 1:
            yield f"C of the model at {self.frequency:.6g} Hz, of which the file has that of the nominal point alone:"
            for one in self.every:
                k = self.stiffness(one, np.array([self.frequency]))[0]
                yield from _comment(f"{one.label}: {k.imag / (2 * np.pi * self.frequency):.6g} N s/m")

    def notes(self) -> Iterator[str]:
        """What the file loses."""
        f = self.frequency
        alone = ", the only one: no change over load and pressure" if len(self.every) == 1 else ""
        yield f"the nominal point is {self.nominal.label}{alone}"
        yield f"stiffness and damping are those at {f:.6g} Hz: {'; '.join(self._elsewhere())} than the model"
        yield f"its load-deflection curve has K' at {f:.6g} Hz as its tangent, not K1"
        yield from self._over_conditions()
        yield from self._left_out()
        yield from self._belt()
        yield from self.nominal.remarks

    def _elsewhere(self) -> Iterator[str]:
        """Loss and stiffness of the file at the ends of the band, against the model."""
        for at, k in zip(band := np.array(self.nominal.band), self.stiffness(self.nominal, band), strict=True):
            loss = 2 * np.pi * at * self.damping
            more = "" if k.imag <= 0 else f"{_more(loss / k.imag)} loss and "
            yield f"at {at:.4g} Hz the file has {more}{_more(self.stated.real / k.real)} stiffness"

    def _over_conditions(self) -> Iterator[str]:
        if len(self.every) == 1:
            return
        off, omega = 100 * self.tangent.departure, 2 * np.pi * self.frequency
        yield f"its stiffness differs by up to {round(off, 3):.2g} % from the model's at {len(self.every)} conditions"
        damping = [self.stiffness(one, np.array([self.frequency]))[0].imag / omega for one in self.every]
        yield (
            f"VERTICAL_DAMPING is that of the nominal point: over all conditions, the model has {min(damping):.4g} to "
            f"{max(damping):.4g} N s/m"
        )

    def _belt(self) -> Iterator[str]:
        """What the keys of the belt are from."""
        if self.nominal.belt.form is not Form.BELT:
            return
        yield from belt_note([self.nominal.belt])
        yield (
            f"FREQ_LONG is the undamped frequency of {belt_words(self.nominal.belt)} on the spring at the rim; "
            "DAMP_LONG is half the loss factor of K* there"
        )
        if self.nominal.map.octaves_beyond([self.belt_mode[0]])[0] > 0:
            yield "FREQ_LONG is outside the tested frequencies: K* there is what the model predicts"

    def _left_out(self) -> Iterator[str]:
        """Keys that need what is not stated."""
        state = self.nominal.state
        if self.radius is None:
            load = self.column(_LOAD)
            term = " and Q_FZ2, the change over load" if np.ptp(load) > _SAME * load[0] else ""
            yield f"left out, for these tests do not know the radius: UNLOADED_RADIUS{term}; state --radius"
        for name, keys in ((_LOAD, "FNOMIN and Q_FZ2"), (_PRESSURE, "INFLPRES, NOMPRES and PFZ1")):
            if name not in state:
                yield f"the tests state no {name.partition(' [')[0]}: {keys} are left out"


def _more(ratio: float) -> str:
    """A ratio as a difference in words."""
    return f"{100 * abs(ratio - 1):.2g} % {'more' if ratio >= 1 else 'less'}"


def _comment(*texts: str) -> list[str]:
    """Texts as lines of comment, in ASCII."""
    return [line for text in texts for line in textwrap.wrap(ascii_line(text), _LONGEST)]
