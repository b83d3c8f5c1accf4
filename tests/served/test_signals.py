"""Samples for pictures: no peak is lost, whatever part is shown."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from fourpole.errors import TableError
from fourpole.served.signals import keep, kept_in, part_of

RATE, COUNT = 1000.0, 700_001


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory):
    """A recording of 700 s with one spike, a gap, and two rates."""
    place = tmp_path_factory.mktemp("kept")
    t = np.arange(COUNT) / RATE + 5.0
    x = np.sin(t)
    x[123_456] = 50.0
    x[300_000:300_010] = np.nan
    pl.DataFrame({"t [s]": t, "x [mm]": x, "y [N]": np.cos(t)}).write_parquet(place / "a.parquet")
    done: list[tuple[int, int]] = []
    path, folder = place / "a.parquet", place / "kept"
    keep(path, "", ["y", "x [mm]"], folder, progress=lambda *at: done.append(at))
    assert done[-1][0] == done[-1][1]
    return kept_in(folder), x


def test_channels_stand_as_asked_with_unit_and_times(kept) -> None:
    names = [(one["name"], one["unit"], one["count"]) for one in kept[0].channels]
    assert [name.split(" ")[0] for name, _, _ in names] == ["y", "x"]
    assert kept[0].channels[1]["start"] == pytest.approx(5.0)
    assert kept[0].channels[1]["rate"] == pytest.approx(RATE)


@pytest.mark.parametrize("width", [100, 333, 1200, 4000])
@pytest.mark.parametrize(("first", "last"), [(5.0, 705.0), (100.0, 400.0), (128.0, 129.0), (128.4, 128.5)])
def test_the_least_and_the_largest_are_kept(kept, width: int, first: float, last: float) -> None:
    samples, x = kept
    shown = part_of(samples, 1, first, last, width)
    begin, end = round((first - 5.0) * RATE), round((last - 5.0) * RATE) + 1
    part = x[begin:end]
    low = np.array([np.nan if one is None else one for one in shown["low"]])
    high = np.array([np.nan if one is None else one for one in shown.get("high", shown["low"])])
    block = 1024 if len(part) >= 256 * 1024 else 0  # from the overview: whole blocks
    wide = x[max(0, begin - block) : end + block]
    digits = 1e-8 * np.nanmax(np.abs(wide))  # a page has nine of each number
    assert np.nanmax(part) - digits <= np.nanmax(high) <= np.nanmax(wide) + digits
    assert np.nanmin(wide) - digits <= np.nanmin(low) <= np.nanmin(part) + digits
    assert len(shown["t"]) == len(low) <= 2 * width
    assert shown["t"] == sorted(shown["t"])


def test_a_gap_stays_a_gap(kept) -> None:
    shown = part_of(kept[0], 1, 304.99, 305.02, 1000)
    assert shown["low"].count(None) == 10


def test_a_part_beside_the_recording_is_empty(kept) -> None:
    assert part_of(kept[0], 0, 800.0, 900.0, 500) == {"t": [], "low": []}


def test_a_recording_without_the_channels_is_said(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t [s]\n" + "\n".join(str(at) for at in range(20)))
    with pytest.raises(TableError):
        keep(tmp_path / "a.csv", "none", ["F1"], tmp_path / "kept", progress=lambda *_: None)
