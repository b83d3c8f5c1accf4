"""Pages of the Python names, one for each module, from the docstrings: nothing of them is written by hand."""

from __future__ import annotations

import inspect
import re
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from typing import TYPE_CHECKING, Any

import fourpole

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType

    from sphinx.application import Sphinx

#: Heading -> modules and packages whose names stand below it, in this order.
ROOMS = {
    "Campaigns and results": ("campaign", "study", "fitting", "findings.compared", "lab", "planning"),
    "Physics and estimation": ("twoport", "core"),
    "Models of K*": ("models", "paper1982.models", "paper1982.cylinder", "paper1982.shell"),
    "Figures": ("plot",),
    "Files": ("io",),
    "Virtual laboratory": ("virtual",),
    "Quantities, units, errors": ("quantities", "units", "errors"),
}
#: Modules inside these are the house's own: one format each, behind `fourpole.io`.
INSIDE = ("fourpole.io.formats", "fourpole.io.writers")
SECTION = re.compile(r"^(Parameters|Attributes|Returns|Raises|Examples)\n-+$", flags=re.MULTILINE)


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the pages before the sources are read."""
    app.connect("builder-inited", lambda app: write_pages(Path(app.srcdir) / "api" / "made"))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def write_pages(folder: Path) -> None:
    """Write a page for each module and one for the face; a page that is unchanged keeps its time."""
    pages = {"fourpole.rst": face_page()}
    for heading, rooms in ROOMS.items():
        listed = [module for room in rooms for module in modules_of(room) if names_of(module) or offered(module)]
        pages |= {f"{module.__name__}.rst": module_page(module) for module in listed}
        pages[f"{slug(heading)}.rst"] = room_page(heading, listed)
    folder.mkdir(exist_ok=True)
    for old in set(folder.iterdir()) - {folder / name for name in pages}:
        old.unlink()
    for name, text in pages.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def modules_of(room: str) -> Iterator[ModuleType]:
    """A module, or a package with the modules in it."""
    first = import_module(f"fourpole.{room}")
    yield first
    for found in walk_packages(getattr(first, "__path__", []), f"fourpole.{room}."):
        if not found.name.startswith(INSIDE):
            yield import_module(found.name)


def names_of(module: ModuleType) -> list[str]:
    """Public names that the module defines and whose docstrings have sections; all errors of `fourpole.errors`."""
    return [
        name
        for name, one in vars(module).items()
        if not name.startswith("_")
        and (inspect.isfunction(one) or inspect.isclass(one))
        and one.__module__ == module.__name__
        and (module.__name__ == "fourpole.errors" or SECTION.search(inspect.getdoc(one) or ""))
    ]


def offered(module: ModuleType) -> dict[str, str]:
    """Public name -> where it is at home, of the documented names that a package offers and its modules define."""
    if not {"__getattr__", "__all__"} & set(vars(module)):
        return {}
    homes = {
        name: getattr(getattr(module, name), "__module__", "") for name in vars(module).get("__all__", dir(module))
    }
    return {
        name: f"{home}.{name}"
        for name, home in homes.items()
        if home != module.__name__ and home.startswith("fourpole.") and name in names_of(import_module(home))
    }


def first_sentence(of: object) -> str:
    """The first sentence of a docstring, on one line."""
    paragraph = (inspect.getdoc(of) or "").split("\n\n")[0].replace("\n", " ")
    return re.split(r"(?<=\.) ", paragraph)[0].rstrip(".")


def headed(title: str, line: str = "=") -> list[str]:
    """A heading in reStructuredText."""
    return [title, line * len(title), ""]


def link(one: object, name: str, home: str) -> str:
    """A link to the page of a name; its role states the kind, so that a link to nothing is a warning."""
    kind = "mod" if inspect.ismodule(one) else "class" if inspect.isclass(one) else "func"
    return f":py:{kind}:`{name} <{home}>`"


def face_page() -> str:
    """The names of `import fourpole as fp`, each with a link to the page of its module."""
    lines = [
        *headed("fourpole"),
        ".. module:: fourpole",
        "",
        "The names that a script needs first: ``import fourpole as fp``.",
        "",
    ]
    lines += [".. list-table::", "   :widths: 25 75", ""]
    for name in fourpole.__all__:
        one = getattr(fourpole, name)
        home = one.__name__ if inspect.ismodule(one) else f"{one.__module__}.{name}"
        lines += [f"   * - {link(one, name, home)}", f"     - {first_sentence(one)}"]
    return "\n".join(lines) + "\n"


def room_page(heading: str, modules: list[ModuleType]) -> str:
    """The modules below a heading, each with what it is and its names."""
    lines = headed(heading)
    for module in modules:
        homes = {name: f"{module.__name__}.{name}" for name in names_of(module)} | offered(module)
        names = ", ".join(link(getattr(module, name), name, home) for name, home in homes.items())
        lines += [f":doc:`{module.__name__} <{module.__name__}>`", f"   {first_sentence(module)}: {names}", ""]
    lines += [".. toctree::", "   :hidden:", ""]
    lines += [f"   {module.__name__.removeprefix('fourpole.')} <{module.__name__}>" for module in modules]
    return "\n".join(lines) + "\n"


def module_page(module: ModuleType) -> str:
    """The docstring of a module, and those of its names."""
    lines = [*headed(module.__name__), f".. automodule:: {module.__name__}", ""]
    if homes := offered(module):
        names = (link(getattr(module, name), name, home) for name, home in homes.items())
        lines += ["Names: " + ", ".join(names), ""]
    for name in names_of(module):
        kind = "autoclass" if inspect.isclass(getattr(module, name)) else "autofunction"
        lines += [f".. {kind}:: {name}", *(["   :members:"] if kind == "autoclass" else []), ""]
    return "\n".join(lines) + "\n"


def slug(heading: str) -> str:
    """A heading as the name of a file."""
    return re.sub(r"[^a-z]+", "-", heading.lower()).strip("-")
