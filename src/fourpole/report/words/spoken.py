"""How the quantities of findings are spoken of."""

from __future__ import annotations

from dataclasses import dataclass

from fourpole.report.words.phrases import shown

__all__ = ["Spoken", "spoken"]


@dataclass(frozen=True)
class Spoken:
    """Words for one quantity: symbol, SI value of the unit shown, that unit, what a specimen is that has more of it."""

    symbol: str
    scale: float = 1.0
    unit: str = ""
    more: str = ""
    start: str = ""  # how it opens a sentence, where that is not its symbol

    def of(self, tyre: str) -> str:
        """The quantity of a specimen, at the start of a sentence."""
        return f"{self.start or self.symbol} of {tyre}"

    def shown(self, value: float) -> str:
        """A value with its unit."""
        return shown(value / self.scale, self.unit)


_SPOKEN = {
    "K1": Spoken("K1", 1e3, "kN/m", "is the stiffer"),
    "K2": Spoken("K2", 1e3, "kN/m", "is dynamically the stiffer"),
    "Re K*": Spoken("Re K*", 1e3, "kN/m", "is dynamically the stiffer"),
    "C": Spoken("C", 1.0, "N s/m", "is the more damped"),
    "loss factor": Spoken("loss factor", more="has the larger loss", start="The loss factor"),
}


def spoken(symbol: str) -> Spoken:
    """The words for a quantity by its symbol."""
    return _SPOKEN[symbol]
