"""What the package computes for the reference cases of four-poles, tyres, rigs and tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.deflection import deflection_amplitude
from fourpole.core.identify import identify
from fourpole.core.phasor import Phasors
from fourpole.core.polar import polar
from fourpole.core.reduced import ReducedResult, identify_mobility, identify_stiffness, predict
from fourpole.core.rig import PARAMETERS, Rig
from fourpole.core.routes import (
    ROUTES,
    arm_slopes,
    maxwell_arm,
    mobility_route,
    paper_d,
    relative_route,
    stiffness_by,
    transmissibility_route,
)
from fourpole.core.twoport import (
    cascade,
    chain_mobility,
    chain_transmissibility,
    damper,
    deembed,
    inverse,
    mass,
    spring,
)
from fourpole.core.tyre import (
    energy_loss,
    loss_factor,
    mobility,
    transmissibility,
    zener_mobility,
    zener_stiffness,
    zener_transmissibility,
)

#: Inputs of a case, and what is found, by name.
Inputs = Mapping[str, Any]
Found = dict[str, Any]
#: Values of a rig by their names in the cases.
_OF_RIG = {
    "m": "moving_mass",
    "K3": "preload_stiffness",
    "c3": "preload_damping",
    "preload loss factor": "preload_loss_factor",
    "tyre mass": "tyre_mass",
    "frame stiffness": "frame_stiffness",
    "input mass": "input_mass",
}
_CHANNELS = ("F1", "V1", "V2")


def parts(name: str, value: Any) -> Found:
    """Real and imaginary part of a complex value under their names."""
    value = complex(np.asarray(value).reshape(-1)[0])
    return {f"Re {name}": value.real, f"Im {name}": value.imag}


def whole(v: Inputs, name: str) -> complex:
    """A complex input."""
    return complex(v[f"Re {name}"], v[f"Im {name}"])


def omega(v: Inputs) -> float:
    """Angular frequency [rad/s]."""
    return 2 * np.pi * float(v["frequency"])


def rig_of(v: Inputs, *, blocked: bool = False) -> Rig:
    """The rig of a case, with the uncertainties that it states."""
    stated = {name: v[key] for key, name in _OF_RIG.items() if key in v}
    std = {name: v[f"u {key}"] for key, name in _OF_RIG.items() if f"u {key}" in v}
    return Rig(**stated, blocked=blocked, std=std)


def _entries(found: Any) -> Found:
    return {
        key: one for i in (0, 1) for k in (0, 1) for key, one in parts(f"a{i + 1}{k + 1}", found[i, k]).items()
    }  # fmt: skip


def _chain(v: Inputs) -> Any:
    w = omega(v)
    return cascade(mass(v["m"], w), spring(v["K"], w), damper(v["C"]), mass(v["M"], w))


def _tyre(v: Inputs) -> Any:
    return spring(whole(v, "K*"), omega(v))


def _behind(v: Inputs) -> Any:
    return cascade(mass(v["m"], omega(v)), spring(v["K3"], omega(v)))


def _deembedded(v: Inputs) -> Found:
    before, after = mass(v["input mass"], omega(v)), _behind(v)
    inner = deembed(cascade(before, _tyre(v), after), before=before, after=after)
    return parts("a21", inner[1, 0])


def _zener(v: Inputs) -> tuple[float, float, float, float]:
    return v["K1"], v["K2"], v["C"], omega(v)


def _above(v: Inputs) -> dict[str, float]:
    damping = {"preload_damping": v["c3"]} if "c3" in v else {}
    return {"mass": v["m"], "preload_stiffness": v["K3"], **damping}


def _papers(v: Inputs) -> Found:
    stiffness = zener_stiffness(*_zener(v))
    return {
        **parts("K*", stiffness),
        **parts("V1/F1", zener_mobility(*_zener(v), **_above(v))),
        "d": float(paper_d(stiffness, v["K1"])),
        "TR": float(zener_transmissibility(*_zener(v), **_above(v))),
        "arg(V2/V1)": float(np.angle(transmissibility(stiffness, omega(v), **_above(v)))),
    }


def _gradient(v: Inputs) -> Found:
    found = rig_of(v).impedance_gradient(omega(v), v["added mass"])
    names = [*PARAMETERS, "added_mass"]
    places = {**{key: names.index(name) for key, name in _OF_RIG.items() if key in v}, "added mass": len(names) - 1}
    return {name: one for key, at in places.items() for name, one in parts(f"dZr/d {key}", found[at]).items()}


def _by_route(route: str, v: Inputs) -> Found:
    amplitudes = [np.array([whole(v, name)]) for name in _CHANNELS]
    return parts("K*", stiffness_by(route, amplitudes, whole(v, "Zr"), omega(v)))


def _arm(v: Inputs) -> Found:
    k2, c = maxwell_arm(whole(v, "K*"), v["K1"], omega(v))
    return {"K2": float(k2), "C": float(c)}


def _arm_slopes(v: Inputs) -> Found:
    stiffness, k1, w = np.array([whole(v, "K*")]), np.array([v["K1"]]), np.array([omega(v)])
    by = np.array([[1.0, 1j, -1.0]])
    found = arm_slopes(stiffness, k1, maxwell_arm(stiffness, k1, w), w, by)[0]
    heads = ("Re K*", "Im K*", "K1")
    return {
        f"d{of}/d {head}": row[at] for of, row in zip(("K2", "C"), found, strict=True) for at, head in enumerate(heads)
    }


def _phasors(v: Inputs) -> Phasors:
    """The amplitudes of a case, with the noise that it states."""
    noise = np.diag(np.repeat([v.get(f"u {name}", 0.0) for name in _CHANNELS], 2) ** 2)
    both = np.outer([0, 0, 1, 0, 1, 0], [0, 0, 1, 0, 1, 0]) + np.outer([0, 0, 0, 1, 0, 1], [0, 0, 0, 1, 0, 1])
    noise = noise + v.get("common noise of V1, V2", 0.0) ** 2 * both
    return Phasors(
        np.array([v["frequency"]]),
        np.array([[whole(v, name) for name in _CHANNELS]]),
        noise[None],
        np.array([v.get("u frequency", 0.0)]),
        np.array([np.inf]),
    )


def _identified(route: str, *, blocked: bool = False) -> Callable[[Inputs], Found]:
    def run(v: Inputs) -> Found:
        one = identify(
            _phasors(v), rig_of(v, blocked=blocked), v["K1"], route=route, added_mass=v.get("added mass", 0.0)
        )
        values = {"loss factor": one.loss_factor, "K2": one.k2, "C": one.c}
        ratios = {} if blocked else {"TR measured": one.tr_measured, "TR": one.tr_predicted}
        return {
            **parts("V1/F1", one.mobility),
            **parts("K*", one.stiffness),
            **{name: value[0] for name, value in {**values, **ratios}.items()},
        }

    return run


def _uncertain(route: str) -> Callable[[Inputs], Found]:
    def run(v: Inputs) -> Found:
        gains, phases = np.array([v["gain F1"], 0.0, 0.0]), np.array([0.0, v["phase V1"], 0.0])
        response = np.array([[0.0, 0.0, complex(v["response gain V2"], v["response phase V2"])]])
        one = identify(
            _phasors(v),
            rig_of(v),
            v["K1"],
            k1_std=v["u K1"],
            route=route,
            added_mass=v["added mass"],
            added_mass_std=v["u added mass"],
            channels=ChannelUncertainty(gains, phases, np.array([0.0, 0.0, v["delay V2"]]), response),
        )
        of_stiffness, of_arm = one.stiffness_covariance[0], one.arm_covariance[0]
        u_re, u_im = np.sqrt(np.diag(of_stiffness))
        u_k2, u_c = np.sqrt(np.diag(of_arm))
        return {
            "own u(Re K*)": np.sqrt(one.condition_covariance[0, 0, 0]),
            "own u(Im K*)": np.sqrt(one.condition_covariance[0, 1, 1]),
            **{
                f"common u({name})": np.linalg.norm(row)
                for name, row in zip(("Re K*", "Im K*"), one.stiffness_shared[0], strict=True)
            },
            "u(Re K*)": u_re,
            "u(Im K*)": u_im,
            "corr(Re,Im K*)": of_stiffness[0, 1] / (u_re * u_im),
            "u(loss factor)": one.loss_factor_std[0],
            "u(K2)": u_k2,
            "u(C)": u_c,
            "corr(K2,C)": of_arm[0, 1] / (u_k2 * u_c),
            "u(TR)": one.tr_std[0],
        }

    return run


def _from_polar(v: Inputs) -> Found:
    one = Phasors.from_polar(v["frequency"], v["F1"], v["V1"], v["phase F1"], v["V2"], v["phase V2"])
    return {**parts("V1/F1", one.mobility), **parts("V2/V1", one.transmissibility)}


def _reduced(found: ReducedResult) -> Found:
    plain = {"d": found.d, "K2": found.k2, "C": found.c, "TR": found.tr}
    return {
        **parts("V1/F1", found.mobility),
        **parts("K*", found.stiffness),
        **{name: value[0] for name, value in plain.items()},
    }


def _polar(v: Inputs) -> Found:
    (size, angle), slopes = polar(whole(v, "K*"))
    return {
        "|K*|": size,
        "loss angle": angle,
        "d|K*|/dK'": slopes[0, 0],
        "d|K*|/dK''": slopes[0, 1],
        "d delta/dK'": slopes[1, 0],
        "d delta/dK''": slopes[1, 1],
    }


#: What the package finds for the inputs of a case, by the function that the case names.
MECHANICS: dict[str, Callable[[Inputs], Found]] = {
    "twoport.cascade": lambda v: _entries(_chain(v)),
    "twoport.inverse": lambda v: _entries(inverse(_chain(v))),
    "twoport.deembed": _deembedded,
    "twoport.chain_mobility": lambda v: parts("mobility", chain_mobility(cascade(_tyre(v), _behind(v)))),
    "twoport.chain_transmissibility": lambda v: parts("ratio", chain_transmissibility(_tyre(v), _behind(v))),
    "core.tyre.zener_stiffness": lambda v: parts("K*", zener_stiffness(*_zener(v))),
    "core.tyre.mobility": lambda v: parts("V1/F1", mobility(zener_stiffness(*_zener(v)), omega(v), **_above(v))),
    "core.tyre.transmissibility": lambda v: parts(
        "V2/V1", transmissibility(zener_stiffness(*_zener(v)), omega(v), **_above(v))
    ),
    "core.tyre (the paper's rig)": _papers,
    "core.tyre.zener_mobility": lambda v: parts("V1/F1", zener_mobility(*_zener(v), **_above(v))),
    "core.tyre.zener_transmissibility": lambda v: {"TR": float(zener_transmissibility(*_zener(v), **_above(v)))},
    "core.tyre.energy_loss": lambda v: {"W": float(energy_loss(whole(v, "K*"), v["amplitude"]))},
    "core.tyre.loss_factor": lambda v: {"eta": float(loss_factor(whole(v, "K*")))},
    "core.rig.Rig.chain": lambda v: _entries(rig_of(v).chain(omega(v), v["added mass"])),
    "core.rig.Rig.resonance": lambda v: {"f": rig_of(v).resonance},
    "core.rig.Rig.impedance": lambda v: parts("Zr", rig_of(v).impedance(omega(v), v["added mass"])),
    "core.rig.Rig.mobility": lambda v: parts("1/Zr", rig_of(v).mobility(omega(v), v["added mass"])),
    "core.rig.Rig.impedance_gradient": _gradient,
    "core.rig.Rig.impedance_slope": lambda v: parts("dZr/dw", rig_of(v).impedance_slope(omega(v), v["added mass"])),
    "core.routes.mobility_route": lambda v: parts("K*", mobility_route(whole(v, "V1/F1"), whole(v, "1/Zr"), omega(v))),
    "core.routes.relative_route": lambda v: parts(
        "K*", relative_route(whole(v, "F1"), whole(v, "V1"), whole(v, "V2"), omega(v))
    ),
    "core.routes.transmissibility_route": lambda v: parts(
        "K*", transmissibility_route(whole(v, "V2/V1"), whole(v, "Zr"), omega(v))
    ),
    **{f"core.routes.stiffness_by {route}": partial(_by_route, route) for route in ROUTES},
    "core.routes.maxwell_arm": _arm,
    "core.routes.arm_slopes": _arm_slopes,
    "core.routes.paper_d": lambda v: {"d": float(paper_d(whole(v, "K*"), v["K1"]))},
    "core.identify.identify mobility": _identified("mobility"),
    "core.identify.identify relative": _identified("relative"),
    "core.identify.identify transmissibility": _identified("transmissibility"),
    "core.identify.identify blocked": _identified("mobility", blocked=True),
    "core.identify.identify u mobility": _uncertain("mobility"),
    "core.identify.identify u relative": _uncertain("relative"),
    "core.identify.identify u transmissibility": _uncertain("transmissibility"),
    "core.phasor.Phasors.from_polar": _from_polar,
    "core.reduced.predict": lambda v: _reduced(predict([v["frequency"]], v["K1"], v["K2"], v["C"], rig_of(v))),
    "core.reduced.identify_stiffness": lambda v: _reduced(
        identify_stiffness([v["frequency"]], [whole(v, "K*")], v["K1"], rig_of(v))
    ),
    "core.reduced.identify_mobility": lambda v: _reduced(
        identify_mobility([v["frequency"]], [whole(v, "V1/F1")], v["K1"], rig_of(v))
    ),
    "core.polar.polar": _polar,
    "core.deflection.deflection_amplitude of force": lambda v: {
        "x": float(deflection_amplitude(whole(v, "F1"), 0.1, np.nan, 60.0, stiffness=whole(v, "K*")))
    },
    "core.deflection.deflection_amplitude blocked": lambda v: {
        "x": float(deflection_amplitude(1.0, whole(v, "V1"), whole(v, "V2"), omega(v), blocked=True))
    },
    "core.deflection.deflection_amplitude": lambda v: {
        "x": float(deflection_amplitude(1.0, whole(v, "V1"), whole(v, "V2"), omega(v)))
    },
}
