"""Study: all that a campaign says, as tables, and the files that keep them."""

from __future__ import annotations

import json
import platform
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from fourpole.campaign.folder import Campaign, Test, read_campaign
from fourpole.campaign.load import MOST_BYTES
from fourpole.campaign.reduce import Reduced, reduce_tests
from fourpole.campaign.results import Results
from fourpole.campaign.static import StaticStiffness, StaticTest, evaluate_statics, stiffness_for
from fourpole.campaign.tables import (
    amplitude_cells,
    covariance_cells,
    dynamic_table,
    phasor_table,
    preview_table,
    static_table,
)
from fourpole.core.checks import Check, worst_verdict
from fourpole.core.identify import ChannelUncertainty, Identification, identify
from fourpole.core.phasor import CHANNELS, Phasors
from fourpole.core.rig import Rig
from fourpole.core.routes import ROUTES
from fourpole.errors import CampaignError
from fourpole.io.source import sha256_of
from fourpole.io.write import write_table, write_text

__all__ = ["Study", "analyse"]

#: An added mass of unstated uncertainty is known to this.
_ADDED_MASS_STD = 1e-4
#: Above this relative uncertainty linear propagation is no longer to be trusted.
_LINEAR = 0.3


@dataclass(frozen=True)
class Study:
    """Result tables of a campaign.

    Attributes
    ----------
    campaign : Campaign
        What was analysed.
    static, dynamic, phasors, previews : polars.DataFrame
        As in static.csv, dynamic.csv, phasors.parquet and previews.parquet.
    route : str
        How K* was found.
    notes : tuple of str
        What was assumed because the campaign does not state it.
    sha256 : dict of str to str
        Hash of each file read.

    Examples
    --------
    >>> import tempfile
    >>> from fourpole.virtual import simulate_campaign
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     campaign = simulate_campaign(folder, pressures=[170e3], preloads=[1000.0], frequencies=[14.0], clean=True)
    ...     analyse(campaign.folder).counts
    {'ok': 4, 'warning': 0, 'rejected': 0}
    """

    campaign: Campaign
    static: pl.DataFrame
    dynamic: pl.DataFrame
    phasors: pl.DataFrame
    previews: pl.DataFrame
    route: str
    notes: tuple[str, ...] = ()
    sha256: dict[str, str] = field(default_factory=dict)

    @property
    def counts(self) -> dict[str, int]:
        """Tests by verdict; a static test with several preloads counts by its worst."""
        statics = self.static.group_by("test", maintain_order=True).agg("verdict")
        verdicts = [worst_verdict(row) for row in statics["verdict"].to_list()] + self.dynamic["verdict"].to_list()
        return {verdict: verdicts.count(verdict) for verdict in ("ok", "warning", "rejected")}

    @property
    def results(self) -> Results:
        """The tables that figures and reports are made from."""
        return Results(self.static, self.dynamic, self.previews, self.record)

    def write(self, folder: str | Path) -> Path:
        """Write all tables and study.json into a folder, each in one step.

        Parameters
        ----------
        folder : path
            Made if it does not exist.

        Returns
        -------
        Path
            The folder.

        Raises
        ------
        CampaignError
            If the folder cannot be made.
        FileError
            If a file cannot be written.
        """
        folder = make_folder(folder)
        write_table(folder / "static.csv", self.static)
        write_table(folder / "dynamic.csv", self.dynamic)
        write_table(folder / "dynamic.parquet", self.dynamic)
        write_table(folder / "phasors.parquet", self.phasors)
        write_table(folder / "previews.parquet", self.previews)
        write_text(folder / "study.json", json.dumps(self.record, indent=2, ensure_ascii=False) + "\n")
        return folder

    @property
    def record(self) -> dict[str, Any]:
        """What it takes to repeat the run, as in study.json."""
        packages = ("fourpole", "numpy", "scipy", "polars", "pint", "pydantic")
        return {
            "title": self.campaign.stated.title,
            "settings": {"route": self.route},
            "stated": self.campaign.stated.summary(),
            "versions": {"python": platform.python_version(), **{name: version(name) for name in packages}},
            "verdicts": self.counts,
            "assumptions": list(self.notes),
            "sha256": self.sha256,
        }


def make_folder(folder: str | Path) -> Path:
    """A folder to write to, made if need be; CampaignError where that is not possible."""
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise CampaignError(f"{folder}: is a file, or lies below one: name a folder for the results") from None
    except (OSError, ValueError) as error:
        raise CampaignError(
            f"{folder}: the folder cannot be made: {getattr(error, 'strerror', None) or error}"
        ) from None
    return folder


def analyse(
    campaign: Campaign | str | Path,
    *,
    route: str = "mobility",
    cache: str | Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Study:
    """Analyse a campaign: static curves, demodulation, identification, tables.

    Parameters
    ----------
    campaign : Campaign or path
        A campaign, or its folder.
    route : {"mobility", "relative", "transmissibility"}
        How K* is found.
    cache : path, optional
        Folder that keeps the phasors of each recording, so that a run that was stopped goes on.
    progress : callable, optional
        Called with the recordings done and all recordings.

    Returns
    -------
    Study
        A row for every test; nothing is written but the cache.

    Raises
    ------
    CampaignError
        If the campaign as a whole cannot be used.

    Examples
    --------
    >>> import tempfile
    >>> from fourpole.virtual import simulate_campaign
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     campaign = simulate_campaign(folder, pressures=[170e3], preloads=[1000.0], frequencies=[14.0], clean=True)
    ...     study = analyse(campaign.folder)
    >>> study.dynamic["C [N s/m]"].round(3).to_list()
    [1399.8, 808.217]
    """
    if route not in ROUTES:
        raise CampaignError(f"no route {route!r}: choose one of {', '.join(ROUTES)}")
    if not isinstance(campaign, Campaign):
        campaign = read_campaign(campaign)
    dynamic = campaign.of_kind("dynamic")
    _check_rig(campaign, dynamic, route)

    kept = make_folder(cache) if cache is not None else None
    statics = evaluate_statics(campaign)
    static_rows = [row for item in statics for row in item.rows]
    reduced = reduce_tests(campaign, dynamic, route, cache=kept, progress=progress)
    stiffness = [stiffness_for(test, static_rows) for test in dynamic]
    cells = _identified(campaign, dynamic, reduced, stiffness, route)
    return Study(
        campaign=campaign,
        static=static_table(campaign, static_rows),
        dynamic=dynamic_table(campaign, dynamic, cells),
        phasors=phasor_table(dynamic, reduced),
        previews=preview_table(statics, dynamic, reduced),
        route=route,
        notes=tuple(campaign.stated.assumptions()),
        sha256=_hashes(campaign, statics, dynamic, reduced),
    )


def _check_rig(campaign: Campaign, dynamic: Sequence[Test], route: str) -> None:
    rigs = campaign.stated.all_rigs
    if dynamic and not rigs and route != "relative":
        raise CampaignError(
            f"campaign.toml: [rig] is missing, the {route} route needs it: state moving_mass and preload_stiffness, "
            "or use --route relative"
        )
    if route == "transmissibility" and any(rig.output == "blocked" for rig in rigs.values()):
        raise CampaignError(
            "campaign.toml: [rig] output is blocked, so there is no transmissibility: use --route mobility"
        )


def _identified(
    campaign: Campaign,
    tests: Sequence[Test],
    reduced: Sequence[Reduced],
    stiffness: Sequence[StaticStiffness],
    route: str,
) -> list[dict[str, Any]]:
    """Cells of each dynamic test, tests of a rig identified together."""
    found: dict[int, tuple[Identification, int]] = {}
    for name in {test.rig for test in tests}:
        members = [i for i, test in enumerate(tests) if test.rig == name and reduced[i].found is not None]
        if members:
            result = _identify(
                campaign,
                name,
                [tests[i] for i in members],
                [reduced[i] for i in members],
                [stiffness[i] for i in members],
                route,
            )
            found.update({i: (result, at) for at, i in enumerate(members)})
    return [_cells(reduced[i], stiffness[i], found.get(i), route) for i in range(len(tests))]


def _identify(
    campaign: Campaign,
    rig_name: str,
    tests: Sequence[Test],
    reduced: Sequence[Reduced],
    stiffness: Sequence[StaticStiffness],
    route: str,
) -> Identification:
    stated = campaign.stated.all_rigs.get(rig_name)
    rig: Rig | None = stated.rig() if stated is not None else None
    channels = [campaign.stated.channels.named(role) for role in CHANNELS]
    added = np.array([test.value("added_mass") or 0.0 for test in tests])
    added_std = [test.value("u(added_mass)") for test in tests]
    return identify(
        Phasors.stack([item.found.phasors for item in reduced if item.found is not None]),
        rig,
        np.array([k1.value for k1 in stiffness]),
        k1_std=np.array([k1.std for k1 in stiffness]),
        route=route,
        added_mass=added,
        added_mass_std=np.array(
            [_ADDED_MASS_STD * m if s is None else s for m, s in zip(added, added_std, strict=True)]
        ),
        channels=ChannelUncertainty(
            gain=np.array([channel.gain_std if channel is not None else 0.0 for channel in channels]),
            phase=np.array([channel.phase_std if channel is not None else 0.0 for channel in channels]),
        ),
    )


def _cells(
    reduced: Reduced, stiffness: StaticStiffness, found: tuple[Identification, int] | None, route: str
) -> dict[str, Any]:
    rows = list(reduced.checks)
    cells: dict[str, Any] = {"route": route}
    if reduced.found is not None and found is not None:
        cells.update(amplitude_cells(reduced.found.phasors))
        result, at = found
        if worst_verdict(row.verdict for row in rows) != "rejected":
            rows += _arm_checks(result, at, stiffness)
            cells.update(_identified_cells(result, at))
    cells["verdict"] = worst_verdict(row.verdict for row in rows)
    cells["remarks"] = "; ".join(row.remark for row in rows if row.remark)
    return cells


def _arm_checks(result: Identification, at: int, stiffness: StaticStiffness) -> list[Check]:
    """Whether K2 and C exist, and whether they are known at all."""
    reason = result.reasons[at]
    found = result.stiffness[at]
    if stiffness.reason and found.real > 0 and found.imag > 0:
        return [Check("K1", float("nan"), float("nan"), "warning", f"K2 and C are left blank: {stiffness.reason}")]
    if reason:
        return [Check("passive arm", float("nan"), 0.0, "rejected", reason)]
    with np.errstate(invalid="ignore"):
        relative = np.sqrt(np.diag(result.arm_covariance[at])) / (result.k2[at], result.c[at])
    worst = float(np.max(relative))
    if worst > _LINEAR:
        what = ("K2", "C")[int(np.argmax(relative))]
        remark = (
            f"{what} is known to {worst:.0%} only, so its interval is not symmetric: use K* instead, "
            "or state the rig, K1 and the channels with smaller uncertainties"
        )
        return [Check("uncertainty", worst, _LINEAR, "warning", remark)]
    return [Check("uncertainty", worst, _LINEAR, "ok")]


def _identified_cells(result: Identification, at: int) -> dict[str, float]:
    u_r, u_i, corr_ri = covariance_cells(result.mobility_covariance[at])
    u_re, u_im, corr_k = covariance_cells(result.stiffness_covariance[at])
    u_k2, u_c, corr_arm = covariance_cells(result.arm_covariance[at])
    return {
        "R [m/(N s)]": float(result.mobility[at].real),
        "I [m/(N s)]": float(result.mobility[at].imag),
        "u(R) [m/(N s)]": u_r,
        "u(I) [m/(N s)]": u_i,
        "corr(R,I) [1]": corr_ri,
        "Re K* [N/m]": float(result.stiffness[at].real),
        "Im K* [N/m]": float(result.stiffness[at].imag),
        "u(Re K*) [N/m]": u_re,
        "u(Im K*) [N/m]": u_im,
        "corr(Re,Im K*) [1]": corr_k,
        "loss factor [1]": float(result.loss_factor[at]),
        "u(loss factor) [1]": float(result.loss_factor_std[at]),
        "K1 [N/m]": float(result.k1[at]),
        "u(K1) [N/m]": float(result.k1_std[at]),
        "K2 [N/m]": float(result.k2[at]),
        "C [N s/m]": float(result.c[at]),
        "u(K2) [N/m]": u_k2,
        "u(C) [N s/m]": u_c,
        "corr(K2,C) [1]": corr_arm,
        "TR measured [1]": float(result.tr_measured[at]),
        "TR predicted [1]": float(result.tr_predicted[at]),
        "u(TR) [1]": float(result.tr_std[at]),
    }


def _hashes(
    campaign: Campaign, statics: Sequence[StaticTest], dynamic: Sequence[Test], reduced: Sequence[Reduced]
) -> dict[str, str]:
    """Hash of every file that was read, by its name in the campaign."""
    hashes = {name: sha256_of(campaign.folder / name, max_bytes=MOST_BYTES) for name in ("campaign.toml", "tests.csv")}
    hashes |= {item.test.file: item.sha256 for item in statics if item.sha256}
    hashes |= {test.file: item.sha256 for test, item in zip(dynamic, reduced, strict=True) if item.sha256}
    return hashes
