"""Speed of an FMU beside pythonfmu's of the same model, both stepped from C: python bench/bench_fmu.py."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
import xml.etree.ElementTree as ET
import zipfile
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np
from promises import at_least, report
from pythonfmu.builder import FmuBuilder
from pythonfmu_tyre import INPUTS, REST, SPRINGS, TIMES
from side_by_side import agree

from fourpole.export.fmi import fmu
from fourpole.export.fmi.variables import Point
from fourpole.models.maxwell import GeneralisedMaxwell
from fourpole.models.realised import realised

HERE = Path(__file__).parent
HEADERS = HERE.parent / "src" / "fourpole" / "export" / "fmi" / "c"
STEP, COUNT, OURS_OFTENER, ROUNDS = 1e-3, 20_000, 50, 7
#: Least ratio of the times of a step that is promised.
PROMISED = 20.0


@dataclass(frozen=True)
class Unpacked:
    """An FMU in a folder, as the driver takes it."""

    library: Path
    token: str
    resources: str
    inputs: list[int]
    output: int


def unpacked(path: Path, folder: Path, inputs: list[str]) -> Unpacked:
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    root = ET.parse(folder / "modelDescription.xml").getroot()
    places = {one.get("name"): int(one.get("valueReference")) for one in root.iter("ScalarVariable")}
    library = next((folder / "binaries" / "linux64").glob(f"{root.find('CoSimulation').get('modelIdentifier')}.so"))
    resources = (folder / "resources").as_uri()
    return Unpacked(library, root.get("guid"), resources, [places[name] for name in inputs], places["force"])


def driver(folder: Path) -> ctypes.CDLL:
    """The loop over the steps, as a library of this process, whose Python pythonfmu's FMU needs."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise SystemExit("a C compiler is needed: install gcc")
    library = folder / "drive.so"
    flags = ["-std=c99", "-O2", "-shared", "-fPIC", f"-I{HEADERS}"]
    subprocess.run([compiler, *flags, "-o", library, HERE / "drive_fmu.c", "-ldl"], check=True)
    found = ctypes.CDLL(library)
    found.drive.restype = ctypes.c_double
    return found


def drive(loop: ctypes.CDLL, one: Unpacked, motion: np.ndarray) -> tuple[float, np.ndarray]:
    """CPU time of a step [s], and the force after each."""
    forces, count = np.empty(len(motion)), len(motion)
    at = ctypes.POINTER(ctypes.c_double)
    took = loop.drive(
        str(one.library).encode(), one.token.encode(), one.resources.encode(), (ctypes.c_uint * 4)(*one.inputs),
        ctypes.c_uint(one.output), ctypes.c_long(count), ctypes.c_double(STEP), motion.ctypes.data_as(at),
        forces.ctypes.data_as(at),
    )  # fmt: skip
    if took < 0:
        raise SystemExit(f"{one.library.name}: the driver ended with {took:g}")
    return took / count, forces


def main() -> None:
    rng = np.random.default_rng(1982)
    heights = rng.normal(0.0, 1e-3, COUNT * OURS_OFTENER + 1)
    motion = np.zeros((COUNT * OURS_OFTENER, 4))
    motion[:, 0], motion[:, 1] = heights[:-1], np.diff(heights) / STEP
    model = GeneralisedMaxwell(len(TIMES))
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        system = realised(model, [REST, *SPRINGS, *TIMES], (1.0, 100.0))
        (folder / "tyre.fmu").write_bytes(fmu("tyre", "", [Point("tyre", system)], 2)[0])
        names = [name.replace("_", ".") for name in INPUTS]
        ours = unpacked(folder / "tyre.fmu", folder / "ours", names)
        built = FmuBuilder.build_FMU(HERE / "pythonfmu_tyre.py", dest=folder)
        theirs = unpacked(Path(built), folder / "theirs", list(INPUTS))
        loop = driver(folder)
        same = np.ascontiguousarray(motion[:COUNT])
        mine, other = drive(loop, ours, same)[1], drive(loop, theirs, same)[1]
        apart = agree(float(np.max(np.abs(mine - other)) / np.max(np.abs(other))), 1e-9)
        times = np.array([(drive(loop, ours, motion)[0], drive(loop, theirs, same)[0]) for _ in range(ROUNDS)])
    own, peer = median(times[:, 0].tolist()), median(times[:, 1].tolist())
    found = median((times[:, 1] / times[:, 0]).tolist())
    detail = f"{own * 1e9:.0f} ns against {peer * 1e9:.0f} ns of CPU time a step; results differ by {apart}"
    report([at_least("FMU, a step from C, three branches", "pythonfmu", found, PROMISED, detail)])


if __name__ == "__main__":
    main()
