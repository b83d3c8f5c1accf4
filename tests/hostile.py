"""Campaign folders that somebody has made to harm, and the commands that read them: `python -m tests.hostile` runs all.

Each case is a copy of an analysed campaign with one change. Beside it stands a tree that no command may change, whose
files have a word that no command may say.
"""

from __future__ import annotations

import gzip
import io
import json
import os
import pkgutil
import re
import resource
import shutil
import signal
import socket
import stat
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import polars as pl
from tests.entries import entries_of, put_entries
from tests.forked import Commands, Run, called, commands
from tests.selection import share, turn

import fourpole
from fourpole.io.published import LIST, published, publishing
from fourpole.virtual import RADIAL_PLY, simulate_campaign

#: Memory that a command may take beyond what loading all modules took [byte], and its CPU time [s]; a command that
#: waits is ended after the last time [s], which no sound one comes near.
MEMORY, CPU, WAIT = 2_000_000_000, 20, 300
SECRET = "hunter2"
#: Size of a file that is all hole [byte]; a recording may be as large, but its hash takes a second a gigabyte: less.
SPARSE, SPARSE_RECORDING = 64_000_000_000, 2_000_000_000

Change = Callable[[Path], object]


# ---- what stands in place of a file or folder


def link(path: str) -> Change:
    """A link, seen from the campaign's folder; the tree beside it has the name `beside`."""

    def change(place: Path) -> None:
        campaign = next(folder for folder in place.parents if folder.name == "campaign")
        place.symlink_to(Path(os.path.relpath(campaign, place.parent), path))

    return change


def write(content: str | bytes) -> Change:
    return lambda place: place.write_bytes(content if isinstance(content, bytes) else content.encode())


def bind(place: Path) -> None:
    """A socket; its path may have only 107 characters, so it is made under a short name."""
    with tempfile.TemporaryDirectory() as short, socket.socket(socket.AF_UNIX) as made:
        made.bind(f"{short}/s")
        shutil.move(f"{short}/s", place)


def device(place: Path) -> None:
    """The device that gives zeros without end, or a link to it where only root may make devices."""
    try:
        os.mknod(place, 0o666 | stat.S_IFCHR, os.makedev(1, 5))
    except PermissionError:
        place.symlink_to("/dev/zero")


def sparse(place: Path) -> None:
    place.write_text("{}\n")
    os.truncate(place, SPARSE_RECORDING if place.parent.name == "recordings" else SPARSE)


def circle(place: Path) -> None:
    other = place.with_name("circle")
    other.symlink_to(place.name)
    place.symlink_to(other.name)


STRANGE: dict[str, Change] = {
    "link to a file outside": link("../beside/secret.toml"),
    "link to a folder outside": link("../beside/folder"),
    "link to nothing outside": link("../beside/new"),
    "link to the campaign": link("."),
    "circle of links": circle,
    "pipe": os.mkfifo,
    "socket": bind,
    "device": device,
    "folder": Path.mkdir,
    "64 GB": sparse,
    "nested": write('{"a": ' * 5000),
    "brackets": write("x = " + "[" * 100_000),
    "no text": write(bytes(range(256)) * 100),
    "half a character": write(b'title = "\xed\xa0\x80"\n'),
}

STATEMENT = ("campaign.toml", "tests.csv", "limits.toml", "recordings", "recordings/D1.csv")
RESULTS = (
    "results", "results/study.json", "results/dynamic.csv", "results/phasors.parquet", "results/model.json",
    "results/figures", "results/.store", "results/cache", "results/cache/index.jsonl", "results/cache/standing.json",
)  # fmt: skip


def instead(name: str, make: Change) -> Change:
    """What is made in place of a file or folder, and of the store, which would have a copy."""

    def change(campaign: Path) -> None:
        place = campaign / name
        if name.startswith("results/") and not name.startswith("results/cache"):
            shutil.rmtree(campaign / "results" / ".store")
        if place.is_dir():
            shutil.rmtree(place)
        place.unlink(missing_ok=True)
        make(place)

    return change


# ---- single cases


def journal(campaign: Path) -> None:
    """A journal of an older Fourpole that names files outside."""
    for number, gone in enumerate(("../../beside/secret.toml", "../../../beside/folder/inner.csv")):
        hidden = campaign / "results" / f".fourpole-{number:012x}.tmp"
        hidden.mkdir()
        (hidden / "journal.json").write_text(json.dumps({"new": ["../../beside/made"], "gone": [gone]}))
        (hidden / "lock").touch()
        (hidden / "old").symlink_to("../../../beside/folder")
        (hidden / "new").symlink_to("../../../beside")


def listed(name: str, **changed: object) -> Change:
    """A name that study.json lists, with the size and hash of dynamic.csv, and other changes of it."""

    def change(campaign: Path) -> None:
        record = json.loads((campaign / "results" / LIST).read_text())
        for key in ("results", "sizes"):
            record[key][name] = record[key]["dynamic.csv"]
        (campaign / "results" / LIST).write_text(json.dumps({**record, **changed}))

    return change


def result(name: str, content: Callable[[], bytes]) -> Change:
    """A result of other content, which study.json lists as it is."""

    def change(campaign: Path) -> None:
        with publishing(campaign / "results") as new:
            (new / name).write_bytes(content())

    return change


@cache
def zeros(count: int) -> bytes:
    """A table of Parquet whose columns have so many zeros in a few bytes; several cases have it, which is made once."""
    buffer = io.BytesIO()
    pl.select(pl.zeros(count, dtype=pl.UInt8).alias("test")).write_parquet(buffer, compression="zstd")
    return buffer.getvalue()


def archive(**members: bytes) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as made:
        for name, content in members.items():
            made.writestr(name.replace("__", "/").replace("_", "."), content)
    return buffer.getvalue()


@cache
def bomb_of_numpy() -> bytes:
    head = b"{'descr': '<f8', 'fortran_order': False, 'shape': (40000000,), }".ljust(117) + b"\n"
    return archive(t_npy=b"\x93NUMPY\x01\x00\x76\x00" + head + bytes(320_000_000))


@cache
def bomb_of_excel() -> bytes:
    sheet = b'<worksheet><sheetData><row r="1"><c t="inlineStr"><is><t>' + bytes(b"a" * 300_000_000)
    return archive(xl__workbook_xml=b"<workbook><sheets/></workbook>", xl__worksheets__sheet1_xml=sheet)


@cache
def bomb() -> bytes:
    return gzip.compress(bytes(300_000_000), 1)


def recording(name: str, content: Callable[[], bytes]) -> Change:
    """Another recording in place of D1."""

    def change(campaign: Path) -> None:
        (campaign / "recordings" / "D1.csv").unlink()
        (campaign / "recordings" / name).write_bytes(content())
        table = campaign / "tests.csv"
        table.write_text(table.read_text().replace("recordings/D1.csv", f"recordings/{name}"))

    return change


#: Names that tests.csv gives; those that a file may have here stand in the folder, too.
NAMES = (
    "CON", "nul.csv", "aux .csv", "..\\x.csv", "\\\\host\\share\\x.csv", "//host/share/x.csv", "C:\\x.csv",
    "../beside/folder/inner.csv", "/etc/passwd", "-rf.csv", "--out=beside", "a\nb.csv", "n" * 251 + ".csv", "n" * 5000, "file:///etc/passwd",
    "s3://bucket/x.csv", "\u202excsv.", "con.csv#1", "recordings", ".", "",
)  # fmt: skip


def names(campaign: Path) -> None:
    head, *rows = (campaign / "tests.csv").read_text().splitlines()
    row = next(row for row in rows if row.startswith("D1,"))
    for number, name in enumerate(NAMES):
        quoted = '"' + name.replace('"', '""') + '"'
        rows.append(row.replace("D1,", f"N{number},", 1).replace("recordings/D1.csv", quoted))
        with suppress(OSError):
            shutil.copy(campaign / "recordings" / "D1.csv", campaign / "recordings" / name.replace("/", ""))
    for name in (b"half \xed\xa0\x80.csv", b"no text \xff\xfe.csv"):
        with suppress(OSError):
            shutil.copy(campaign / "recordings" / "D1.csv", os.fsencode(campaign / "recordings") + b"/" + name)
    (campaign / "tests.csv").write_text("\n".join([head, *rows]) + "\n")


def bare(campaign: Path) -> None:
    names(campaign)
    for name in ("campaign.toml", "tests.csv"):
        (campaign / name).unlink()
    for kind, make in STRANGE.items():
        with suppress(OSError):
            make(campaign / "recordings" / f"{kind}.csv")


def deep(campaign: Path) -> None:
    """Folders in folders, and a circle of links at their end."""
    place = campaign / "recordings"
    for _ in range(500):
        place /= "d"
        place.mkdir()
    (place / "again").symlink_to(campaign)


def exchanged(campaign: Path) -> None:
    """Entries of the cache that stand for each other's recordings, of results that are gone."""
    cache = campaign / "results" / "cache"
    entries = entries_of(cache)
    contents = list(entries.values())
    put_entries(cache, dict(zip(entries, contents[1:] + contents[:1], strict=True)))
    (campaign / "results" / "cache" / "standing.json").unlink()


#: Cases by name, and commands that read what is changed there; a run takes one of these.
SINGLE: dict[str, tuple[Change, tuple[str, ...]]] = {
    "old journals": (journal, ("rig", "analyse", "report", "causality")),
    "a list with a name outside": (listed("../../beside/secret.toml"), ("rig", "analyse", "report")),
    "a list with an absolute name": (listed("/tmp/fourpole-made.csv"), ("rig", "report")),
    "a list with the statement": (listed("../campaign.toml"), ("rig", "analyse")),
    "a list of other kinds": (listed("a.csv", results=[1], sizes={"a": {}}, settings=7), ("rig", "analyse", "verify")),
    "hashes of other kinds": (listed("a.csv", sha256={"../beside/secret.toml": 5}), ("verify", "analyse")),
    "hashes of files outside": (listed("a.csv", sha256={"../beside/secret.toml": "0" * 64}), ("verify", "lab")),
    "many zeros for phasors": (result("phasors.parquet", partial(zeros, 400_000_000)), ("rig", "causality", "export")),
    "many zeros for the covariance": (result("covariance.parquet", partial(zeros, 400_000_000)), ("fit", "compare")),
    "an integer of many digits": (result("model.json", lambda: b'{"a": ' + b"1" * 5000 + b"}"), ("query", "verify")),
    "a compressed bomb": (recording("D1.csv.gz", bomb), ("check", "info")),
    "a bomb of NumPy": (recording("D1.npz", bomb_of_numpy), ("check", "info")),
    "a bomb of a workbook": (recording("D1.xlsx", bomb_of_excel), ("check", "info")),
    "names": (names, ("check", "analyse", "lab")),
    "bare names": (bare, ("init", "lab")),
    "deep folders": (deep, ("check", "lab", "init")),
    "exchanged entries of the cache": (exchanged, ("analyse",)),
}

#: Commands by name; "campaign", "former" and "out" are folders, "D1" is the recording of that test.
COMMANDS: dict[str, tuple[str, ...]] = {
    "check": ("campaign",),
    "analyse": ("campaign", "--tables-only", "--workers", "1"),
    "report": ("campaign/results",),
    "rig": ("campaign/results",),
    "fit": ("campaign/results", "--model", "zener"),
    "causality": ("campaign/results",),
    "map": ("campaign/results",),
    "lab": ("campaign", "--out", "out/lab"),
    "compare": ("former", "campaign/results"),
    "verify": ("campaign", "--quick"),
    "export": ("campaign/results", "--to", "mat", "--out", "out/x.mat"),
    "query": ("campaign/results/model.json", "--frequency", "12 Hz", "--preload", "1000 N", "--pressure", "1.7 bar"),
    "info": ("D1",),
    "init": ("campaign",),
    "open": ("campaign",),
}
OF_STATEMENT = ("check", "analyse", "init", "lab", "info", "verify")
OF_RESULTS = tuple(name for name in COMMANDS if name not in ("check", "init", "info", "report", "fit"))

Case = tuple[str, Change, str]


def cases(*, every: bool) -> Iterator[Case]:
    """Name, change and command of `every` case; else of this turn's sixth of places and kinds, and one command each."""
    places = [(place, kind) for place in (*STATEMENT, *RESULTS) for kind in STRANGE]
    for number, (place, kind) in enumerate(places):
        if not (every or share(number, 6)):
            continue
        those = OF_STATEMENT if place in STATEMENT else OF_RESULTS
        for command in those if every else (those[(number // 6 + turn()) % len(those)],):
            yield f"{kind} for {place}", instead(place, STRANGE[kind]), command
    for name, (change, those) in SINGLE.items():
        for command in tuple(COMMANDS) if every else (those[turn() % len(those)],):
            yield name, change, command


# ---- how they are run


def bounded(words: Sequence[str]) -> None:
    """Run a command with bounds of memory and time."""
    size = int(re.search(r"VmSize:\s+(\d+)", Path("/proc/self/status").read_text())[1]) * 1024  # type: ignore[index]
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, size + MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (CPU, CPU))
    resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000_000, 1_000_000_000))
    signal.alarm(WAIT)
    os.environ["BROWSER"] = "true"
    sys.exit(called(words))


def state_of(folder: Path) -> dict[str, tuple[object, ...]]:
    """All of a tree: mode, size, inode, times and content of each file, folder and link."""
    found: dict[str, tuple[object, ...]] = {}
    for place, folders, files in os.walk(folder):
        for path in (Path(place, name) for name in (".", *folders, *files)):
            seen = path.lstat()
            content = path.read_bytes() if stat.S_ISREG(seen.st_mode) else b""
            found[str(path)] = (seen.st_mode, seen.st_size, seen.st_ino, seen.st_mtime_ns, seen.st_ctime_ns, content)
    return found


@dataclass(frozen=True)
class Corpus:
    """An analysed campaign, of which each case changes a copy, and a folder in which all happens."""

    commands: Commands
    template: Path
    root: Path

    def complaint(self, case: Case) -> str:
        """What a command did that it may not do; empty if all was well."""
        name, change, command = case
        campaign, beside = self._renewed()
        change(campaign)
        before = state_of(beside)
        run = self.commands.run("tests.hostile:bounded", command, *self._words(command, campaign))
        said = self._wrong(run) or ("" if state_of(beside) == before else "wrote outside")
        taken = command == "analyse" and "exchanged" in name and run.code == 0
        if taken and published(campaign / "results").files != self._files():
            said = said or "took an entry of the cache for another recording"
        return said and f"{command} of {name}: {said}: exit code {run.code}: {run.err.strip()[-500:]}"

    def _files(self) -> object:
        return published(self.template / "results").files

    def _renewed(self) -> tuple[Path, Path]:
        """A copy of the campaign, and the tree beside it."""
        shutil.rmtree(self.root, ignore_errors=True)
        campaign, beside = self.root / "campaign", self.root / "beside"
        shutil.copytree(self.template, campaign)
        (beside / "folder").mkdir(parents=True)
        for name in ("secret.toml", ".bashrc", "folder/inner.csv", "folder/study.json", "folder/campaign.toml"):
            (beside / name).write_text(f"{SECRET} = {SECRET}\n")
        (self.root / "out").mkdir()
        return campaign, beside

    def _words(self, command: str, campaign: Path) -> list[str]:
        file = next(iter((campaign / "recordings").glob("D1.*")), campaign / "recordings" / "D1.csv")
        places = {"D1": str(file), "former": str(self.template / "results")}
        words = (places.get(word, word) for word in COMMANDS[command])
        return [str(self.root / word) if word.split("/")[0] in ("campaign", "out") else word for word in words]

    def _wrong(self, run: Run) -> str:
        if run.code in (-signal.SIGXCPU, -signal.SIGALRM, -signal.SIGKILL):
            return "took too long"
        if run.code not in (0, 2, 3) or "Traceback" in run.err:
            return "ended without a message"
        if SECRET in run.out + run.err:
            return "told what stands in a file outside"
        if run.err.count("error:") > 1 or (run.code == 2 and not re.search("^(error|warning|Usage):", run.err, re.M)):
            return "said not one message"
        return ""


@contextmanager
def corpus(folder: Path) -> Iterator[Corpus]:
    """The corpus in a folder, with a process that has all modules of Fourpole loaded."""
    template = folder / "template"
    simulate_campaign(template, tyres=[RADIAL_PLY], pressures=[170e3], preloads=[1000.0], frequencies=[10.0, 14.0])
    modules = [module.name for module in pkgutil.walk_packages(fourpole.__path__, "fourpole.")]
    with commands(["tests.hostile", *(name for name in modules if not name.endswith("__main__"))]) as loaded:
        for words in (["analyse", template, "--tables-only", "--workers", "1"], ["fit", template, "--model", "zener"]):
            assert loaded.run(*words).code == 0
        yield Corpus(loaded, template, folder / "case")


def main() -> int:
    """Run every command on every case."""
    wrong = 0
    with tempfile.TemporaryDirectory() as folder, corpus(Path(folder)) as made:
        every = [
            case
            for case in cases(every=True)
            if re.search(sys.argv[1] if sys.argv[1:] else "", f"{case[2]} of {case[0]}")
        ]
        for case in every:
            if said := made.complaint(case):
                wrong += 1
                sys.stdout.write(said.replace(folder, "") + "\n")
                sys.stdout.flush()
        sys.stdout.write(f"{len(every)} cases, {wrong} wrong, {made.commands.cpu:.0f} s of CPU time\n")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
