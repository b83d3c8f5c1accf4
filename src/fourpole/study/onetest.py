"""One test of a study: its rows, amplitudes, checks and remarks, and its recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.campaign.folder import Campaign, read_campaign
from fourpole.campaign.row import Test
from fourpole.core.checks import worst_verdict
from fourpole.core.digits import notebook_html
from fourpole.core.phasor import Phasors
from fourpole.errors import CampaignError
from fourpole.study.record import tests_of
from fourpole.study.tables import Tables
from fourpole.units import nearest, shown

if TYPE_CHECKING:
    from fourpole.core.recording import Recording


class UnknownTestError(CampaignError, KeyError):
    """A study has no test of this name."""

    __str__ = Exception.__str__


@dataclass(frozen=True, repr=False, eq=False)
class OneTest:
    """One test of a study.

    Attributes
    ----------
    stated : Test
        Its row of tests.csv.
    study : TestedTables
        The study that it is part of.

    Examples
    --------
    >>> import tempfile
    >>> import fourpole
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = fourpole.simulate_campaign(
    ...         folder, pressures=[170e3], preloads=[1000.0], frequencies=[14.0], clean=True
    ...     )
    ...     test = fourpole.analyse(made.folder).tests["D1"]
    ...     recording = test.recording()
    >>> test.verdict, round(test.row["C [N s/m]"]), round(recording.duration, 1)
    ('ok', 1400, 4.1)
    """

    stated: Test
    study: TestedTables

    @property
    def name(self) -> str:
        """Name of the test."""
        return self.stated.name

    @property
    def kind(self) -> str:
        """static, dynamic or calibration."""
        return self.stated.kind

    @property
    def rows(self) -> pl.DataFrame:
        """Its rows of static.csv or dynamic.csv: one for each frequency, or for each preload of a static test."""
        return self._of("static" if self.kind == "static" else "dynamic")

    @property
    def row(self) -> dict[str, Any]:
        """Its first row by the heads of the columns, in SI."""
        return self.rows.row(0, named=True)

    @property
    def verdict(self) -> str:
        """ok, warning or rejected: the worst of its rows."""
        return worst_verdict(self.rows[q.VERDICT.head].to_list())

    @property
    def remarks(self) -> tuple[str, ...]:
        """The reasons of the verdict, with what to do."""
        return tuple(dict.fromkeys(text for text in self.rows[q.REMARKS.head].to_list() if text))

    @property
    def checks(self) -> pl.DataFrame:
        """Its rows of checks.csv."""
        return self._of("checks")

    @property
    def preview(self) -> pl.DataFrame:
        """Its rows of previews.parquet: a few cycles of signal, fit and residual, or the static loop."""
        return self._of("previews")

    @property
    def phasors(self) -> Phasors:
        """The complex amplitudes of F1, V1 and V2, one for each frequency.

        Raises
        ------
        CampaignError
            If the test has none: it is static, or no amplitude could be taken from its recording.
        """
        table = self._of("phasors")
        if table.is_empty():
            raise CampaignError(f"test {shown(self.name)} has no amplitudes: {'; '.join(self.remarks) or self.kind}")
        parts = [[table[head].to_numpy() for head in quantity.parts] for quantity in (q.F1, q.V1, q.V2)]
        return Phasors(
            table[q.FREQUENCY.head].to_numpy(),
            np.stack([re + 1j * im for re, im in parts], axis=1),
            np.array(table[q.PHASOR_COVARIANCE.head].to_list(), dtype=float).reshape(-1, 6, 6),
            table[q.FREQUENCY.u_head].to_numpy(),
            table[q.DOF.head].to_numpy(),
        )

    def recording(self, campaign: Campaign | str | Path | None = None) -> Recording:
        """Read the recording of a dynamic test, as the analysis does.

        Parameters
        ----------
        campaign : Campaign or path, optional
            The campaign or its folder; by default the one that was analysed, where study.json says that it is.

        Raises
        ------
        CampaignError
            For a static test, whose curve `preview` has; or if the campaign is not there any more.
        FileError, TableError, RecordingError
            If it cannot be read.
        """
        from fourpole.study.recording import read_recording

        if self.kind == "static":
            raise CampaignError(f"test {shown(self.name)} is static: it has a curve, which preview holds")
        if not self.stated.file:
            raise CampaignError("an older version wrote these results, without the rows of tests.csv: analyse again")
        known = self.study.campaign_there() if campaign is None else campaign
        return read_recording(self.stated.file, known if isinstance(known, Campaign) else read_campaign(known))

    def _of(self, name: str) -> pl.DataFrame:
        table = self.study.table(name)
        return table.filter(pl.col(q.TEST.head) == self.name) if q.TEST.head in table.columns else table

    def __repr__(self) -> str:
        remarks = f": {shown('; '.join(self.remarks), 300)}" if self.remarks else ""
        return f"<test {shown(self.name, 60)}, {self.kind} of {shown(self.stated.tyre, 60)}, {self.verdict}{remarks}>"

    def _repr_html_(self) -> str:
        """Its first row and its remarks, for a notebook."""
        known = {head: value for head, value in self.row.items() if value not in (None, "")}
        cells = [(head, f"{value:.6g}" if isinstance(value, float) else str(value)) for head, value in known.items()]
        title = f"Test {self.name}: {self.verdict}"
        return notebook_html(title, self.remarks, ("column", "value"), cells, most=len(cells))


def _tests_in(study: TestedTables) -> list[Test]:
    """The tests that tables of an older version name, without the rows of tests.csv."""
    statics = [Test(name, 0, kind="static") for name in study.table("static")[q.TEST.head].unique(maintain_order=True)]
    return [
        *statics,
        *(Test(name, 0, kind="dynamic") for name in study.table("dynamic")[q.TEST.head].unique(maintain_order=True)),
    ]


class TestsByName(Mapping[str, OneTest]):
    """The tests of a study by name, in the order of tests.csv."""

    __test__ = False

    def __init__(self, study: TestedTables) -> None:
        """The tests of this study."""
        self._study = study
        stated = study.campaign.tests if study.campaign is not None else tests_of(study.record) or _tests_in(study)
        self._stated = {test.name: test for test in stated}

    def __getitem__(self, name: str) -> OneTest:
        if name not in self._stated:
            near = nearest(str(name), self._stated)
            hint = f"did you mean {near!r}?" if near else f"there are {len(self)}, as {next(iter(self), 'none')!r}"
            raise UnknownTestError(f"no test {shown(str(name))}: {hint}")
        return OneTest(self._stated[name], self._study)

    def __iter__(self) -> Iterator[str]:
        return iter(self._stated)

    def __len__(self) -> int:
        return len(self._stated)

    def __repr__(self) -> str:
        return f"<{len(self)} tests: {', '.join(list(self._stated)[:8])}{', ...' if len(self) > 8 else ''}>"


@dataclass(frozen=True, eq=False)
class TestedTables(Tables):
    """Result tables with their campaign, or with the record by which it is found: the tests of a study."""

    __test__ = False

    record: dict[str, Any]
    campaign: Campaign | None

    @property
    def tests(self) -> TestsByName:
        """The tests by name: `study.tests["D12"]` has its rows, amplitudes, verdict, remarks and recording."""
        return TestsByName(self)

    def campaign_there(self) -> Campaign:
        """The campaign that was analysed, read again from where study.json says that it is.

        Raises
        ------
        CampaignError
            If it is not there.
        """
        if self.campaign is not None:
            return self.campaign
        place, folder = str(self.record.get("campaign") or ""), self.files.folder if self.files is not None else Path()
        try:
            return read_campaign(folder / (place or "no campaign"))
        except CampaignError as error:
            raise CampaignError(f"{error}; pass the folder of the campaign: recording(campaign=...)") from None
