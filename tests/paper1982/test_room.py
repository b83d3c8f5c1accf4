"""The room of the 1982 paper can be taken out: other rooms name it in their registries only."""

import tomllib
from pathlib import Path

SOURCE = Path(__file__).parents[2] / "src" / "fourpole"
REGISTRIES = {"models/families.py", "findings/list.py", "report/words/sentence.py", "plot/catalogue.py"}


def test_other_rooms_name_it_in_four_registries():
    naming = {
        path.relative_to(SOURCE).as_posix()
        for path in SOURCE.rglob("*.py")
        if path.parent.name != "paper1982" and "paper1982" in path.read_text(encoding="utf-8")
    }
    assert naming == REGISTRIES


def test_each_figure_of_its_catalogue_is_made_here():
    from fourpole.paper1982 import companions, figures

    catalogue = tomllib.loads((SOURCE / "paper1982" / "catalogue.toml").read_text(encoding="utf-8"))
    assert set(catalogue) == {*figures.FIGURES, *companions.FIGURES}
