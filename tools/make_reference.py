"""Writes the reference data of `fourpole selftest`: python tools/make_reference.py [FOLDER].

The numbers come from physics solved with 50 digits (mpmath), in tools/reference, which imports nothing of Fourpole.
Without a folder, those of the package are written anew.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from reference import campaigns, materials, mechanics, records, spectra

OWN = Path(__file__).resolve().parents[1] / "src" / "fourpole" / "report" / "selftest" / "reference"
SOURCES = (
    mechanics.four_poles,
    mechanics.tyres,
    mechanics.rigs,
    mechanics.routes,
    mechanics.identified,
    mechanics.uncertainties,
    materials.models,
    materials.fits,
    materials.shifts,
    materials.sensors,
    materials.values,
    materials.probabilities,
    records.curves,
    records.recordings,
    spectra.spectra,
)


def write(folder: Path) -> None:
    """Write all reference data into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    cases = [one for source in SOURCES for one in source()]
    lines = ",\n".join(json.dumps(one, ensure_ascii=False) for one in cases)
    text = f'{{"made by": "tools/make_reference.py", "digits": 50, "cases": [\n{lines}\n]}}\n'
    (folder / "vectors.json").write_text(text, encoding="utf-8")
    for make in campaigns.ALL:
        make().write(folder / "campaigns")


if __name__ == "__main__":
    write(Path(sys.argv[1]) if len(sys.argv) > 1 else OWN)
