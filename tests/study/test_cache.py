"""The cache: a stopped run goes on, a changed setting redoes what it touches, and no cache is ever believed blindly."""

import json
import os
import shutil
import zlib

import pytest
from tests.conftest import Folder
from tests.entries import entries_of, put_entries

from fourpole.campaign import read_campaign
from fourpole.core.loadcurve import LoadCurve
from fourpole.io import userfolders
from fourpole.io.identity import identity_of
from fourpole.io.kernel import filled_by
from fourpole.io.userfolders import user_key
from fourpole.study import cache, reduce, static

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
@pytest.mark.sampled(3)
def test_a_refined_statement_opens_no_recording_and_gives_what_a_first_run_gives(kept, demodulated, monkeypatch, what):
    noisy, first = kept
    name, old, new, column = REFINED[what]
    noisy.edit(name, old, new)
    settle(noisy)
    monkeypatch.setattr(reduce, "sha256_of", None)
    monkeypatch.setattr(reduce, "load_recording", None)
    monkeypatch.setattr(static, "load_curve", None)
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
    monkeypatch.setattr(cache, "_DELETED", 0.0)
    names = {name for name, (_, content) in entries_of(noisy.path / "kept").items() if b"LoadCurve" not in content}
    for former in (f"{'a' * 40}.json", f"{'a' * 40}.fpp"):
        (noisy.path / "kept" / former).write_text("{}")
    noisy.edit("campaign.toml", "gain = 1.02", "gain = 1.03")
    again(noisy)
    assert names <= set(entries_of(noisy.path / "kept"))
    again(noisy)
    assert sorted(path.name for path in (noisy.path / "kept").iterdir()) == ["index.jsonl", "kept.fpp"]
    left = set(entries_of(noisy.path / "kept"))
    assert len(left) == 5  # four recordings and one static curve
    assert not names & left


def test_a_cache_that_is_too_large_loses_what_was_used_longest_ago(kept, monkeypatch):
    noisy, _ = kept
    monkeypatch.setattr(cache, "_MOST", 1)
    noisy.edit("campaign.toml", "gain = 1.02", "gain = 1.03")
    again(noisy)
    assert len(entries_of(noisy.path / "kept")) == 5


@pytest.mark.parametrize(
    ("old", "new", "factor"), [("gain = 1.02", "gain = 1.03", 1.03 / 1.02), ('unit = "kN"', 'unit = "N"', 1e-3)]
)
@pytest.mark.sampled(2)
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
@pytest.mark.sampled(6)
def test_a_damaged_cache_is_worked_out_again(kept, demodulated, content):
    noisy, first = kept
    for path in (noisy.path / "kept").iterdir():
        path.write_bytes(content)
    assert again(noisy).dynamic.equals(first.dynamic)
    assert sorted(demodulated) == ALL


def test_what_is_cut_off_is_worked_out_again(kept, demodulated):
    noisy, first = kept
    path = noisy.path / "kept" / "kept.fpp"
    path.write_bytes(path.read_bytes()[:-200])
    assert again(noisy).dynamic.equals(first.dynamic)
    assert demodulated == ["recordings/D4.csv"]


def test_a_curve_that_is_read_again_unchanged_is_not_written_again(noisy):
    """As of a file that is too young for its time to tell whether it changed."""
    folder = noisy.path / "kept"
    folder.mkdir()
    campaign = read_campaign(noisy.path)
    (test,) = campaign.of_kind("static")

    def read(*, verify):
        kept = cache.Cache(folder, verify=verify)
        curve, _ = static.read_curve(campaign, test, kept)
        kept.close()
        return curve

    read(verify=False)
    entry = folder / "kept.fpp"
    os.utime(entry, ns=(10**9, 10**9))
    read(verify=True)
    assert entry.stat().st_mtime_ns == 10**9
    entry.write_bytes(b"damaged")
    assert isinstance(read(verify=True), LoadCurve)
    assert len(entries_of(folder)) == 1


# --- what others put there -------------------------------------------------------------------------------------------


def rotate(folder):
    """Each entry has the content of the next one."""
    entries = entries_of(folder)
    contents = list(entries.values())
    put_entries(folder, dict(zip(entries, [*contents[1:], contents[0]], strict=True)))


def edit_amplitudes(folder):
    """Each entry has other numbers, and the checksum of them."""
    entries = entries_of(folder)
    for name, (signed, content) in entries.items():
        body = bytearray(content[8:])
        body[-28] ^= 0x40
        entries[name] = signed, b"FPP1" + zlib.crc32(body).to_bytes(4, "little") + body
    put_entries(folder, entries)


def exchange_hashes(folder):
    """Each recording is noted with the hash of another, in lines as this user's Fourpole signed them."""
    index = folder / "index.jsonl"
    lines = index.read_text().splitlines()
    said = [json.loads(line) for line in lines]
    hashes = [body[2] for _, body in said[1:]]
    for (_, body), other in zip(said[1:], [*hashes[1:], hashes[0]], strict=True):
        body[2] = other
    index.write_text("\n".join(json.dumps(line, separators=(",", ":")) for line in said) + "\n")


def other_user(folder):
    """Another user analysed the same folder: all is as it would be, but for the key."""
    user_key.cache_clear()
    key = (userfolders.config_folder() / "key").read_bytes()
    (userfolders.config_folder() / "key").write_bytes(bytes(32))
    again(Folder(folder.parent))
    (userfolders.config_folder() / "key").write_bytes(key)
    user_key.cache_clear()


@pytest.mark.parametrize("attack", [rotate, edit_amplitudes, exchange_hashes, other_user])
@pytest.mark.sampled(4)
def test_what_others_put_into_a_cache_decides_no_number(kept, demodulated, attack):
    noisy, _ = kept
    noisy.cells("D3", slice(0, 1), 3, "0.0001")
    settle(noisy)
    fresh = noisy.analyse(route="mobility")
    attack(noisy.path / "kept")
    demodulated.clear()
    second = again(noisy)
    assert second.dynamic.equals(fresh.dynamic)
    assert second.static.equals(fresh.static)
    assert second.sha256 == fresh.sha256
    assert second.notes == fresh.notes
    assert sorted(demodulated) == (ALL if attack is not exchange_hashes else [])


def test_an_index_of_another_folder_is_no_index(kept, demodulated, tmp_path):
    """An archive may have files of the same name, size, time and inode number, and a signed index of this user."""
    noisy, _ = kept
    settle(noisy)
    other = Folder(shutil.copytree(noisy.path, tmp_path / "other"))
    signed = cache.Cache(noisy.path / "kept")
    for name in ("D2", "D3"):
        sha256 = signed.hash_noted(f"recordings/{name}.csv", identity_of(noisy.recording(name)))
        other.recording(name).write_bytes(noisy.recording("D4").read_bytes())
        os.utime(other.recording(name), ns=(10**18, 10**18))
        signed.note(f"recordings/{name}.csv", identity_of(other.recording(name)), sha256)
    signed.close()
    shutil.copy(noisy.path / "kept" / "index.jsonl", other.path / "kept" / "index.jsonl")
    fresh = other.analyse(route="mobility")
    assert fresh.dynamic["verdict"].to_list() != ["ok"] * 4
    assert again(other).dynamic.equals(fresh.dynamic)


def test_a_campaign_that_was_moved_opens_its_recordings_and_reduces_none(kept, demodulated, tmp_path):
    noisy, first = kept
    moved = Folder(noisy.path.rename(tmp_path / "moved"))
    assert again(moved).dynamic.equals(first.dynamic)
    assert demodulated == []


def test_an_index_goes_on_after_a_run_that_was_killed(kept, demodulated, monkeypatch):
    """The lines that were written while it ran count, and so do those of the runs before it."""
    noisy, first = kept
    settle(noisy)
    noisy.cells("D3", slice(0, 1), 3, "0.0001")
    os.utime(noisy.recording("D3"), ns=(10**18, 10**18))
    monkeypatch.setattr(cache.Cache, "close", lambda self: self._journal.close())
    again(noisy)
    monkeypatch.undo()
    with (noisy.path / "kept" / "index.jsonl").open("ab") as file:
        file.write(b'["0123')  # the line at which it was killed
    monkeypatch.setattr(reduce, "sha256_of", None)
    monkeypatch.setattr("fourpole.study.workers.sha256_of", None)
    assert again(noisy).counts == first.counts


# --- what stands in the place of the cache ---------------------------------------------------------------------------


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes among the files here")
@pytest.mark.parametrize("name", ["index.jsonl", "kept.fpp"])
@pytest.mark.parametrize("place", ["fifo", "link", "hard link", "folder"])
@pytest.mark.sampled(4)
def test_nothing_is_read_from_or_written_to_what_is_no_file_of_the_cache(kept, tmp_path, name, place):
    noisy, first = kept
    outside = tmp_path / "precious"
    outside.write_text("mine\n")
    path = noisy.path / "kept" / name
    path.unlink()
    if place == "fifo":
        os.mkfifo(path)
    elif place == "link":
        path.symlink_to(outside)
    elif place == "hard link":
        path.hardlink_to(outside)
    else:
        path.mkdir()
    noisy.cells("D3", slice(0, 1), 3, "0.0001")
    fresh = noisy.analyse(route="mobility")
    assert again(noisy).dynamic.equals(fresh.dynamic)
    assert again(noisy).dynamic.equals(fresh.dynamic)
    assert outside.read_text() == "mine\n"
    assert first.counts == fresh.counts


@pytest.mark.parametrize("level", ["kept", "above"])
@pytest.mark.parametrize("target", ["full", "empty", "missing"])
@pytest.mark.sampled(4)
def test_a_cache_that_a_link_leads_out_of_the_campaign_is_none(noisy, tmp_path, level, target):
    """Neither read, nor written, nor tidied: what lies there is named as files of a cache are."""
    outside = tmp_path / "outside"
    if target != "missing":
        (outside / "kept").mkdir(parents=True)
    if target == "full":
        for place in (outside, outside / "kept"):
            (place / f"{'a' * 40}.json").write_text("{}")
            (place / f"{'b' * 40}.fpp").write_text("")
            (place / ".a.fpp.0123456789ab.tmp").mkdir()
    before = sorted(outside.rglob("*"))
    (noisy.path / level).symlink_to(outside)
    fresh = noisy.analyse(route="mobility")
    place = noisy.path / "kept" if level == "kept" else noisy.path / "above" / "kept"
    assert noisy.analyse(route="mobility", cache=place).dynamic.equals(fresh.dynamic)
    assert sorted(outside.rglob("*")) == before


def test_a_link_within_the_campaign_is_no_cache_either(noisy):
    (noisy.path / "kept").symlink_to("recordings")
    before = sorted(noisy.path.rglob("*"))
    assert again(noisy).dynamic.equals(noisy.analyse(route="mobility").dynamic)
    assert sorted(noisy.path.rglob("*")) == before


def test_a_file_in_place_of_the_cache_is_no_cache(noisy):
    (noisy.path / "kept").write_text("mine")
    assert again(noisy).dynamic.equals(noisy.analyse(route="mobility").dynamic)
    assert (noisy.path / "kept").read_text() == "mine"


@pytest.mark.usefixtures("library")
def test_what_the_library_in_c_gave_is_not_recalled_for_numpy(tmp_path):
    names = set()
    for filling in ("c", "numpy"):
        with filled_by(filling):
            names.add(cache.Cache(tmp_path).name([], "0"))
    assert len(names) == 2
