"""The one door through which other programs are started: no other module starts a process.

A program is found by its absolute path, begins in an empty folder of its own, and has no variables of the environment
but those that are listed here. A further process of Fourpole finds its modules where this one does, and never in the
working folder, beside a script or in a campaign.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import weakref
from collections.abc import AsyncIterator, Collection, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    import asyncio

Process: TypeAlias = "subprocess.Popen[bytes]"
PIPE, DEVNULL = subprocess.PIPE, subprocess.DEVNULL

#: How the names of working folders begin.
FOLDERS = "fourpole-"
#: The variable by which the user lets the processes of Fourpole reach storage elsewhere.
REMOTE = "FOURPOLE_REMOTE"
#: Variables of the screen and of the session, which a browser needs.
OF_SCREEN = frozenset(
    {
        "BROWSER", "DBUS_SESSION_BUS_ADDRESS", "DESKTOP_SESSION", "DISPLAY", "GDMSESSION",
        "GNOME_DESKTOP_SESSION_ID", "GTK_IM_MODULE", "KDE_FULL_SESSION", "KDE_SESSION_VERSION", "MOZ_ENABLE_WAYLAND",
        "QT_IM_MODULE", "QT_QPA_PLATFORM", "SESSION_MANAGER", "WAYLAND_DISPLAY", "WSL_DISTRO_NAME", "WSL_INTEROP",
        "XAUTHORITY", "XMODIFIERS",
    }
)  # fmt: skip
#: Variables that every program has: the user, the system, languages and times, caches, and how Python runs.
_EVERY = frozenset(
    {
        "HOME", "LANG", "LANGUAGE", "LOGNAME", "PATH", "SHELL", "TERM", "TZ", "TZDIR", "USER", "APPDATA", "COMSPEC",
        "HOMEDRIVE", "HOMEPATH", "LOCALAPPDATA", "NUMBER_OF_PROCESSORS", "PATHEXT", "PROCESSOR_ARCHITECTURE",
        "PROGRAMDATA", "PROGRAMFILES", "PROGRAMFILES(X86)", "SYSTEMDRIVE", "SYSTEMROOT", "TEMP", "TMP", "TMPDIR",
        "USERNAME", "USERPROFILE", "WINDIR", "COVERAGE_PROCESS_CONFIG", "COVERAGE_PROCESS_START", "FONTCONFIG_FILE",
        "FONTCONFIG_PATH", "MPLBACKEND", "MPLCONFIGDIR", "DYLD_FALLBACK_LIBRARY_PATH", "DYLD_LIBRARY_PATH",
        "LD_LIBRARY_PATH", "PYTHONDONTWRITEBYTECODE", "PYTHONHASHSEED", "PYTHONHOME", "PYTHONIOENCODING",
        "PYTHONNOUSERSITE", "PYTHONPYCACHEPREFIX", "PYTHONUNBUFFERED", "PYTHONUSERBASE", "PYTHONUTF8",
        "PYTHONWARNINGS", "SOURCE_DATE_EPOCH",
    }
)  # fmt: skip
#: How the names of further ones begin and end: threads and allocators of libraries, folders of the user, and our own.
_BEGIN = ("FOURPOLE_", "HDF5_", "KMP_", "LC_", "MALLOC_", "MKL_", "OMP_", "OPENBLAS_", "POLARS_", "XDG_")
_END = ("_MAX_THREADS", "_NUM_THREADS")
#: Variables of storage elsewhere: credentials, servers, certificates.
_REMOTE_BEGIN = ("AWS_", "CURL_CA_", "FSSPEC_", "REQUESTS_CA_", "S3_", "SSL_CERT_")
_REMOTE_END = "_PROXY"
#: Variables that name one folder, and those that list several: a relative one would lead to another place.
_FOLDER = ("MPLCONFIGDIR", "PYTHONPYCACHEPREFIX", "PYTHONUSERBASE", "TEMP", "TMP", "TMPDIR")
_FOLDERS = ("DYLD_FALLBACK_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "LD_LIBRARY_PATH", "PATH")
#: Files by which a folder is known as a campaign.
_OF_CAMPAIGN = ("campaign.toml", "tests.csv")


def program_path(name: str) -> str | None:
    """The absolute path of a program, which is looked for in the absolute folders of PATH alone; None without it."""
    if os.path.dirname(name):  # noqa: PTH120 - Path("./name") loses the step
        return name if Path(name).is_absolute() and _is_program(name) else None
    endings = [*os.environ.get("PATHEXT", "").split(os.pathsep), ""] if sys.platform == "win32" else [""]
    folders = _absolute(os.environ.get("PATH", os.defpath))
    places = (os.path.join(folder, name + ending) for folder in folders for ending in endings)  # noqa: PTH118
    return next(filter(_is_program, places), None)


def start(
    command: Sequence[str],
    *,
    variables: Mapping[str, str] | None = None,
    also: Collection[str] = (),
    folder: str | os.PathLike[str] | None = None,
    group: bool = False,
    stdin: int | None = DEVNULL,
    stdout: int | None = DEVNULL,
    stderr: int | None = None,
) -> Process:
    """Start a program.

    Parameters
    ----------
    command : sequence of str
        The absolute path of the program and its arguments; a path among them must be absolute.
    variables : dict of str to str, optional
        Variables of the environment besides those that every program has.
    also : collection of str
        Names of further variables of this process that the program has.
    folder : path, optional
        Working folder; by default an empty one, which is deleted when the process object is.
    group : bool
        Whether the program and all that it starts are a group of processes of their own.
    stdin, stdout, stderr : int or None
        As `subprocess.Popen` takes them.

    Raises
    ------
    OSError, ValueError
        If the program cannot be started.
    """
    own = None if folder is not None else tempfile.mkdtemp(prefix=FOLDERS)
    try:
        process = subprocess.Popen(
            command,
            stdin=stdin,
            stdout=stdout,
            stderr=stderr,
            **_settings(command, variables, also, own or folder, group),
        )
    except BaseException:
        if own is not None:
            shutil.rmtree(own, ignore_errors=True)
        raise
    if own is not None:
        weakref.finalize(process, shutil.rmtree, own, ignore_errors=True)
    return process


def start_module(module: str, *words: str, variables: Mapping[str, str] | None = None, **settings: Any) -> Process:
    """Start a module of Fourpole as a further process; see `start`."""
    return start(python_command(module, *words), variables=_with_modules(variables), **settings)


@asynccontextmanager
async def running_module(
    module: str, *words: str, variables: Mapping[str, str] | None = None, limit: int
) -> AsyncIterator[asyncio.subprocess.Process]:
    """A module as a further process with pipes, in a group of its own; `limit` is the longest line [byte]."""
    import asyncio

    with tempfile.TemporaryDirectory(prefix=FOLDERS, ignore_cleanup_errors=True) as folder:
        command = python_command(module, *words)
        settings = _settings(command, _with_modules(variables), (), folder, group=True)
        process = await asyncio.create_subprocess_exec(
            *command, stdin=PIPE, stdout=PIPE, stderr=PIPE, limit=limit, **settings
        )
        try:
            yield process
        finally:
            if process.returncode is None:
                with suppress(ProcessLookupError):
                    process.kill()
                await process.wait()


def output_of(command: Sequence[str], *, seconds: float, **settings: Any) -> tuple[int, bytes, bytes]:
    """Exit code, standard output and standard error of a program.

    TimeoutError if it takes longer than `seconds` [s]: it is ended with all that it started. OSError or ValueError if
    it cannot be started.
    """
    with start(command, group=True, stdout=PIPE, stderr=PIPE, **settings) as process:
        try:
            printed, said = process.communicate(timeout=seconds)
        except BaseException as error:  # Ctrl-C too: the program has not got it, in its group
            if hasattr(os, "killpg"):
                with suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
            process.kill()
            if isinstance(error, subprocess.TimeoutExpired):
                raise TimeoutError(f"it did not end within {seconds:.0f} s") from None
            raise
        return process.returncode, printed, said


def interrupt(process: Process | asyncio.subprocess.Process) -> None:
    """Ask a process, which was started in a group of its own, to end as Ctrl-C asks it."""
    with suppress(ProcessLookupError):
        process.send_signal(getattr(signal, "CTRL_BREAK_EVENT", signal.SIGINT))


def open_by_system(address: str) -> bool:
    """Whether Windows opened an address by the program that the user chose for its kind; False on other systems."""
    if sys.platform != "win32":
        return False
    os.startfile(address)
    return True


def cpu_time(process: Process) -> float | None:
    """Processor time that a running process has taken [s]; None where the system does not tell."""
    try:
        told = Path(f"/proc/{process.pid}/stat").read_text(encoding="ascii", errors="replace")
        user, system = told.rpartition(")")[2].split()[11:13]
        return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError):
        return None


def python_command(module: str, *words: str) -> list[str]:
    """The command that runs a module with this Python; `-P` keeps the working folder from its modules."""
    flags = ["-P", *(["-s"] if sys.flags.no_user_site else []), *(["-X", "utf8"] if sys.flags.utf8_mode else [])]
    return [sys.executable, *flags, "-m", module, *words]


def _settings(
    command: Sequence[str],
    variables: Mapping[str, str] | None,
    also: Collection[str],
    folder: str | os.PathLike[str] | None,
    group: bool,
) -> dict[str, Any]:
    """Settings that every start has: environment, working folder, and group of processes.

    ValueError unless the program of the command is an absolute path.
    """
    if not Path(command[0]).is_absolute():
        raise ValueError(f"{command[0]!r} is no absolute path of a program")
    settings: dict[str, Any] = {"cwd": folder, "env": {**_environment(also), **(variables or {})}}
    if not group:
        return settings
    if sys.platform == "win32":
        return {**settings, "creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
    return {**settings, "start_new_session": True}


def _environment(also: Collection[str]) -> dict[str, str]:
    """The variables of this process that a program has."""
    remote = bool(os.environ.get(REMOTE))
    begin = (*_BEGIN, *(_REMOTE_BEGIN if remote else ()))
    kept = {
        name: value
        for name, value in os.environ.items()
        if name in _EVERY
        or name in also
        or name.startswith(begin)
        or name.endswith(_END)
        or (remote and name.upper().endswith(_REMOTE_END))
    }
    kept |= {name: os.path.abspath(kept[name]) for name in _FOLDER if kept.get(name)}  # noqa: PTH100 - a text
    kept |= {name: os.pathsep.join(_absolute(kept[name])) for name in _FOLDERS if name in kept}
    return kept


def _with_modules(variables: Mapping[str, str] | None) -> dict[str, str]:
    """Variables with PYTHONPATH, by which a further process finds the same modules as this one."""
    return {"PYTHONPATH": os.pathsep.join(module_folders()), **(variables or {})}


def module_folders() -> list[str]:
    """Folders in which this process finds modules, in their order, and that of this package, first if it is not there.

    The working folder, now and when this process began, is none of them, nor is that of a script, a relative one or a
    campaign.
    """
    root, unwanted = str(Path(__file__).resolve().parents[2]), {_working_folder(), _BEGAN}
    if script := getattr(sys.modules.get("__main__"), "__file__", None):
        unwanted.add(os.path.realpath(os.path.dirname(os.path.abspath(script))))  # noqa: PTH100, PTH120 - texts
    folders = [
        path
        for path in dict.fromkeys(sys.path)
        if Path(path).is_absolute() and (path == root or not (os.path.realpath(path) in unwanted or _is_campaign(path)))
    ]
    return folders if root in folders else [root, *folders]


def _is_campaign(folder: str) -> bool:
    return any(os.path.lexists(os.path.join(folder, name)) for name in _OF_CAMPAIGN)  # noqa: PTH118 - a text


def _absolute(folders: str) -> list[str]:
    """The absolute ones of listed folders."""
    return [folder for folder in folders.split(os.pathsep) if Path(folder).is_absolute()]


def _is_program(place: str) -> bool:
    return Path(place).is_file() and os.access(place, os.X_OK)


def _working_folder() -> str:
    """The real path of the working folder; empty if it was deleted."""
    try:
        return os.path.realpath(os.getcwd())  # noqa: PTH109 - a text
    except OSError:
        return ""


_BEGAN = _working_folder()
