"""The seal of a model file: each change is refused and named, a file that is only formatted otherwise is good."""

import copy
import hashlib
import json
import re
import struct
from pathlib import Path

import pytest
from tests.fitting.test_modelfile import table

from fourpole.errors import ModelError
from fourpole.export import export_results
from fourpole.fitting.measured import measured_of
from fourpole.fitting.modelfile import ModelFile, read_model_file
from fourpole.fitting.modelling import fit_tyres, map_tyres, model_file
from fourpole.fitting.verified import TableState, seal_later, verify
from fourpole.io.seal import KEY, alterations, canonical, sealed

#: RFC 8785, appendix B: bits of a double, and the number.
NUMBERS = """
0000000000000000 0
8000000000000000 0
0000000000000001 5e-324
8000000000000001 -5e-324
7fefffffffffffff 1.7976931348623157e+308
ffefffffffffffff -1.7976931348623157e+308
4340000000000000 9007199254740992
c340000000000000 -9007199254740992
4430000000000000 295147905179352830000
44b52d02c7e14af5 9.999999999999997e+22
44b52d02c7e14af6 1e+23
44b52d02c7e14af7 1.0000000000000001e+23
444b1ae4d6e2ef4e 999999999999999700000
444b1ae4d6e2ef4f 999999999999999900000
444b1ae4d6e2ef50 1e+21
3eb0c6f7a0b5ed8c 9.999999999999997e-7
3eb0c6f7a0b5ed8d 0.000001
41b3de4355555553 333333333.3333332
41b3de4355555554 333333333.33333325
41b3de4355555555 333333333.3333333
41b3de4355555556 333333333.3333334
41b3de4355555557 333333333.33333343
becbf647612f3696 -0.0000033333333333333333
43143ff3c1cb0959 1424953923781206.2
"""


@pytest.mark.parametrize("line", NUMBERS.split("\n")[1:-1])
def test_numbers_are_those_of_the_standard(line):
    bits, text = line.split()
    (value,) = struct.unpack(">d", bytes.fromhex(bits))
    assert canonical(value) == text
    assert canonical([[value, -value, value], 1.0, [value]]).startswith(f"[[{text},")
    assert canonical([1.0, [value]]) == f"[1,[{text}]]"
    assert canonical({"a": [value, "x"]}) == f'{{"a":[{text},"x"]}}'
    assert float(text) == value


def test_integers_are_doubles():
    assert canonical([2**53 + 1, -(2**60), 10**15, 12]) == "[9007199254740992,-1152921504606847000,1000000000000000,12]"
    assert canonical([[], [[]], [0.0, -0.0, 100.0, 1e16, 1.5e-7]]) == "[[],[[]],[0,0,100,10000000000000000,1.5e-7]]"


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), 10**400])
def test_what_is_no_number_has_no_canonical_form(value):
    with pytest.raises(ValueError, match="number"):
        canonical([value])


def test_strings_and_keys_are_those_of_the_standard():
    """RFC 8785, sections 3.2.2.2 and 3.2.3."""
    assert canonical('\u20ac$\u000f\u000aA\'B"\\\\"/') == '"\u20ac$\\u000f\\nA\'B\\"\\\\\\\\\\"/"'
    keys = ["\u20ac", "\r", "\ufb33", "1", "\U0001f600", "\u0080", "\u00f6"]
    ordered = ["\r", "1", "\u0080", "\u00f6", "\u20ac", "\U0001f600", "\ufb33"]
    assert list(json.loads(canonical(dict.fromkeys(keys)))) == ordered


@pytest.fixture(scope="module")
def fitted() -> ModelFile:
    measured = measured_of(table(("a", "b"), (1.7e5,), (1000.0, 1500.0, 2000.0)))
    return model_file(measured, fit_tyres(measured, "zener"), settings={"model": "zener"})


@pytest.fixture(scope="module")
def mapped() -> ModelFile:
    measured = measured_of(table(pressures=(1.0e5, 1.7e5, 2.4e5)))
    return model_file(measured, maps=map_tyres(measured, "zener"))


@pytest.fixture
def place(tmp_path):
    return tmp_path / "model.json"


def at(document, path):
    *way, last = re.findall(r"[a-z_0-9]+", path)
    for step in way:
        document = document[int(step) if step.isdigit() else step]
    return document, int(last) if last.isdigit() else last


def put(path, value):
    """An alteration of one value; a callable makes it from the former one."""

    def change(document):
        part, last = at(document, path)
        part[last] = value(part[last]) if callable(value) else value

    return change


def drop(path):
    def change(document):
        part, last = at(document, path)
        del part[last]

    return change


def swap(path):
    def change(document):
        part, last = at(document, path)
        part[last][0], part[last][1] = part[last][1], part[last][0]

    return change


def twice(path):
    def change(document):
        part, last = at(document, path)
        part[last].append(copy.deepcopy(part[last][0]))

    return change


def digit(value):
    """The number with its last digit changed."""
    text = repr(value)
    return float(text[:-1] + ("3" if text[-1] != "3" else "4"))


ONE = "models[0].conditions[1]"
#: Alterations after which all values still agree with each other: the seal alone shows them. With what is named.
SILENT = {
    "coefficient": (put(f"{ONE}.values[1]", lambda old: 1.01 * old), f"{ONE}.values was changed"),
    "last digit": (put(f"{ONE}.values[0]", digit), f"{ONE}.values was changed"),
    "two values exchanged": (swap(f"{ONE}.values"), f"{ONE}.values was changed"),
    "variance": (put(f"{ONE}.covariance[0][0]", lambda old: 2 * old), f"{ONE}.covariance was changed"),
    "no uncertainty": (put(f"{ONE}.covariance", [[0.0] * 3] * 3), f"{ONE}.covariance was changed"),
    "interval": (put(f"{ONE}.intervals[2][1]", lambda old: old + 1), f"{ONE}.intervals was changed"),
    "interval open": (put(f"{ONE}.intervals[2][1]", None), f"{ONE}.intervals was changed"),
    "end of the band": (put(f"{ONE}.band[1]", 200.0), f"{ONE}.band was changed"),
    "pressure": (put(f"{ONE}.state[0].value", 2.0e5), f"{ONE}.state was changed"),
    "unit of the pressure": (put(f"{ONE}.state[0].unit", "bar"), f"{ONE}.state was changed"),
    "name of the state": (put(f"{ONE}.state[0].name", "load"), f"{ONE}.state was changed"),
    "test": (put(f"{ONE}.tests[0]", "D99"), f"{ONE}.tests was changed"),
    "no tests": (put(f"{ONE}.tests", []), f"{ONE}.tests was changed"),
    "on a bound": (put(f"{ONE}.on_bound", ["C"]), f"{ONE}.on_bound was changed"),
    "chi-square": (put(f"{ONE}.chi2", 1.0), f"{ONE}.chi2 was changed"),
    "degrees of freedom": (put(f"{ONE}.dof", lambda old: old + 1), f"{ONE}.dof was changed"),
    "converged": (put(f"{ONE}.converged", lambda old: not old), f"{ONE}.converged was changed"),
    "agreed": (put(f"{ONE}.agreed", 0.5), f"{ONE}.agreed was changed"),
    "verdict": (put(f"{ONE}.verdict.possible", lambda old: not old), f"{ONE}.verdict was changed"),
    "chance": (put(f"{ONE}.verdict.chance", 0.5), f"{ONE}.verdict was changed"),
    "no verdict": (put(f"{ONE}.verdict", None), f"{ONE}.verdict was changed"),
    "causal": (put("models[0].causal", False), "models[0].causal was changed"),
    "discrepancy": (put("models[0].granted", 0.001), "models[0].granted was changed"),
    "bound": (put("models[0].parameters[0].low", 1.0), "models[0].parameters was changed"),
    "meaning": (put("models[0].parameters[0].meaning", "x"), "models[0].parameters was changed"),
    "choice": (put("models[0].choice", "good"), "models[0].choice was changed"),
    "candidates": (put("models[0].candidates", []), "models[0].candidates was changed"),
    "shape": (put("models[0].shape", {"mode": "shear", "height": 0.01, "area": 1e-3}), "models[0].shape was added"),
    "name of a tyre": (put("models[0].tyre", "c"), "models[0].tyre was changed"),
    "condition deleted": (drop(ONE), "models[0].conditions: 3 were sealed, 2 are there; models[0].conditions[1] was"),
    "conditions exchanged": (swap("models[0].conditions"), "models[0].conditions: the order was changed"),
    "condition twice": (twice("models[0].conditions"), "models[0].conditions: 3 were sealed, 4 are there"),
    "model deleted": (drop("models[0]"), "models: 2 were sealed, 1 are there; models[0] was removed"),
    "models exchanged": (swap("models"), "models: the order was changed"),
    "rig": (put("rig", {"values": {}}), "rig was changed"),
    "axis": (put("axes", [{"column": "camber [deg]"}]), "axes was added"),
    "version that wrote it": (put("provenance.fourpole", "9.9"), "provenance.fourpole was changed"),
    "source": (put("provenance.source", "other.csv"), "provenance.source was changed"),
    "hash of the table": (put("provenance.sha256", "0" * 64), "provenance.sha256 was changed"),
    "settings": (put("provenance.settings.model", "auto"), "provenance.settings was changed"),
    "notes": (put("provenance.notes", ["good"]), "provenance.notes was changed"),
    "notes removed": (drop("provenance.notes"), "provenance.notes was removed"),
    "time of writing": (put(f"{KEY}.written", "2020-01-01T00:00:00Z"), "the seal itself was changed"),
    "whole": (put(f"{KEY}.whole", "0" * 64), "the seal itself was changed"),
    "mark": (put(f"{KEY}.parts.kind", "0" * 16), "kind was changed"),
    "seal removed": (drop(KEY), "is not sealed"),
}
#: Alterations that already the types or the model show.
LOUD = {
    "sign": (put(f"{ONE}.values[1]", lambda old: -old), "outside 0 to inf"),
    "covariance no longer symmetric": (put(f"{ONE}.covariance[0][1]", 1e12), "the covariance is none"),
    "number as text": (put(f"{ONE}.values[0]", str), "valid number"),
    "true for a number": (put(f"{ONE}.values[0]", True), "valid number"),
    "null for a number": (put(f"{ONE}.chi2", None), "valid number"),
    "text for a flag": (put("models[0].causal", "true"), "valid boolean"),
    "1 for a flag": (put("models[0].causal", 1), "valid boolean"),
    "count with a point": (put(f"{ONE}.dof", float), "valid integer"),
    "true for a count": (put(f"{ONE}.dof", True), "valid integer"),
    "text for a count": (put("models[0].candidates[0].free", "3"), "valid integer"),
    "number for a name": (put("models[0].tyre", 1), "valid string"),
    "list for a name": (put(f"{ONE}.tests[0]", ["D1"]), "valid string"),
    "object for a list": (put(f"{ONE}.values", {}), "valid array"),
    "further key": (put(f"{ONE}.more", 1), "more"),
    "key lost": (drop(f"{ONE}.chi2"), "chi2"),
    "order of symbols": (swap("models[0].parameters"), "has the parameters K1, K2, C"),
    "unit": (put("models[0].parameters[0].unit", "kN/m"), "K1 is in 'kN/m' there"),
    "other model": (put("models[0].model", "kelvin"), "parameters"),
    "band that falls": (swap(f"{ONE}.band"), "the band falls"),
    "kind": (put("kind", "map"), "of kind map"),
    "version": (put("version", 2), "is of version 2"),
    "version with a point": (put("version", 1.0), "no version that is known"),
    "format": (put("format", "other"), "no model file"),
    "seal emptied": (put(KEY, {}), "seal"),
    "parts of the seal lost": (drop(f"{KEY}.parts"), "parts"),
    "other method": (put(f"{KEY}.method", "MD5"), "method"),
}


def refused(place, document):
    place.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(ModelError) as error:
        read_model_file(place)
    return str(error.value)


@pytest.mark.parametrize("name", [*SILENT, *LOUD])
def test_a_changed_model_is_refused_and_the_change_is_named(fitted, place, name):
    change, said = {**SILENT, **LOUD}[name]
    fitted.write(place)
    document = json.loads(place.read_text(encoding="utf-8"))
    change(document)
    text = refused(place, document)
    assert said in text
    assert text.startswith("model.json: ")


@pytest.mark.parametrize("name", [name for name in SILENT if name not in ("time of writing", "whole", "mark")])
def test_only_the_seal_shows_these_changes(fitted, place, name):
    """So each of them tests the seal: sealed again after the change, the same file is read."""
    document = fitted.document
    SILENT[name][0](document)
    place.write_text(json.dumps(sealed(document)), encoding="utf-8")
    read_model_file(place)


@pytest.mark.parametrize(
    "path",
    [
        "maps[0].coefficients[0][1]", "maps[0].covariance[3][3]", "maps[0].scatter[0]", "maps[0].band[1]",
        "maps[0].axes[0].values[1]", "maps[0].left_out[0]", "maps[0].static.coefficients[0]", "maps[0].static.std",
    ],
)  # fmt: skip
def test_a_changed_map_is_refused_and_the_change_is_named(mapped, place, path):
    mapped.write(place)
    document = json.loads(place.read_text(encoding="utf-8"))
    put(path, lambda old: 1.001 * old + 1e-6)(document)
    assert f"{re.match(r'maps.0..[a-z_]+', path)[0]} was changed" in refused(place, document)


def test_a_part_of_another_file_is_refused(fitted, place):
    """Each part is as some file has it; only together they are of none."""
    document, other = fitted.document, copy.deepcopy(fitted.document)
    put(f"{ONE}.values[0]", digit)(other)
    other = sealed(other)
    document["models"][0]["conditions"][1] = other["models"][0]["conditions"][1]
    assert f"{ONE}.values was changed" in refused(place, document)
    document[KEY]["parts"] = other[KEY]["parts"]  # with its marks
    assert "the seal itself was changed" in refused(place, document)
    document[KEY] = other[KEY]  # now the whole is that of the other file, which is the same document
    place.write_text(json.dumps(document), encoding="utf-8")
    read_model_file(place)


def test_many_changes_are_listed_and_counted(fitted, place):
    document = fitted.document
    for one in range(3):
        for key in ("chi2", "agreed", "converged"):
            put(f"models[0].conditions[{one}].{key}", lambda old: not old if old is True else old + 1)(document)
    assert "; models[0].conditions[1].chi2 was changed and 4 more. Take the file" in refused(place, document)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text[:-200], "not valid JSON"),
        (lambda text: text.replace('"causal": true', '"causal": false, "causal": true', 1), "'causal' is there twice"),
        (lambda text: text.replace('"chi2": ', '"chi2": NaN, "x": ', 1), "NaN is no number"),
        (lambda text: text.replace('"chi2": ', '"chi2": -Infinity, "x": ', 1), "-Infinity is no number"),
        (lambda text: re.sub(r'"chi2": [\d.]+', '"chi2": 1e999', text, count=1), "inf is no number"),
        (lambda text: re.sub(r'"dof": \d+', f'"dof": 1{"0" * 400}', text, count=1), "beyond all measure"),
        (lambda text: text.replace('"tyre": "a"', '"tyre": "\\ud800"', 1), "model.json"),
        (lambda text: text + text, "not valid JSON"),
        (lambda text: text.replace("{", "// mine\n{", 1), "not valid JSON"),
        (lambda text: text.replace('"model": "zener"', '"model": "' + "[" * 50_000 + '"', 1), "model"),
    ],
)
def test_a_text_that_is_no_strict_json_is_refused(fitted, place, change, said):
    fitted.write(place)
    place.write_text(change(place.read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(ModelError, match=re.escape(said)):
        read_model_file(place)


def shuffled(value):
    """The same document with all keys in the opposite order."""
    if isinstance(value, dict):
        return {key: shuffled(value[key]) for key in reversed(value)}
    return [shuffled(one) for one in value] if isinstance(value, list) else value


def other_numbers(text):
    """Numbers of the same value in other forms: 180000.0 as 180000 and 1.8e5, 0.25 as 25E-2."""
    text = re.sub(r"(?<=[ \[])(\d+)\.0(?=[,\]\n])", r"\1", text)
    text = re.sub(r"(?<=[ \[])(\d+)00000(?=[,\]\n])", r"\1e+5", text)
    return re.sub(r"(?<=[ \[])0\.(\d)(\d*)(?=[,\]\n])", r"\1.\2E-1", text).replace(".E-1", "E-1")


@pytest.mark.parametrize(
    "change",
    [
        lambda text: b"\xef\xbb\xbf" + text.encode(),
        lambda text: text.replace("\n", "\r\n").encode(),
        lambda text: text.encode("utf-16"),
        lambda text: json.dumps(json.loads(text)).encode(),
        lambda text: json.dumps(json.loads(text), indent="\t", ensure_ascii=True).encode(),
        lambda text: json.dumps(json.loads(text), sort_keys=True).encode(),
        lambda text: json.dumps(shuffled(json.loads(text))).encode(),
        lambda text: other_numbers(text).encode(),
    ],
)  # fmt: skip
def test_a_file_that_is_only_formatted_otherwise_is_good(fitted, mapped, place, change):
    for file in (fitted, mapped):
        file.write(place)
        text = place.read_text(encoding="utf-8")
        content = change(text)
        assert content != text.encode()
        place.write_bytes(content)
        assert read_model_file(place) == file


def test_no_way_in_takes_a_changed_file(fitted, tmp_path, run_cli):
    fitted.write(tmp_path / "model.json")
    document = json.loads((tmp_path / "model.json").read_text(encoding="utf-8"))
    SILENT["coefficient"][0](document)
    (tmp_path / "model.json").write_text(json.dumps(document), encoding="utf-8")
    for kind in ("abaqus", "ansys", "lsdyna", "lsdyna-springs", "prony"):
        with pytest.raises(ModelError, match=re.escape(f"{ONE}.values was changed")):
            export_results(tmp_path / "model.json", kind, tmp_path / "out")
        assert not (tmp_path / "out").exists()
    for words in (("query", "--frequency", "12 Hz", "--tyre", "a"), ("verify",), ("verify", "--json")):
        code, said = run_cli(words[0], tmp_path / "model.json", *words[1:])
        assert code == 2
        assert f"{ONE}.values was changed" in said


@pytest.fixture
def run_cli():
    from typer.testing import CliRunner

    from fourpole.app.cli import app

    def run(*words):
        ran = CliRunner().invoke(app, [str(word) for word in words])
        return ran.exit_code, " ".join(ran.output.split())

    return run


def test_verify_says_what_the_file_is_and_holds_its_table_against_it(fitted, tmp_path, run_cli):
    place, beside = tmp_path / "model.json", tmp_path / "k.csv"
    beside.write_bytes(b"a table")
    stated = {"source": "k.csv", "sha256": hashlib.sha256(b"a table").hexdigest()}
    made = fitted.model_copy(update={"provenance": fitted.provenance.model_copy(update=stated)})
    made.write(place)
    found = verify(place)
    assert (found.file, found.table) == (made, TableState.SAME)
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", found.written)
    code, said = run_cli("verify", place)
    assert code == 0
    when = found.written.replace("T", " ").replace("Z", " UTC")
    assert f"model.json: as it was written on {when}, by Fourpole {made.provenance.fourpole}" in said
    assert "model a zener: 3 conditions, 8 to 26 Hz" in said
    assert f"table k.csv: beside it and the same SHA-256 {stated['sha256']}" in said
    document = json.loads(run_cli("verify", place, "--json")[1])
    assert (document["good"], document["table"]["state"]) == (True, "same")
    assert [(one["tyre"], one["conditions"], one["band [Hz]"]) for one in document["entries"]] == [
        (one.tyre, 3, list(one.conditions[0].band)) for one in made.models
    ]
    beside.write_bytes(b"another")
    code, said = run_cli("verify", place)
    assert (code, verify(place).table) == (0, TableState.CHANGED)
    assert "warning: k.csv has changed since the model was made" in said
    beside.unlink()
    assert verify(place).table is TableState.MISSING


def test_a_table_of_another_folder_is_not_looked_at(fitted, tmp_path):
    stated = {"source": "../k.csv", "sha256": "0" * 64}
    place = tmp_path / "model.json"
    fitted.model_copy(update={"provenance": fitted.provenance.model_copy(update=stated)}).write(place)
    assert verify(place).table is TableState.UNKNOWN


def test_a_file_from_before_seals_is_sealed_on_request_and_that_stands_in_it(fitted, mapped, tmp_path, run_cli):
    old, new = tmp_path / "old.json", tmp_path / "new.json"
    for file in (fitted, mapped):
        old.write_text(json.dumps({key: part for key, part in file.document.items() if key != KEY}), encoding="utf-8")
        with pytest.raises(ModelError, match=r"is not sealed.* fourpole verify old.json --seal NEW"):
            read_model_file(old)
        code, said = run_cli("verify", old, "--seal", new)
        assert code == 0, said
        assert "note the file was not sealed when it was written" in said
        again = read_model_file(new)
        assert again.model_copy(update={"provenance": file.provenance}) == file
    with pytest.raises(ModelError, match="has a seal"):
        seal_later(new, tmp_path / "third.json")
    assert not (tmp_path / "third.json").exists()


def test_sealing_twice_gives_the_same(fitted):
    assert sealed(fitted.document) == fitted.document
    assert alterations(fitted.document) == []


def test_the_program_of_the_page_finds_each_change(fitted, place):
    """The page's own check shares no code with Fourpole's."""
    page = (Path(__file__).resolve().parents[2] / "docs" / "model-file.md").read_text(encoding="utf-8")
    (listing,) = (part for part in re.findall(r"```python\n(.*?)```", page, flags=re.S) if "def canonical" in part)
    code = "\n".join(line[4:] for line in listing.splitlines() if line.startswith((">>>", "...")))
    space = {}
    exec(code, space)  # noqa: S102 - the listing of our own page
    fitted.write(place)
    assert space["good"](place)
    for name in (*SILENT, *(one for one in LOUD if one not in ("count with a point", "version with a point"))):
        document = fitted.document
        {**SILENT, **LOUD}[name][0](document)
        place.write_text(json.dumps(document), encoding="utf-8")
        assert name == "seal removed" or not space["good"](place), name
    for bits, text in (line.split() for line in NUMBERS.split("\n")[1:-1]):
        assert space["canonical"](struct.unpack(">d", bytes.fromhex(bits))[0]) == text
