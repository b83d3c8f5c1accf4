"""Results as one commit: a reader finds those of one analysis, whatever happened to the folder."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from fourpole.errors import FileError, FourpoleError, ResultsWarning
from fourpole.io.published import (
    LIST,
    STORE,
    Published,
    consistently,
    published,
    published_beside,
    publishing,
    read_listed,
    write_result,
)

FORMER = {"dynamic.csv": "former", "gone.csv": "former", "figures/a.svg": "former"}
NEW = {"dynamic.csv": "new", "figures/a.svg": "new", "figures/b.svg": "new"}
OWN = {"mine.txt": "mine", "mine/notes.csv": "mine"}


def publish(
    folder: Path,
    files: dict[str, str],
    record: dict[str, object] | None = None,
    obsolete: tuple[str, ...] = ("gone.csv", "never.csv"),
    basis: str = "",
) -> None:
    with publishing(folder, obsolete, basis=basis) as new:
        write(new, files)
        if record is not None:
            (new / LIST).write_text(json.dumps(record))


def write(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def contents(results: Published) -> dict[str, str]:
    assert results.files is not None
    return {name: results.read(name).decode() for name in results.files}


def visible(folder: Path) -> dict[str, str]:
    """The files under their usual names."""
    paths = [path for path in folder.rglob("*") if path.is_file() and STORE not in path.parts]
    return {path.relative_to(folder).as_posix(): path.read_text() for path in paths if path.name != LIST}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    results = tmp_path / "campaign" / "results"
    results.mkdir(parents=True)
    write(results, OWN)
    publish(results, FORMER, {"title": "former"})
    return results


def test_all_files_become_results_together_and_the_users_own_stay(folder: Path) -> None:
    assert contents(published(folder)) == FORMER
    publish(folder, NEW, {"title": "new"})
    assert contents(published(folder)) == NEW
    assert published(folder).record["title"] == "new"
    assert visible(folder) == {**NEW, **OWN}


def test_further_files_join_the_list(folder: Path) -> None:
    publish(folder, {"model.json": "model"}, basis=published(folder).sha256("dynamic.csv"))
    assert contents(published(folder)) == {"dynamic.csv": "former", "figures/a.svg": "former", "model.json": "model"}
    write_result(folder / "map.json", b"map")
    assert read_listed(folder / "map.json") == b"map"
    assert published(folder).record["title"] == "former"


def test_files_made_of_results_that_were_renewed_meanwhile_are_refused(folder: Path) -> None:
    basis = published(folder).sha256("dynamic.csv")
    publish(folder, NEW, {})
    with pytest.raises(FileError, match="the results were renewed meanwhile"):
        publish(folder, {"model.json": "model"}, basis=basis)
    assert contents(published(folder)) == NEW


def test_a_failure_before_the_end_changes_nothing(folder: Path) -> None:
    def stopped() -> None:
        with publishing(folder) as new:
            write(new, NEW)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert contents(published(folder)) == FORMER
    assert not list((folder / STORE).glob("new-*"))


def test_a_changed_file_is_taken_from_the_store_with_a_warning_and_put_back_by_the_next_writer(folder: Path) -> None:
    (folder / "dynamic.csv").write_text("forged")  # of the same length
    with pytest.warns(ResultsWarning, match=r"dynamic\.csv is not as study\.json lists it: changed by hand"):
        assert published(folder).read("dynamic.csv") == b"former"
    publish(folder, {"model.json": "model"})
    assert (folder / "dynamic.csv").read_text() == "former"


def test_a_changed_file_that_the_store_lacks_is_one_message(folder: Path) -> None:
    listed = published(folder).files["dynamic.csv"]
    (folder / STORE / listed.sha256).write_text("forged")
    (folder / "dynamic.csv").write_text("changed")
    with pytest.raises(FileError, match=r"dynamic\.csv is not as study\.json lists it: .*; run fourpole analyse again"):
        published(folder).read("dynamic.csv")


def test_a_copy_of_the_results_without_the_store_is_read(folder: Path, tmp_path: Path) -> None:
    for path in (folder / STORE).iterdir():
        path.unlink()
    (folder / STORE).rmdir()
    assert contents(published(folder)) == FORMER


def test_the_store_holds_the_files_of_this_list_and_of_the_former_one(folder: Path) -> None:
    reading = published(folder)
    publish(folder, NEW, {})
    assert contents(reading) == FORMER  # who has begun to read ends with the same results
    publish(folder, {"dynamic.csv": "newest"}, {})
    with pytest.raises(FileError, match="renewed while they were read"):
        contents(reading)
    assert len(list((folder / STORE).iterdir())) == 2  # "new" of three files is one content


def test_a_folder_without_a_list_is_read_and_written_as_it_lies(tmp_path: Path) -> None:
    write(tmp_path, {"dynamic.csv": "old", LIST: '{"results": {"dynamic.csv": "0"}}'})
    assert published(tmp_path).read("dynamic.csv") == b"old"
    publish(tmp_path, {"model.json": "model"})
    assert (tmp_path / "model.json").read_text() == "model"
    assert published(tmp_path).files is None


def test_a_name_that_another_program_holds_is_told_and_completed_by_the_next_writer(folder: Path) -> None:
    (folder / "dynamic.csv").unlink()
    (folder / "dynamic.csv").mkdir()
    with pytest.warns(ResultsWarning, match=r"dynamic\.csv \(.*\) cannot be replaced now: the results are whole"):
        publish(folder, NEW, {})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResultsWarning)
        assert contents(published(folder)) == NEW
    (folder / "dynamic.csv").rmdir()
    publish(folder, {"model.json": "model"})
    assert visible(folder) == {**NEW, **OWN, "model.json": "model"}


# ---- what a hostile folder holds


def test_an_old_journal_is_ignored_and_told(folder: Path) -> None:
    home = folder.parent.parent / ".bashrc"
    home.write_text("mine")
    hidden = folder / ".fourpole-0123456789ab.tmp"
    write(hidden, {"journal.json": '{"new": [], "gone": ["../../.bashrc"]}', "lock": "", "old/../../.bashrc": "theirs"})
    with pytest.warns(ResultsWarning, match=r"\.fourpole-0123456789ab\.tmp: is of an older Fourpole"):
        assert contents(published(folder)) == FORMER
    with pytest.warns(ResultsWarning):
        publish(folder, NEW, {})
    assert home.read_text() == "mine"


@pytest.mark.parametrize("name", ["../campaign.toml", "/tmp/x.csv", "figures/../../a.csv", ".store/a.csv", "a.sh", ""])
def test_a_list_with_other_names_makes_none_of_them_be_read_or_written(folder: Path, name: str) -> None:
    (folder.parent / "campaign.toml").write_text("title = 'mine'")
    record = json.loads((folder / LIST).read_text())
    record["results"][name] = record["results"]["gone.csv"]
    record["sizes"][name] = 6
    (folder / LIST).write_text(json.dumps(record))
    assert not published(folder).has(name)
    publish(folder, NEW)
    assert (folder.parent / "campaign.toml").read_text() == "title = 'mine'"
    assert not (folder / "a.sh").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="links need a right there")
@pytest.mark.parametrize("link", [STORE, "figures"])
def test_nothing_is_written_through_a_link(folder: Path, tmp_path: Path, link: str) -> None:
    away = tmp_path / "away"
    (folder / link).rename(away)
    (folder / link).symlink_to(away)
    before = sorted(path.name for path in away.iterdir())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResultsWarning)
        if link == STORE:
            with pytest.raises(FileError, match="no folder, but a file or a link"):
                publish(folder, NEW, {})
        else:
            publish(folder, NEW, {})
            assert contents(published(folder)) == NEW
    assert sorted(path.name for path in away.iterdir()) == before
    assert all(path.read_text() == "former" for path in away.iterdir())


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes in folders")
def test_a_pipe_in_place_of_a_result_does_not_block(folder: Path) -> None:
    (folder / "dynamic.csv").unlink()
    os.mkfifo(folder / "dynamic.csv")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResultsWarning)
        assert published(folder).read("dynamic.csv") == b"former"
    (folder / LIST).unlink()
    os.mkfifo(folder / LIST)
    with pytest.raises(FileError, match="is a pipe or device"):
        published(folder)


def test_a_study_of_another_program_lists_nothing(tmp_path: Path) -> None:
    (tmp_path / LIST).write_text('{"trials": 3}')
    (tmp_path / "k-star.csv").write_text("mine")
    assert read_listed(tmp_path / "k-star.csv") == b"mine"
    write_result(tmp_path / "model.json", b"{}")
    assert (tmp_path / LIST).read_text() == '{"trials": 3}'


def test_a_result_that_is_too_large_for_its_reader_is_not_said_to_be_changed(folder: Path) -> None:
    with pytest.raises(FileError, match=r"dynamic.csv: has .* MB, more than the .* MB allowed"):
        published(folder).read("dynamic.csv", max_bytes=3)


def test_a_table_and_what_belongs_to_it_are_of_one_list(folder: Path) -> None:
    seen = published_beside(folder / "dynamic.csv")
    publish(folder, NEW, {"title": "new"})
    assert read_listed(folder / "dynamic.csv", results=seen) == b"former"
    assert seen.read("figures/a.svg") == b"former"


def test_a_file_of_former_tables_is_not_put_beside_new_ones(folder: Path) -> None:
    basis = published(folder).sha256("dynamic.csv")
    publish(folder, NEW, {"title": "new"})
    with pytest.raises(FileError, match="renewed meanwhile"):
        write_result(folder / "page.html", b"of the former", basis=basis)
    assert not (folder / "page.html").exists()


def test_a_name_that_no_list_has_is_written_as_a_file_of_the_user(folder: Path) -> None:
    write_result(folder / "my model.json", b"{}")
    publish(folder, NEW)
    assert (folder / "my model.json").read_bytes() == b"{}"


# ---- processes that are killed, and others that read meanwhile

#: Processes, forked from one, of which each publishes and kills itself before its n-th call that changes a folder.
KILLED = """
import json, os, shutil, signal, sys
from pathlib import Path
from fourpole.io.published import publishing
left = 0
def counted(module, name):
    true = getattr(module, name)
    def call(*given, **more):
        global left
        if left == 0:
            os.kill(os.getpid(), signal.SIGKILL)
        left -= 1
        return true(*given, **more)
    setattr(module, name, call)
for module, name in ((Path, "replace"), (Path, "unlink"), (Path, "mkdir"), (os, "fsync"), (shutil, "copyfile")):
    counted(module, name)
for left, folder in enumerate(sys.argv[2:]):
    if process := os.fork():
        print(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]))
        continue
    with publishing(folder, ["gone.csv"]) as new:
        for name, text in {**json.loads(sys.argv[1]), "study.json": "{}"}.items():
            (new / name).parent.mkdir(exist_ok=True)
            (new / name).write_text(text)
    os._exit(0)
"""
STEPS = 60


@pytest.mark.skipif(sys.platform == "win32", reason="processes are killed in another way there")
@pytest.mark.sampled(2)
def test_wherever_a_writer_is_killed_the_results_are_the_former_ones_or_the_new_ones(tmp_path: Path) -> None:
    folders = [tmp_path / str(step) for step in range(STEPS)]
    for folder in folders:
        write(folder, OWN)
        publish(folder, FORMER, {})
    command = [sys.executable, "-c", KILLED, json.dumps(NEW), *map(str, folders)]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    found = [contents(published(folder)) for folder in folders]
    renewed = [one == NEW for one in found]
    assert all(one in (FORMER, NEW) for one in found)
    assert sorted(renewed) == renewed  # former up to one step, new from it on
    killed = said.count(str(-signal.SIGKILL))
    assert said == [str(-signal.SIGKILL)] * killed + ["0"] * (STEPS - killed)
    assert 8 < renewed.index(True) < killed - 4 < STEPS
    for folder in folders[:killed]:
        publish(folder, NEW, {})
        assert visible(folder) == {**NEW, **OWN}
        assert not list((folder / STORE).glob("new-*"))


WRITER = """
import json, sys
from fourpole.io.published import publishing
for generation in range(int(sys.argv[2])):
    with publishing(sys.argv[1]) as new:
        for name in ("dynamic.csv", "static.csv", "checks.csv", "study.json"):
            (new / name).write_text(json.dumps({"generation": generation}))
"""


@pytest.mark.sampled(2)
def test_who_reads_while_others_write_finds_files_of_one_generation(folder: Path) -> None:
    def generations(results: Published) -> set[str]:
        names = ("dynamic.csv", "static.csv", "checks.csv")
        return {results.read(name).decode() for name in names if results.has(name)}

    writers = [subprocess.Popen([sys.executable, "-c", WRITER, str(folder), "60"]) for _ in range(2)]
    seen = set()
    while any(writer.poll() is None for writer in writers):
        found = consistently(folder, generations)
        assert len(found) == 1
        seen |= found
    assert [writer.returncode for writer in writers] == [0, 0]
    assert len(seen) > 3


def test_results_that_are_renewed_all_the_time_are_an_error_and_not_a_mixture(folder: Path) -> None:
    def read(results: Published) -> dict[str, str]:
        for text in ("one", "two"):
            publish(folder, {"dynamic.csv": text + results.mark}, {})
        return contents(results)

    publish(folder, {"dynamic.csv": "of no other file"}, {})
    with pytest.raises(FourpoleError, match="renewed while they were read"):
        consistently(folder, read)
