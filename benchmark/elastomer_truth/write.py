"""A laboratory as files: recordings and a plain statement in one folder, the truth in another."""

from __future__ import annotations

import csv
import hashlib
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path

import polars as pl

from elastomer_truth.drawing import draw, tier_of
from elastomer_truth.faults import described
from elastomer_truth.groups import groups
from elastomer_truth.laboratory import Laboratory, Sensor, Value
from elastomer_truth.recording import motions, samples
from elastomer_truth.truth import asked, values

#: What each role is called in a statement.
ROLES = {
    "F1": "force into the specimen",
    "V1": "motion of the specimen at the drive",
    "V2": "motion behind the specimen",
    "load": "static load",
    "deflection": "static deflection",
}


def make(name: str, data: Path, truth: Path, *, clean: bool = False) -> None:
    """Draw a campaign and write its folders; a clean one has no noise, and words of any length."""
    lab = draw(name)
    if clean:
        lab.noise, lab.bits = 0.0, None
    moved = motions(lab)
    folder = data / name
    (folder / "recordings").mkdir(parents=True, exist_ok=True)
    # One campaign in ten is written as CSV.
    ending = "csv" if int(name[1:]) % 10 == 3 else "parquet"
    tests = {test.name: test for test in lab.tests}
    for test in lab.tests:
        source = tests[test.file_of] if test.file_of else test
        table = pl.DataFrame({head: column.astype("float32") for head, column in
                              samples(lab, source, moved.get(source.name)).items()})  # fmt: skip
        path = folder / "recordings" / f"{test.name}.{ending}"
        if ending == "csv":
            table.write_csv(path)
        else:
            table.write_parquet(path)
    (folder / "statement.toml").write_text(statement(lab), encoding="utf-8")
    rows = (
        (
            test.name, f"recordings/{test.name}.{ending}", test.kind, test.specimen, f"{test.preload:g}",
            _frequency(test.band, test.frequency), f"{test.added_mass:g}",
            _rounded(23.0 + test.true.get("temperature rise", 0.0), 1), _rounded(test.start / 60.0, 1),
        )
        for test in lab.tests
    )  # fmt: skip
    head = ("test", "file", "kind", "specimen", "preload [N]", "frequency [Hz]", "added mass [kg]",
            "temperature [degC]", "time [min]")  # fmt: skip
    write_rows(folder / "tests.csv", head, rows)
    write_rows(folder / "asked.csv", ("test", "frequency [Hz]", "quantity"), asked(lab))
    true = truth / name
    true.mkdir(parents=True, exist_ok=True)
    write_rows(
        true / "values.csv", ("campaign", "test", "frequency [Hz]", "quantity", "truth"),
        ((name, *key, value) for key, value in values(lab, moved).items()),
    )  # fmt: skip
    alike = groups(lab)
    write_rows(
        true / "causes.csv", ("campaign", "fault", "cause", "channel or part", "size", "alike"),
        ((name, *described(fault).values(), " | ".join(alike.get(fault.name, ()))) for fault in lab.faults),
    )  # fmt: skip
    (true / "laboratory.json").write_text(json.dumps(asdict(lab), indent=1), encoding="utf-8")


def write_rows(path: Path, head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """A table as CSV."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(head)
        writer.writerows(rows)


def checksum(folder: Path) -> str:
    """SHA-256 of the names and contents of all files of a campaign; of Parquet files that of the columns."""
    found = hashlib.sha256()
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        parts = [path.read_bytes()]
        if path.suffix == ".parquet":
            parts = [
                name.encode() + column.to_numpy().tobytes() for name, column in pl.read_parquet(path).to_dict().items()
            ]
        found.update(path.relative_to(folder).as_posix().encode() + b"\0")
        found.update(hashlib.sha256(b"\0".join(parts)).digest())
    return found.hexdigest()


def statement(lab: Laboratory) -> str:
    """The statement of a laboratory as TOML, in SI units but for what a head says."""
    blocked = lab.blocked
    lines = [
        f'campaign = "{lab.name}"', f'tier = "{tier_of(lab.name)}"', 'licence = "CC-BY-4.0"', "", "[rig]",
        f"far_side_is_held = {str(blocked).lower()}",
        f'force_is_measured_at = "{"the far side" if lab.rig.endswith("ground") else "the drive"}"',
    ]  # fmt: skip
    for name, value in lab.values.items():
        lines += _stated(f'"{name}"', value, _UNITS.get(name, "N/m"))
    if lab.added_mass.stated:
        lines += _stated('"added mass"', lab.added_mass, "kg")
    lines += ["", "[logger]", f"rate_in_hertz = {lab.rate}", f"simultaneous = {str(lab.simultaneous).lower()}"]
    if tier_of(lab.name) == "honest":
        lines += ["# All that is not stated is rigid, without mass, or exactly zero.", "complete = true"]
    for role, sensor in lab.sensors.items():
        lines += ["", f"[sensors.{role}]", f'measures = "{ROLES[role]}"', *_sensor(sensor)]
    for specimen in lab.specimens.values():
        lines += ["", f'[specimens."{specimen.name}"]']
        lines += _stated("mass", specimen.mass, "kg")
        if specimen.mass.stated is not None:
            lines.append(f'form = "{_FORMS[specimen.kind]}"')
        if specimen.scatter.stated is not None:
            lines.append(f"scatter_of_tests_relative = {specimen.scatter.stated:.6g}")
        if specimen.drift.stated is not None:
            lines.append(f"u_of_drift_over_the_run_relative = {specimen.drift.u:.6g}")
    return "\n".join(lines) + "\n"


#: Where a specimen has its mass.
_FORMS = {
    "belt": "one mass between a soft spring at the drive and a stiff one behind",
    "two masses": "two equal masses between three equal springs",
    "mount": "spread evenly from end to end",
}
_UNITS = {
    "moving mass": "kg", "input mass": "kg", "frame mass": "kg", "preload damping": "N s/m", "frame damping": "N s/m",
    "cable damping": "N s/m", "guide friction": "N", "base motion": "1",
}  # fmt: skip


def _stated(name: str, value: Value, unit: str) -> list[str]:
    if value.stated is None:
        return []
    return [f'{name} = {{ value = {value.stated!r}, u = {value.u:.6g}, unit = "{unit}" }}']


def _sensor(sensor: Sensor) -> list[str]:
    """Keys of one channel; what is not stated is left out."""
    lines = [
        f'column = "{sensor.column}"', f'quantity = "{sensor.quantity}"', f'unit = "{sensor.unit}"',
        f"full_scale = {sensor.full_scale * sensor.scale:.6g}", f"u_gain_relative = {sensor.gain.u:.6g}",
    ]  # fmt: skip
    if sensor.role in ("load", "deflection"):
        if sensor.linearity.stated is not None:
            lines.append(f"u_linearity_relative = {sensor.linearity.u:.6g}")
        return lines
    lines.append(f"u_phase_in_degrees = {math.degrees(sensor.phase.u):.6g}")
    if sensor.low_pass is not None:
        lines.append(f"low_pass_in_hertz = {sensor.low_pass:g} # Butterworth, second order")
    for key, value in (("delay_in_seconds", sensor.delay), ("low_cut_in_hertz", sensor.low_cut)):
        if value.stated is not None:
            lines += [f"{key} = {value.stated:.6g}", f"u_{key} = {value.u:.6g}"]
    if sensor.slope.stated is not None:
        lines.append(f"u_rise_of_gain_at_100_hertz_relative = {sensor.slope.u:.6g}")
    if sensor.mounting.stated is not None:
        lines.append(f"u_gain_of_one_mounting_relative = {sensor.mounting.stated:.6g}")
    return lines


def _frequency(band: tuple[float, float] | None, frequency: float) -> str:
    return f"{band[0]:g}:{band[1]:g}" if band else f"{frequency:g}" if frequency else ""


def _rounded(value: float, digits: int) -> str:
    return f"{value:.{digits}f}"
