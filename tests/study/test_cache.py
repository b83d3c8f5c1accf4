"""The cache: a stopped run goes on, a changed setting redoes what it touches, and no cache is ever believed blindly."""

import os

import pytest

from fourpole.campaign import read_campaign
from fourpole.study import cache, curvefile, reduce

pytestmark = pytest.mark.thorough


@pytest.fixture
def demodulated(monkeypatch):
    """Labels of the recordings that were worked on, not recalled."""
    labels = []
    true = reduce.demodulate

    def counting(recording, **settings):
        labels.append(recording.label)
        return true(recording, **settings)

    monkeypatch.setattr(reduce, "demodulate", counting)
    return labels


ALL = [f"recordings/D{i}.csv" for i in (1, 2, 3, 4)]


@pytest.fixture
def kept(noisy, demodulated):
    """A campaign that was analysed once, with what it kept."""
    first = again(noisy)
    assert sorted(demodulated) == ALL
    demodulated.clear()
    return noisy, first


def again(folder):
    """By a route that takes each test by itself."""
    return folder.analyse(cache=folder.path / "kept", route="mobility")


def test_a_second_run_recalls_all_and_finds_the_same(kept, demodulated):
    noisy, first = kept
    second = again(noisy)
    assert demodulated == []
    assert second.dynamic.equals(first.dynamic)
    assert second.phasors.equals(first.phasors)
    assert second.sha256 == first.sha256


def test_a_changed_recording_is_redone_alone(kept, demodulated):
    noisy, first = kept
    noisy.cells("D3", slice(0, 1), 3, "0.0001")
    second = again(noisy)
    assert demodulated == ["recordings/D3.csv"]
    changed = [a != b for a, b in zip(second.dynamic.rows(), first.dynamic.rows(), strict=True)]
    assert changed == [False, False, True, False]


def test_a_changed_row_is_redone_alone(kept, demodulated):
    noisy, _ = kept
    noisy.edit("tests.csv", "1.7,1000,14", "1.7,1000,14.1")
    again(noisy)
    assert demodulated == ["recordings/D2.csv"]


#: What is no part of the demodulation, with a column of dynamic.csv that it changes.
REFINED = {
    "preload": ("tests.csv", "1.7,1000,14", "1.7,1100,14", "preload [N]"),
    "rig": ("campaign.toml", 'value = 15.0, unit = "kg"', 'value = 15.1, unit = "kg"', "Re K* [N/m]"),
    "uncertainty": ("campaign.toml", '1 kN", std_gain = "0.02 %"', '1 kN", std_gain = "3 %"', "u(Re K*) [N/m]"),
}


@pytest.mark.parametrize("what", REFINED)
def test_a_refined_statement_opens_no_recording_and_gives_what_a_first_run_gives(kept, demodulated, monkeypatch, what):
    noisy, first = kept
    name, old, new, column = REFINED[what]
    noisy.edit(name, old, new)
    settle(noisy)
    monkeypatch.setattr(reduce, "sha256_of", None)
    monkeypatch.setattr(reduce, "load_recording", None)
    monkeypatch.setattr(curvefile, "load_curve", None)
    second = again(noisy)
    assert demodulated == []
    monkeypatch.undo()
    assert second.dynamic.equals(noisy.analyse(route="mobility").dynamic)
    assert not second.dynamic[column].equals(first.dynamic[column])


def settle(folder):
    """Recordings that changed long ago, analysed since."""
    for path in (folder.path / "recordings").iterdir():
        os.utime(path, ns=(10**18, 10**18))
    again(folder)


def test_a_file_that_was_copied_back_is_hashed_not_demodulated(kept, demodulated):
    noisy, _ = kept
    settle(noisy)
    content = noisy.recording("D3").read_bytes()
    noisy.recording("D3").unlink()
    noisy.recording("D3").write_bytes(content)
    again(noisy)
    assert demodulated == []


def test_only_verify_sees_a_change_behind_the_same_size_time_and_inode(kept, demodulated):
    noisy, _ = kept
    settle(noisy)
    path = noisy.recording("D3")
    content = bytearray(path.read_bytes())
    content[-3] = ord("7") if content[-3] != ord("7") else ord("3")
    with path.open("r+b") as file:
        file.write(content)
    os.utime(path, ns=(10**18, 10**18))
    again(noisy)
    assert demodulated == []
    noisy.analyse(cache=noisy.path / "kept", route="mobility", verify=True)
    assert demodulated == ["recordings/D3.csv"]


def test_a_lost_or_cut_index_costs_the_recordings_not_the_tables(kept, demodulated):
    noisy, first = kept
    index = noisy.path / "kept" / "index.jsonl"
    index.write_bytes(index.read_bytes()[:-20])
    assert again(noisy).dynamic.equals(first.dynamic)
    assert demodulated in ([], ["recordings/D4.csv"])
    index.unlink()
    assert again(noisy).dynamic.equals(first.dynamic)


def test_what_no_run_uses_any_more_is_deleted(kept, monkeypatch):
    noisy, _ = kept
    monkeypatch.setattr(cache, "_RUNS", 2)
    names = {path.name for path in (noisy.path / "kept").glob("*.fpp") if b"LoadCurve" not in path.read_bytes()}
    (noisy.path / "kept" / f"{'a' * 40}.json").write_text("{}")
    noisy.edit("campaign.toml", "gain = 1.02", "gain = 1.03")
    again(noisy)
    assert names <= {path.name for path in (noisy.path / "kept").glob("*.fpp")}
    again(noisy)
    left = {path.name for path in (noisy.path / "kept").iterdir()}
    assert len(left) == 6  # four recordings, one static curve and the index
    assert not names & left


def test_a_cache_that_is_too_large_loses_what_was_used_longest_ago(kept, monkeypatch):
    noisy, _ = kept
    monkeypatch.setattr(cache, "_MOST", 1)
    noisy.edit("campaign.toml", "gain = 1.02", "gain = 1.03")
    again(noisy)
    assert len(list((noisy.path / "kept").glob("*.fpp"))) == 5


@pytest.mark.parametrize(
    ("old", "new", "factor"),
    [("gain = 1.02", "gain = 1.03", 1.03 / 1.02), ('unit = "kN"', 'unit = "N"', 1e-3)],
)
def test_a_changed_channel_redoes_all(kept, demodulated, old, new, factor):
    noisy, first = kept
    noisy.edit("campaign.toml", old, new)
    if factor == 1e-3:
        noisy.edit("campaign.toml", 'range = "1 kN"', 'range = "1 N"')
    second = again(noisy)
    assert sorted(demodulated) == ALL
    for row, before in zip(second.dynamic.rows(named=True), first.dynamic.rows(named=True), strict=True):
        assert row["F1 [N]"] == pytest.approx(factor * before["F1 [N]"], rel=1e-12)


def test_another_route_is_not_recalled_from_this_one(kept, demodulated):
    noisy, _ = kept
    noisy.change("D2", lambda table: table.drop("V2"))
    assert noisy.analyse(cache=noisy.path / "kept").dynamic["verdict"][1] == "warning"
    assert noisy.analyse(cache=noisy.path / "kept", route="relative").dynamic["verdict"][1] == "rejected"


def test_what_a_rejected_recording_said_is_said_again(kept):
    noisy, _ = kept
    noisy.edit("tests.csv", "1.7,1000,14", "1.7,250,14")
    first, second = again(noisy), again(noisy)
    assert first.dynamic["verdict"][1] == "rejected"
    assert second.dynamic.equals(first.dynamic)


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"{}", b'{"checks": [], "phasors": {}}', b"\xff\xfe\x00"])
def test_a_damaged_cache_is_worked_out_again(kept, demodulated, content):
    noisy, first = kept
    for path in (noisy.path / "kept").iterdir():
        path.write_bytes(content)
    assert again(noisy).dynamic.equals(first.dynamic)
    assert sorted(demodulated) == ALL


def test_a_file_cut_short_is_worked_out_again(kept, demodulated):
    noisy, first = kept
    for path in (noisy.path / "kept").iterdir():
        path.write_bytes(path.read_bytes()[:-200])
    assert again(noisy).dynamic.equals(first.dynamic)
    assert sorted(demodulated) == ALL


def test_a_curve_that_is_read_again_unchanged_is_not_written_again(noisy):
    """As of a file that is too young for its time to tell whether it changed."""
    folder = noisy.path / "kept"
    folder.mkdir()
    campaign = read_campaign(noisy.path)
    (static,) = campaign.of_kind("static")

    def read(*, verify):
        kept = cache.Cache(folder, verify=verify)
        found = curvefile.read_curve(campaign, static, kept)
        kept.close()
        return found

    read(verify=False)
    (entry,) = folder.glob("*.fpp")
    os.utime(entry, ns=(10**9, 10**9))
    read(verify=True)
    assert entry.stat().st_mtime_ns == 10**9
    entry.write_bytes(b"damaged")
    assert read(verify=True).curve is not None
    assert entry.read_bytes() != b"damaged"
