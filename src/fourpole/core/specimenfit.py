"""A belt, a rod or a massless spring held against four poles that were measured without a model.

K* of the springs is free at each frequency; mass, share and exponent are common to all. Errors that all frequencies of
the measurement share are unknowns too, with their own standard uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core import stats
from fourpole.core.allpoles import AllPoles, real_matrix
from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.channelerrors import parts
from fourpole.core.components import component
from fourpole.core.joint.belts import TYRE
from fourpole.core.sources import Kind
from fourpole.core.specimen import Form, Specimen

#: Chance below which a difference counts as real: of k12 and k21, of the poles and a form, of a form and a simpler one.
UNLIKELY = 1e-3
#: Most rounds of the search, most halvings of a step, and the change of chi-square at which it has ended.
_ROUNDS, _HALVINGS, _SETTLED = 60, 12, 1e-9
#: Longest step of the logarithm of K*.
_LONGEST = 1.0
#: Parameters of each form that all frequencies share: mass, log share, its angle, exponent.
_COUNT = {Form.MASSLESS: 0, Form.BELT: 4, Form.ROD: 1}
_STDS = np.array([component(kind).std for kind in (Kind.BELT_SHARE, Kind.BELT_ANGLE, Kind.BELT_EXPONENT)])


@dataclass(frozen=True, eq=False)
class SpecimenFit(ByValue):
    """A form of specimen as it fits measured four poles best.

    Attributes
    ----------
    specimen : Specimen
    mass_std : float [kg]
        Standard uncertainty of its mass; 0 for a massless one.
    stiffness : (F,) complex array [N/m]
        K* of its springs at each frequency.
    poles : (F, 2, 2) complex array [N/m]
        Its k11, k12, k21 and k22.
    chi2, dof : float, int [1]
        Misfit to the four poles with the departure of what all frequencies share, and its degrees of freedom.
    """

    specimen: Specimen
    mass_std: float
    stiffness: ComplexArray
    poles: ComplexArray
    chi2: float
    dof: int

    @property
    def chance(self) -> float:
        """Chance of a larger misfit if the specimen has this form."""
        return float(stats.chi2.sf(self.chi2, self.dof))


def fit_specimen(measured: AllPoles, share: float = TYRE) -> SpecimenFit:
    """The form of specimen that describes four poles best: a massless spring, a belt or a rod.

    A form with more parameters must be better by more than chance alone makes it in one of a thousand cases.

    Parameters
    ----------
    measured : AllPoles
        The poles at F frequencies.
    share : float [1]
        Usual stiffness of the spring at the contact over that at the rim; the prior of the belt has it.

    Examples
    --------
    The poles of a belt of 7 kg, known to 0.01 %, are described by it:

    >>> w = 2 * np.pi * np.arange(10.0, 101.0, 10.0)
    >>> poles = Specimen(Form.BELT, 7.0, 0.25).dynamic_stiffness(0 * w + 3e5 * (1 + 0.1j), w)
    >>> noise = np.tile(30.0**2 * np.eye(8), (w.size, 1, 1))
    >>> none = np.zeros((w.size, 8, 0))
    >>> fit = fit_specimen(AllPoles(w / 2 / np.pi, poles, noise, none, *[0 * w] * 4))
    >>> fit.specimen.form.value, round(fit.specimen.mass, 2), round(abs(fit.specimen.share), 2)
    ('belt', 7.0, 0.25)
    """
    fits = [_Search(measured, form, share).fit() for form in Form]
    cost = {form: float(stats.chi2.isf(UNLIKELY, count)) if count else 0.0 for form, count in _COUNT.items()}
    return min((fit for fit in fits if fit.specimen.mass >= 0), key=lambda fit: fit.chi2 + cost[fit.specimen.form])


class _Search:
    """Gauss-Newton search for one form, with K* of each frequency projected out of the equations of the common ones."""

    def __init__(self, measured: AllPoles, form: Form, share: float) -> None:
        self.measured, self.form, self.count = measured, form, _COUNT[form]
        poles, square = measured.stiffness, measured.omega**2
        spring = -0.5 * (poles[:, 0, 1] + poles[:, 1, 0])
        contact, wheel = (spring - poles[:, 0, 0]) / square, (spring - poles[:, 1, 1]) / square
        rest = 1 - square * contact * wheel / ((contact + wheel) * spring)
        self.log_k = np.log(spring * rest if self.count else spring)
        self.reference = complex(np.exp(np.mean(self.log_k)))
        mass = float(np.average(((contact + wheel) * rest).real, weights=square**2))
        self.first = np.array([max(mass, 1e-3), np.log(share), 0.0, component(Kind.BELT_EXPONENT).std])
        self.centre = self.first[1:].copy()  # the exponent's prior is centred between both laws, one std above 0
        self.whiten = np.linalg.inv(np.linalg.cholesky(measured.noise))
        self.errors = measured.shared.shape[2]

    def specimen(self, values: FloatArray) -> Specimen:
        """The specimen of some common values."""
        mass, log_share, angle, exponent = values[:4]
        share = np.exp(np.clip(log_share, -12, 12) + 1j * angle)
        return Specimen(self.form, float(mass), complex(share), float(exponent), self.reference)

    def left(self, values: FloatArray, log_k: ComplexArray) -> tuple[FloatArray, FloatArray]:
        """Whitened differences (F, 8), and departures of the common values from their priors."""
        poles = self.specimen(values).dynamic_stiffness(np.exp(log_k), self.measured.omega)
        off = parts((self.measured.stiffness - poles).reshape(-1, 4)).reshape(-1, 8) - self.measured.shared @ values[4:]
        stated = (self.centre - values[1:4]) / _STDS if self.form is Form.BELT else np.zeros(0)
        return np.einsum("fij,fj->fi", self.whiten, off), np.append(stated, -values[4:])

    def slopes(self, values: FloatArray, log_k: ComplexArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Derivatives of the whitened poles by log K* and by the common values, and of the departures from priors."""
        square = self.measured.omega**2
        ends = self.specimen(values).ends(np.exp(log_k), self.measured.omega)
        spring = ends.spring[:, None] * ends.by[:, :, 0]
        by = np.stack([spring - square[:, None] * ends.by[:, :, 1], -spring, -spring,
                       spring - square[:, None] * ends.by[:, :, 2]], axis=1)  # fmt: skip
        by_common = np.stack([by[:, :, 1], by[:, :, 2], 1j * by[:, :, 2], by[:, :, 3]], axis=2)
        common = np.moveaxis(parts(by_common), 3, 2).reshape(-1, 8, 4)[:, :, : self.count]
        of_errors = np.concatenate([common, self.measured.shared], axis=2)
        priors = np.zeros((len(self.left(values, log_k)[1]), of_errors.shape[2]))
        own = len(priors) - self.errors
        priors[range(own), range(1, own + 1)] = 1 / _STDS[:own]
        priors[range(own, len(priors)), range(self.count, of_errors.shape[2])] = 1.0
        return self.whiten @ real_matrix(by[:, :, :1]), self.whiten @ of_errors, priors

    def fit(self) -> SpecimenFit:
        """The most probable values."""
        values, log_k = np.append(self.first if self.count else 0 * self.first, np.zeros(self.errors)), self.log_k
        places = np.append(np.arange(self.count), 4 + np.arange(self.errors))
        left, departure = self.left(values, log_k)
        chi2 = float(np.sum(left**2) + departure @ departure)
        for _ in range(_ROUNDS):
            own, common, priors = self.slopes(values, log_k)
            q, r = np.linalg.qr(own, mode="complete")
            seen, by = np.swapaxes(q, 1, 2) @ left[:, :, None], np.swapaxes(q, 1, 2) @ common
            lines = np.concatenate([by[:, 2:].reshape(6 * len(by), places.size), priors])
            step = np.linalg.lstsq(lines, np.append(seen[:, 2:], departure), rcond=None)[0]
            moved = np.linalg.solve(r[:, :2], seen[:, :2] - by[:, :2] @ step[:, None])[:, :, 0]
            before, most = chi2, min(1.0, _LONGEST / float(np.max(np.abs(moved))))
            for halving in range(_HALVINGS):
                part = most * 0.5**halving
                fresh, fresh_k = values.copy(), log_k + part * (moved[:, 0] + 1j * moved[:, 1])
                fresh[places] += part * step
                left, departure = self.left(fresh, fresh_k)
                chi2 = float(np.sum(left**2) + departure @ departure)
                if chi2 <= before:
                    break
            else:
                chi2 = before
                break
            values, log_k = fresh, fresh_k
            if before - chi2 <= _SETTLED * max(before, 1.0):
                break
        specimen = self.specimen(values)
        covariance = np.linalg.pinv(lines.T @ lines)
        return SpecimenFit(
            specimen=specimen,
            mass_std=float(np.sqrt(covariance[0, 0])) if self.count else 0.0,
            stiffness=np.exp(log_k),
            poles=specimen.dynamic_stiffness(np.exp(log_k), self.measured.omega),
            chi2=chi2,
            dof=6 * log_k.size - min(self.count, 1),
        )
