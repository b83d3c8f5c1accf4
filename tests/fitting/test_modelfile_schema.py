"""The model file's schema and example in the documentation are what is written today."""

import json
import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from fourpole.core.tyre import zener_stiffness
from fourpole.fitting.document import FORMAT, VERSION
from fourpole.fitting.measured import measured_of
from fourpole.fitting.modelfile import ModelFile, read_model_file, schema
from fourpole.fitting.modelling import fit_tyres, map_tyres, model_file
from fourpole.fitting.modelparts import Grown

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = (DOCS / "model-file.md").read_text(encoding="utf-8")
HOW = (
    "docs/model-file.schema.json is not today's: write json.dumps(schema(), indent=1, ensure_ascii=False) and a newline"
)


@pytest.fixture(scope="module")
def stated():
    return json.loads((DOCS / "model-file.schema.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Documents of both kinds, as they stand on disk."""
    frequency, pressure = np.tile([10.0, 14.0, 18.0, 22.0], 3), np.repeat([1.0e5, 1.7e5, 2.4e5], 4)
    k_star = zener_stiffness(150e3 + 0.2 * pressure, 120e3, 700.0, 2 * np.pi * frequency)
    rows = {"tyre": ["a"] * 12, "pressure [Pa]": pressure, "frequency [Hz]": frequency}
    rows |= {"Re K* [N/m]": k_star.real, "Im K* [N/m]": k_star.imag}
    measured = measured_of(pl.DataFrame(rows), std=0.01)
    folder = tmp_path_factory.mktemp("written")
    model_file(measured, fit_tyres(measured, "zener")).write(folder / "model.json")
    model_file(measured, maps=map_tyres(measured, "zener")).write(folder / "map.json")
    return [json.loads((folder / name).read_text(encoding="utf-8")) for name in ("model.json", "map.json")]


def resolved(part, whole):
    """A part of a schema, its reference followed; of one that may be null the other."""
    if "anyOf" in part:
        part = next(one for one in part["anyOf"] if one.get("type") != "null")
    return whole["$defs"][part["$ref"].rpartition("/")[2]] if "$ref" in part else part


def check(value, part, whole, where="the document"):
    """Keys of a document against a schema, to its leaves."""
    if value is None:
        assert {"type": "null"} in part["anyOf"], where
        return
    part = resolved(part, whole)
    if isinstance(value, dict) and "properties" in part:
        assert part["additionalProperties"] is False, where
        assert set(value) <= set(part["properties"]), where
        assert set(part.get("required", [])) <= set(value), where
        for key, one in value.items():
            check(one, part["properties"][key], whole, f"{where}.{key}")
    elif isinstance(value, list):
        assert part["type"] == "array", where
        for at, one in enumerate(value):
            if "items" in part:
                check(one, part["items"], whole, f"{where}[{at}]")


def plain(schema):
    """A schema without what versions of its maker spell out or leave out, and what means the same."""
    if isinstance(schema, list):
        return [plain(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    spared = {"type"} if "const" in schema else set()
    kept = {key: plain(value) for key, value in schema.items() if key not in spared}
    return {key: value for key, value in kept.items() if (key, value) != ("additionalProperties", True)}


def test_the_schema_in_the_documentation_is_todays(stated):
    text = (DOCS / "model-file.schema.json").read_text(encoding="utf-8")
    assert plain(json.loads(text)) == plain(schema()), HOW
    assert stated["$schema"].startswith("https://json-schema.org/draft/")
    assert (stated["properties"]["format"]["const"], stated["properties"]["version"]["const"]) == (FORMAT, VERSION)


def test_every_reference_of_the_schema_leads_somewhere(stated):
    references = set(re.findall(r'"\$ref": "#/\$defs/(\w+)"', json.dumps(stated)))
    assert references == set(stated["$defs"])


def test_what_is_written_has_the_keys_of_the_schema(stated, written):
    for document in written:
        assert set(document) == set(stated["properties"]) - {"axes"}  # the campaign names no axes
        check(document, stated, stated)


@pytest.mark.parametrize("where", ["", "models", "provenance"])
def test_a_key_that_is_not_in_the_schema_is_seen(stated, written, where):
    changed = json.loads(json.dumps(written[0]))
    part = changed[where] if where else changed
    (part[0] if isinstance(part, list) else part)["more"] = 1
    with pytest.raises(AssertionError):
        check(changed, stated, stated)


def test_the_page_says_what_every_key_means(stated):
    keys = {key for part in [stated, *stated["$defs"].values()] for key in part.get("properties", {})}
    assert {key for key in keys if f"`{key}`" not in PAGE and f'"{key}"' not in PAGE} == set()


def test_the_example_of_the_page_can_be_read(tmp_path):
    (example,) = re.findall(r"```json\n(.*?)```", PAGE, flags=re.S)
    path = tmp_path / "mount.json"
    path.write_text(example, encoding="utf-8")
    found = read_model_file(path)
    assert isinstance(found, ModelFile)
    assert found.models[0].conditions[0].tests == ["D1", "D2", "D3"]
    assert json.loads(example) == found.document


def test_the_documentation_names_the_keys_that_version_1_has_gained(written, stated):
    """A key that is added to version 1 is optional, and is written only where it holds something; a link always."""
    (paragraph,) = (part for part in PAGE.split("\n\n") if part.startswith("**Keys that version 1 has gained.**"))
    kinds = {one.__name__: one.later for one in Grown.__subclasses__() for one in (one, *one.__subclasses__())}
    gained = {"link"}.union(*kinds.values()) - {"passive"}  # which is of files before `ranges`
    assert {key for key in re.findall(r"`(\w+)`", paragraph) if key != "K"} == gained
    for name, later in kinds.items():
        part = stated if name == "ModelFile" else stated["$defs"].get(name, {})
        assert not set(later) & set(part.get("required", []))
    for document in written:
        assert "axes" not in document
        assert all("points" not in one for entry in document["models"] for one in entry["conditions"])
