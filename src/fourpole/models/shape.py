r"""The shape of a specimen: its stiffness K* [N/m] as a modulus of its material [Pa], and back.

A specimen has a shape only where campaign.toml, or an option, states it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fourpole.errors import ModelError
from fourpole.units import quantity, shown

#: Keys of [specimens.NAME] in campaign.toml that state a shape; `mode` says that they do.
KEYS = ("mode", "height", "area", "poisson", "bonded", "bonded_factor", "bulk")
MODES = ("compression", "shear")
_BULKS = ("elastic", "relaxing")


@dataclass(frozen=True)
class Shape:
    r"""Height, loaded area and load of a specimen: E = K h/A in compression, G = K h/A in shear.

    A disc bonded to rigid plates is stiffer in compression: :math:`E = K h / (A (1 + 2 k S^2))` with the shape factor
    :math:`S = \sqrt{A/\pi} / (2 h)`, the loaded area over the free area of its side.

    Attributes
    ----------
    mode : str
        "compression" or "shear".
    height, area : float [m], [m²]
    poisson : float, optional [1]
        Poisson's ratio, 0 to below 0.5; needed for all moduli but the measured one.
    bonded : str
        "disc" for the correction of a bonded disc in compression; empty for none.
    bonded_factor : float [1]
        Factor k of the correction: 1 for soft rubber, less for filled rubber.
    bulk : str
        Whether the bulk modulus is "elastic" or "relaxing", in proportion to the shear modulus. Empty: elastic in
        shear; relaxing in compression, so that Poisson's ratio is constant and E* exact.

    References
    ----------
    A. N. Gent, P. B. Lindley, "The compression of bonded rubber blocks", Proc. Inst. Mech. Engrs 173, 1959.

    Examples
    --------
    >>> Shape("shear", 0.01, 5e-4).modulus
    20.0
    >>> round(Shape("compression", 0.01, np.pi * 0.02**2, bonded="disc").modulus, 4)
    2.6526
    """

    mode: str
    height: float
    area: float
    poisson: float | None = None
    bonded: str = ""
    bonded_factor: float = 1.0
    bulk: str = ""
    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise ModelError(f"mode {shown(self.mode)} is not {' or '.join(MODES)}")
        for name in ("height", "area", "bonded_factor"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ModelError(f"{name} must be positive")
        if self.poisson is not None and not 0 <= self.poisson < 0.5:
            raise ModelError(f"poisson = {self.poisson:g} must be 0 or more and below 0.5, as 0.499 for rubber")
        if self.bonded not in ("", "disc") or (self.bonded and self.mode != "compression"):
            raise ModelError('bonded = "disc" is the only correction, and one of mode = "compression"')
        if self.bulk not in ("", *_BULKS):
            raise ModelError(f"bulk {shown(self.bulk)} is not {' or '.join(_BULKS)}")

    @property
    def factor(self) -> float:
        """Shape factor S [1] of a disc of this area and height."""
        return float(np.sqrt(self.area / np.pi) / (2.0 * self.height))

    @property
    def modulus(self) -> float:
        """Modulus per stiffness [1/m]: E/K in compression, G/K in shear."""
        stiffening = 1.0 + 2.0 * self.bonded_factor * self.factor**2 if self.bonded else 1.0
        return self.height / (self.area * stiffening)

    @property
    def shear(self) -> float:
        """Shear modulus per stiffness [1/m]; ModelError if Poisson's ratio is needed and not known."""
        if self.mode == "shear":
            return self.modulus
        return self.modulus / (2.0 * (1.0 + self._poisson()))

    @property
    def young(self) -> float:
        """Young's modulus per stiffness [1/m]; ModelError if Poisson's ratio is needed and not known."""
        return self.modulus if self.mode == "compression" else self.modulus * 2.0 * (1.0 + self._poisson())

    @property
    def bulk_modulus(self) -> float:
        """Bulk modulus per stiffness [1/m]; ModelError if Poisson's ratio is not known."""
        return self.young / (3.0 * (1.0 - 2.0 * self._poisson()))

    @property
    def relaxing_bulk(self) -> bool:
        """Whether the bulk modulus relaxes as the shear modulus does."""
        return self.bulk == "relaxing" or (not self.bulk and self.mode == "compression")

    def _poisson(self) -> float:
        if self.poisson is None:
            raise ModelError("Poisson's ratio is not stated: state poisson, as 0.499, with the height and the area")
        return self.poisson


def shape_of(stated: Mapping[str, Any]) -> Shape | None:
    """The shape that a table [specimens.NAME] of campaign.toml states; None without the key `mode`.

    Raises
    ------
    ValueError
        If a key is missing, has a wrong unit or no possible value.

    Examples
    --------
    >>> shape_of({"mode": "shear", "height": "10 mm", "area": "5 cm^2"}).modulus
    20.0
    """
    if stated.get("mode") is None:
        return None
    for name in ("height", "area"):
        if not isinstance(stated.get(name), str):
            raise ModelError(f'mode is stated, so {name} must be, with its unit: height = "10 mm", area = "5 cm^2"')
    numbers: dict[str, float] = {}
    for name, kind in (("height", "length"), ("area", "area"), ("poisson", "ratio"), ("bonded_factor", "ratio")):
        raw = stated.get(name)
        if raw is not None:
            if isinstance(raw, bool) or not isinstance(raw, str | int | float):
                raise ModelError(f"{name} is no number")
            numbers[name] = quantity(raw, kind, default_unit="1" if kind == "ratio" else None)
    texts = {name: str(stated[name]) for name in ("mode", "bonded", "bulk") if stated.get(name) is not None}
    return Shape(**texts, **numbers)  # type: ignore[arg-type]
