"""The commands in groups, as the help lists them, and an example of each."""

from __future__ import annotations

#: Commands by the heading of their group.
GROUPS = {
    "Start here": ("demo", "init", "analyse", "open", "app"),
    "Results": ("report", "plot", "rig", "compare", "export", "lab"),
    "Models": ("fit", "map", "query", "ride", "causality", "shift", "verify"),
    "Before and beside the analysis": ("check", "plan", "watch", "static", "identify", "predict"),
    "Files": ("info", "convert", "simulate"),
    "This installation": ("selftest",),
}
#: An example of each command.
EXAMPLES = {
    "demo": "fourpole demo",
    "init": "fourpole init my-recordings",
    "analyse": "fourpole analyse my-campaign",
    "open": "fourpole open my-campaign",
    "app": "fourpole app my-campaigns",
    "report": "fourpole report my-campaign --png",
    "plot": "fourpole plot my-campaign arm --out k2-and-c.pdf",
    "rig": "fourpole rig my-campaign",
    "compare": "fourpole compare before after",
    "export": "fourpole export my-campaign --to xlsx",
    "lab": "fourpole lab all-campaigns",
    "fit": "fourpole fit my-campaign --model maxwell",
    "map": "fourpole map my-campaign",
    "query": 'fourpole query my-campaign --pressure "2.1 bar" --preload "3 kN" --frequency "15 Hz"',
    "ride": 'fourpole ride my-campaign --road C --speed "80 km/h"',
    "causality": "fourpole causality my-campaign",
    "shift": 'fourpole shift isotherms.csv --reference "20 degC" --out master',
    "verify": "fourpole verify my-campaign",
    "check": "fourpole check my-campaign",
    "plan": 'fourpole plan my-campaign --k1 "180 kN/m" --k2 "120 kN/m" --c "700 N s/m" --wanted "1 %"',
    "watch": "fourpole watch my-campaign",
    "static": 'fourpole static curve.csv --load "3 kN"',
    "identify": 'fourpole identify amplitudes.csv --k1 "180 kN/m" --mass "15 kg" --preload-stiffness "12.44 kN/m"',
    "predict": (
        'fourpole predict --k1 "180 kN/m" --k2 "120 kN/m" --c "700 N s/m" --mass "15 kg" '
        '--preload-stiffness "12.44 kN/m" --frequency "10:24:2 Hz"'
    ),
    "info": "fourpole info recording.tdms",
    "convert": "fourpole convert recording.tdms recording.csv",
    "simulate": "fourpole simulate practice --clean",
    "selftest": "fourpole selftest --out selftest.html",
}


def groups_of(names: list[str]) -> dict[str, list[str]]:
    """Names of commands by their group; those without one at the end."""
    found = {head: [name for name in members if name in names] for head, members in GROUPS.items()}
    listed = [name for members in found.values() for name in members]
    return {**found, "Further commands": [name for name in names if name not in listed]}
