"""One campaign at phasor level: how far the joint route is from the truth, in its own stated uncertainty."""

from __future__ import annotations

from typing import Any

import numpy as np
from bound import bounds
from laboratories import MASSES, TYRES, Case, case

from fourpole.core.arrays import FloatArray as Array
from fourpole.core.joint import Joint, solve_joint
from fourpole.core.joint.belts import found_specimens
from fourpole.core.joint.outputs import identification
from fourpole.core.specimen import Body, Form
from fourpole.virtual.phasor_rig import CHANNELS, RIG_VALUES

__all__ = ["EVERY", "run"]

#: Every so many campaigns are held against the Cramér-Rao bound.
EVERY = 10


def run(number: int) -> dict[str, Any]:
    """Errors over uncertainty `z`, uncertainty over value `relative` and over the bound `bound`, by quantity."""
    this = case(number)
    phasors, added = this.campaign.phasors, this.added_mass
    joint = solve_joint(
        phasors,
        this.rig,
        this.k1,
        family=this.family,
        added_mass=added,
        added_mass_std=this.laboratory.std_added * added,
        channels=this.channels,
        specimen=this.specimen.tolist(),
        bodies={name: Body.weighed(this.weights[name]) if this.weights else Body() for name in TYRES},
    )
    triples = _rows(this, joint) | _shared(this, joint)
    result: dict[str, Any] = {
        "number": number,
        **this.settings,
        "belts": this.belts,
        "weights": this.weights,
        "masses found": sum(
            one.specimen.form is not Form.MASSLESS for one in found_specimens(joint.problem, joint.solution)
        ),
        "two roots": int(np.sum(joint.two_roots)),
        "frequencies": int(np.bincount(this.family[this.family >= 0])[0] / len(MASSES[this.masses])),
        "fits": joint.misfit.fits,
        "conflicts": [joint.stated.parameters[at].source.text for at in joint.misfit.conflicts],
        "parts": [source.text for source in joint.misfit.added],
        "inflation": joint.misfit.inflation,
        "scatter": joint.misfit.scatter,
        "outliers": int(np.sum(joint.outlier > 1)),
        "converged": joint.solution.converged,
        "blank": int(np.sum(~np.isfinite(triples["K2"][2]) & (this.family >= 0))),
        "z": {name: _short((found - true) / u) for name, (found, true, u) in triples.items()},
        "relative": {name: _short(u / np.abs(found)) for name, (found, _, u) in triples.items() if name in _OF_TESTS},
    }
    if number % EVERY == 0 and not this.belts:  # the bound knows no belt
        least = bounds(this)
        result["bound"] = {name: _short(triples[name][2] / least[name]) for name in least if name in triples}
    return result


_OF_TESTS = ("K'", "K''", "loss factor", "K2", "C", "TR", "R", "I")
_Triple = tuple[Array, Array, Array]


def _rows(this: Case, joint: Joint) -> dict[str, _Triple]:
    """Found, true and stated uncertainty of each output, one row per test."""
    campaign, tyre = this.campaign, np.where((this.family >= 0) & ~joint.two_roots, 1.0, np.nan)
    found = identification(joint, campaign.phasors, this.k1, np.nan_to_num(this.k1_std))
    stiffness, mobility = found.stiffness_covariance, found.mobility_covariance
    true_mobility = campaign.true_amplitudes[:, 1] / campaign.true_amplitudes[:, 0]
    true = campaign.stiffness

    def root(covariance: Array, at: int) -> Array:
        return np.sqrt(covariance[:, at, at])

    arm = found.arm_covariance
    rows = {
        "K'": (found.stiffness.real, true.real, root(stiffness, 0)),
        "K''": (found.stiffness.imag, true.imag, root(stiffness, 1)),
        "loss factor": (found.loss_factor, true.imag / true.real, found.loss_factor_std),
        "K2": (found.k2, campaign.k2, root(arm, 0)),
        "C": (found.c, campaign.c, root(arm, 1)),
        "TR": (found.tr_predicted, campaign.transmissibility, found.tr_std),
        "R": (found.mobility.real, true_mobility.real, root(mobility, 0)),
        "I": (found.mobility.imag, true_mobility.imag, root(mobility, 1)),
    }
    return {name: (value, tyre * exact, u) for name, (value, exact, u) in rows.items()}


def _shared(this: Case, joint: Joint) -> dict[str, _Triple]:
    """Found, true and stated uncertainty of each value that the tests share."""
    truth = this.campaign.truth
    true = {name: float(getattr(truth, name)) for name in RIG_VALUES}
    true |= {f"gain {channel}": 1 + float(error) for channel, error in zip(CHANNELS, truth.gain, strict=True)}
    true |= {f"phase {channel}": float(error) for channel, error in zip(CHANNELS, truth.phase, strict=True)}
    true |= {f"added mass {mass:g} kg": weight for mass, weight in truth.added_mass.items()}
    true |= {f"belt mass of {name}": mass for name, mass in this.belts.items()}
    sources = [each.source for each in joint.stated.parameters]
    return {
        source.text: (np.array([found]), np.array([true[source.text]]), np.array([u]))
        for source, found, u in zip(sources, joint.found, joint.found_std, strict=True)
        if source.text in true  # what nobody states has no true value: counted by itself
    }


def _short(values: Array) -> list[float | None]:
    """Four digits; nothing where a value does not exist."""
    return [float(f"{value:.4g}") if np.isfinite(value) else None for value in values]
