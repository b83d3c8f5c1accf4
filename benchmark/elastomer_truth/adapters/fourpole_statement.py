"""A plain statement as campaign.toml and tests.csv of Fourpole; what the statement leaves out stays out."""

from __future__ import annotations

import csv
import io

from elastomer_truth.adapters.fourpole_bodies import SPREADS
from elastomer_truth.statement import Campaign

_ROLES = {"F1": "force_in", "V1": "motion_in", "V2": "motion_out", "load": "load", "deflection": "deflection"}
_RIG = {
    "moving mass": "moving_mass", "preload spring": "preload_stiffness", "preload damping": "preload_damping",
    "input mass": "input_mass", "frame stiffness": "frame_stiffness",
}  # fmt: skip
_KINDS = {"static": "static", "sine": "dynamic", "random": "random", "sweep": "sweep", "multisine": "random"}


def campaign_toml(campaign: Campaign) -> str:
    """The statement as campaign.toml."""
    rig, complete = campaign.stated["rig"], campaign.stated["logger"].get("complete", False)
    lines = [f'title = "{campaign.name}"', "", "[rig]"]
    for name, key in _RIG.items():
        if name in rig:
            part = rig[name]
            lines.append(f'{key} = {{ value = {part["value"]}, unit = "{part["unit"]}", std = {part["u"]} }}')
    if campaign.blocked:
        side = "ground" if rig["force_is_measured_at"] == "the far side" else "drive"
        lines += ['output = "blocked"', f'force_at = "{side}"']
    lines += ["", "[channels]", f'sample_rate = "{campaign.rate:g} Hz"']
    for role, sensor in campaign.stated["sensors"].items():
        keys = [f'column = "{sensor["column"]}"', f'unit = "{sensor["unit"].replace("s2", "s²")}"',
                f"std_gain = {sensor['u_gain_relative']}", f"range = {sensor['full_scale']}"]  # fmt: skip
        if "u_linearity_relative" in sensor:
            keys.append(f"linearity = {sensor['u_linearity_relative']}")
        if role in ("F1", "V1", "V2"):
            keys += _dynamic(campaign, role, complete)
        lines.append(f"{_ROLES[role]} = {{ {', '.join(keys)} }}")
    lines += ["", "[logger]", f"simultaneous = {str(campaign.stated['logger']['simultaneous']).lower()}"]
    drift = [one.get("u_of_drift_over_the_run_relative", 0.0) for one in campaign.stated["specimens"].values()]
    if complete:
        lines += ["", "[unstated]", 'ordinary = "zero"']
        lines += ["", "[conditions]", f"std_drift = {max(drift)}", "std_block = 0.0"]
    for name, specimen in campaign.stated["specimens"].items():
        belt = specimen.get("form", "").startswith("one mass")
        lines += ["", f'[{"tyres" if belt else "specimens"}."{name}"]']
        if "mass" in specimen:
            mass = specimen["mass"]
            lines.append(f'belt_mass = {{ value = {mass["value"]}, unit = "kg", std = {mass["u"]} }}')
            lines += [
                f"mass_spread = {spread}" for form, spread in SPREADS.items() if specimen["form"].startswith(form)
            ]
    return "\n".join(lines) + "\n"


def _dynamic(campaign: Campaign, role: str, complete: bool) -> list[str]:
    """Keys of a channel of the dynamic tests."""
    sensor = campaign.stated["sensors"][role]
    keys = [f'std_phase = "{sensor["u_phase_in_degrees"]} deg"']
    if "delay_in_seconds" in sensor:
        keys += [f'delay = "{sensor["delay_in_seconds"]} s"', f'std_delay = "{sensor["u_delay_in_seconds"]} s"']
    if "low_cut_in_hertz" in sensor:
        cut = sensor["low_cut_in_hertz"]
        if cut:
            keys.append(f'low_cut = "{cut} Hz"')
        keys.append(f'std_low_cut = "{sensor["u_low_cut_in_hertz"]} Hz"')
    if "low_pass_in_hertz" in sensor:
        keys.append(f'low_pass = {{ corner = "{sensor["low_pass_in_hertz"]} Hz", order = 2 }}')
    if (rise := sensor.get("u_rise_of_gain_at_100_hertz_relative")) is not None:
        bands = [test["frequency [Hz]"].split(":")[-1] for test in campaign.tests if test["frequency [Hz]"]]
        keys.append(f"std_slope = {rise * (max(map(float, bands)) / 100) ** 2}")
    if (mounting := sensor.get("u_gain_of_one_mounting_relative")) is not None:
        keys.append(f"{'std_mounting' if role == 'V1' else 'std_remounting'} = {mounting}")
    elif complete:
        keys.append("std_mounting = 0.0" if role == "V1" else "std_remounting = 0.0")
    return keys


def tests_csv(campaign: Campaign) -> str:
    """The rows as tests.csv."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["test", "file", "kind", "specimen", "preload [N]", "frequency [Hz]", "added_mass [kg]",
                     "u(added_mass) [kg]", "temperature [degC]", "time [min]"])  # fmt: skip
    u = campaign.value("added mass")[1]
    for test in campaign.tests:
        added = test["added mass [kg]"]
        static = test["kind"] == "static"
        writer.writerow([
            test["test"], test["file"], _KINDS[test["kind"]], test["specimen"], test["preload [N]"],
            test["frequency [Hz]"], "" if static else added, u if float(added) else "", test["temperature [degC]"],
            "" if static else test["time [min]"],
        ])  # fmt: skip
    return text.getvalue()
