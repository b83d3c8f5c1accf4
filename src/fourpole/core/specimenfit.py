"""A belt, a rod or a massless spring held against four poles that were measured without a model.

K* of the springs is free at each frequency; mass, share and exponent are common to all. Errors that all frequencies of
the measurement share are unknowns too, with their own standard uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from fourpole.core import stats
from fourpole.core.allpoles import AllPoles
from fourpole.core.arrays import ByValue, ComplexArray, FloatArray, parts
from fourpole.core.components import component
from fourpole.core.sources import Kind
from fourpole.core.specimen import TYRE, Form, Specimen, spread_of

#: Chance below which a difference counts as real: of k12 and k21, of the poles and a form, of a form and a simpler one.
UNLIKELY = 1e-3
#: A stiffness that no specimen has [N/m], and the most rounds of a search.
_FAR, _ROUNDS = 1e15, 100
#: Parameters of each form that all frequencies share: mass, log share, its angle, exponent; of a rod mass and spread.
_COUNT = {Form.MASSLESS: 0, Form.BELT: 4, Form.ROD: 2}
#: Centre of the exponent's prior, between springs of one law and a rim of constant stiffness, and stds of the priors.
_EXPONENT = component(Kind.BELT_EXPONENT).std
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
    fits = [_fit(measured, form, share) for form in Form]
    cost = {form: float(stats.chi2.isf(UNLIKELY, count)) if count else 0.0 for form, count in _COUNT.items()}
    return min((fit for fit in fits if fit.specimen.mass >= 0), key=lambda fit: fit.chi2 + cost[fit.specimen.form])


def _fit(measured: AllPoles, form: Form, share: float) -> SpecimenFit:
    """The most probable specimen of a form."""
    omega, count, errors = measured.omega, _COUNT[form], measured.shared.shape[2]
    spring, mass, log_k = _first(measured)
    log_k = log_k if count else np.log(spring)
    reference = complex(np.exp(np.mean(log_k)))
    first = np.array([mass, 0.0] if form is Form.ROD else [mass, np.log(share), 0.0, _EXPONENT])
    stds = [component(Kind.BELT_SPREAD).std] if form is Form.ROD else _STDS[: max(count - 1, 0)]
    whiten = np.linalg.inv(np.linalg.cholesky(measured.noise))

    def parted(values: FloatArray) -> tuple[Specimen, FloatArray, ComplexArray]:
        """The specimen, the shared errors and K* of some values."""
        own, of_errors, log_k = np.split(values, [count, count + errors])
        stiffness = np.exp(np.clip(log_k[::2], 0, 50) + 1j * log_k[1::2])
        if form is Form.ROD:
            return Specimen(form, float(own[0]), spread=float(spread_of(own[1]))), of_errors, stiffness
        mass, log_share, angle, exponent = np.append(own, np.zeros(4 - count))
        share = np.exp(np.clip(log_share, -12, 12) + 1j * angle)
        return Specimen(form, float(mass), complex(share), float(exponent), reference), of_errors, stiffness

    def left(values: FloatArray) -> FloatArray:
        """Whitened differences, and departures of the common values from their priors."""
        specimen, of_errors, stiffness = parted(values)
        with np.errstate(all="ignore"):  # a search that goes astray overflows
            poles = np.nan_to_num(specimen.dynamic_stiffness(stiffness, omega), nan=_FAR, posinf=_FAR, neginf=-_FAR)
        off = parts((measured.stiffness - poles).reshape(-1, 4)).reshape(-1, 8)
        off = np.einsum("fij,fj->fi", whiten, off - measured.shared @ of_errors)
        prior = (values[1:count] - first[1:count]) / stds
        return np.concatenate([off.ravel(), prior, of_errors])

    start = np.concatenate([first[:count], np.zeros(errors), parts(log_k).ravel()])
    found = scipy.optimize.least_squares(left, start, x_scale="jac", xtol=1e-10, ftol=1e-10, max_nfev=_ROUNDS)
    specimen, _, stiffness = parted(found.x)
    covariance = np.linalg.pinv(found.jac.T @ found.jac)
    return SpecimenFit(
        specimen=specimen,
        mass_std=float(np.sqrt(covariance[0, 0])) if count else 0.0,
        stiffness=stiffness,
        poles=specimen.dynamic_stiffness(stiffness, omega),
        chi2=2 * float(found.cost),
        dof=6 * omega.size - min(count, 1),
    )


def _first(measured: AllPoles) -> tuple[ComplexArray, float, ComplexArray]:
    """The spring between the ends, and the mass and log K* of a belt that has exactly these poles at each frequency."""
    poles, square = measured.stiffness, measured.omega**2
    spring = -0.5 * (poles[:, 0, 1] + poles[:, 1, 0])
    contact, wheel = (spring - poles[:, 0, 0]) / square, (spring - poles[:, 1, 1]) / square
    rest = 1 - square * contact * wheel / ((contact + wheel) * spring)
    mass = float(np.average(((contact + wheel) * rest).real, weights=square**2))
    return spring, max(mass, 1e-3), np.log(spring * rest)
