"""Tokens of the name of a recording and of its header: values with units, bare numbers, and words; entries of them.

The words, in several languages, by which people name recordings, conditions and specimens: `words/vocabulary.toml`.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import groupby

from fourpole import quantities as q
from fourpole import units
from fourpole.core.condition import AXES, FREQUENCY, Axis, axis_of
from fourpole.core.rig import PARAMETERS
from fourpole.errors import UnitError
from fourpole.words import vocabulary
from fourpole.words.heads import kind_of_unit

_NAMES = vocabulary()["names"]


def words(text: str) -> frozenset[str]:
    """The words of a text as a set."""
    return frozenset(text.split())


#: Endings of file names that identify a format; any other text behind a dot is part of the name.
ENDINGS = words(_NAMES["endings"])
#: Conditions that the letters before a number may identify; of several, the value of the number selects one.
KEYS: dict[str, tuple[str, ...]] = {word: (what,) for what, text in _NAMES["keys"].items() for word in text.split()}
KEYS["f"] = KEYS["n"] = ("frequency", "preload")
#: Letters before a number that neither states a condition nor is a word: a number of a specimen, or of a recording.
MARKS = ("serial", "number", "count")
#: Units behind a number in a name: pattern of the text, unit, and condition that a number with this unit states.
UNITS: tuple[tuple[str, str, str], ...] = tuple((pattern, unit, what) for pattern, unit, what in _NAMES["units"])
#: Words that identify the kind of a test; the first kind that has a word counts.
KIND_WORDS = {kind: words(text) for kind, text in _NAMES["kinds"].items()}
#: Words in names of recordings that are no part of a specimen's name.
PASSED_OVER = words(_NAMES["passed_over"])
#: Words that rather name a place, a direction, a state or a condition of a specimen than a specimen.
STATES = words(_NAMES["states"])
#: Constructions, each by a part of a tyre's name that identifies it.
CONSTRUCTIONS: tuple[tuple[str, str], ...] = tuple((part, name) for part, name in _NAMES["constructions"])
#: Meanings of the key of a line "key: value" in a header, by patterns; the first matching pattern has priority.
IN_HEADERS = tuple((what, re.compile(pattern)) for what, pattern in _NAMES["headers"].items())


AMPLITUDE = q.Quantity("amplitude", "amplitude", "amplitude", "m", "amplitude of the deflection", "mm", 1e-3)
#: Conditions of a test that names, headers and notes may state, in the order of their columns in tests.csv.
CONDITIONS = (q.PRESSURE, q.PRELOAD, q.FREQUENCY, q.ADDED_MASS, q.TEMPERATURE, AMPLITUDE)
#: Kind of quantity of each condition and of each value of the rig.
KINDS_OF = {
    what: units.channel_scale(unit, units.KINDS)[0]
    for what, unit in ({one.key: one.unit for one in CONDITIONS} | PARAMETERS).items()
}
#: The tolerances of the rule of one condition, and that of a frequency, by the name of the condition.
_AXES = {axis.name: axis for axis in (*AXES, FREQUENCY)}
#: Kinds of tests in which a specimen moves, and those on the moving rig.
DYNAMIC_KINDS = ("dynamic", "random", "sweep")
MOVING_KINDS = (*DYNAMIC_KINDS, "calibration")
#: Largest number of characters of a name that are read.
_LONGEST = 400
#: Character that replaces a token in the text that is left.
_GONE = "\x1f"
#: Smallest number in kg that is taken as a load, not as an added mass [kg].
_HEAVY = 50.0


@dataclass(frozen=True)
class Token:
    """One token of a name or header.

    Attributes
    ----------
    what : str
        The name of a condition; "number" for a value without a unit, whose meaning only the whole folder shows; "word";
        "kind"; "repeat"; "band" of frequencies; "mark" for the number of a specimen or of a recording; "nothing".
    text : str
        The token as written.
    value : float
        SI value of a condition; the value of a number as written.
    keys : tuple of str
        Conditions that the letters before a number may mean.
    key : str
        The letters before a number; of a mark "serial", "number", "count" or "date".
    joined : str
        Chinese or Japanese letters of no known meaning directly before a value with its unit.
    high : float [Hz]
        Highest frequency of a band.
    doubt : str
        Why the value may be wrong; empty where it is unambiguous.
    """

    what: str
    text: str
    value: float = float("nan")
    keys: tuple[str, ...] = ()
    key: str = ""
    doubt: str = ""
    joined: str = ""
    high: float = float("nan")


def axis_named(condition: str) -> Axis:
    """The tolerances within which two values of a condition are the same, by its name."""
    return _AXES.get(condition) or axis_of(condition)


@dataclass(frozen=True)
class Entry:
    """Kind, frequency and tokens of one recording; tokens of nearer folders come before those of farther ones.

    Attributes
    ----------
    kind : str
        "static", "dynamic", "random", "sweep" or "calibration".
    frequency : float [Hz]
        Frequency of the recording; not-a-number where it shows none.
    name, header, folder : tuple of Token
        Tokens of its name, of its header, and of the notes of its folder.
    signals : tuple of Token
        Conditions that its signals suggest; they count where nothing states one.
    """

    kind: str
    frequency: float
    name: tuple[Token, ...]
    header: tuple[Token, ...] = ()
    folder: tuple[Token, ...] = ()
    signals: tuple[Token, ...] = ()

    @property
    def parts(self) -> tuple[tuple[str, tuple[Token, ...]], ...]:
        """The tokens by place: name, header, folder. A token of an earlier place has priority."""
        return ("name", self.name), ("header", self.header), ("folder", self.folder)

    def stated(self, what: str) -> str:
        """Text of the first token of a kind; empty if there is none."""
        tokens = (*self.name, *self.header, *self.folder)
        return next((token.text.strip() for token in tokens if token.what == what), "")


@dataclass
class RecordingConditions:
    """Conditions of one recording in SI, the band of its excitation [Hz], its tyre, its doubts as (subject, text)."""

    values: dict[str, float] = field(default_factory=dict)
    tyre: str = ""
    construction: str = ""
    repeat: str = ""
    band: tuple[float, float] | None = None
    doubts: list[tuple[str, str]] = field(default_factory=list)

    def doubt(self, about: str, text: str) -> None:
        """Add a doubt on a subject."""
        self.doubts.append((about, text))

    def forget(self, *whats: str) -> None:
        """Remove some values, and the doubts on them."""
        self.values = {what: value for what, value in self.values.items() if what not in whats}
        self.doubts = [doubt for doubt in self.doubts if doubt[0] not in whats]

    def assume_tyre(self, name: str, text: str) -> None:
        """Set the name of the tyre, and add the doubt on it."""
        self.tyre = name
        self.doubt("tyre", text)


def plain(word: str) -> str:
    """A word in small letters without punctuation; accents stay."""
    return re.sub(r"[\W_]+", "", unicodedata.normalize("NFKC", word).casefold())


def without_ending(name: str) -> str:
    """A file's name without the ending that says its format."""
    stem, dot, ending = name.rpartition(".")
    return stem if dot and stem and ending.casefold() in ENDINGS else name


#: A number, with "p" as a possible decimal sign.
_NUMBER = r"(?>\d{1,3}p\d{1,2}(?!\d)|\d{1,9}(?:[.,]\d{1,6})?)(?!\d)"
#: Sizes of tyres.
_SIZES = re.compile(
    r"(?<![0-9A-Za-z])P?\d{3}[-_/ ]?\d{2}[-_/ ]?Z?[RBD][-_ ]?\d{2}(?!\d)"  # 205-55R16
    r"|(?<![0-9A-Za-z])\d{3}[-_/ ]?[RS]R?[-_ ]?\d{2}(?!\d)"  # 155R13
    r"|(?<![0-9A-Za-z.,])\d{1,2}[.,]\d{2}\s?[-xXR]\s?\d{2}(?![\d.,A-Za-z])"  # 5.60-13
)
#: Dates with or without a time of day, and times of day.
_DATES = re.compile(
    r"(?<!\d)(?:19|20)\d\d([-_.]?)(?:0[1-9]|1[0-2])\1(?:0[1-9]|[12]\d|3[01])(?!\d)"
    r"(?:[T_ -]?(?:[01]\d|2[0-3])[-_.h:]?[0-5]\d(?:[-_.m:]?[0-5]\d)?(?:[.,]\d+)?(?![\d.,A-Za-z]))?"
    r"|(?<!\d)(?:0?[1-9]|[12]\d|3[01])([-_./])(?:0?[1-9]|1[0-2])\2(?:(?:19|20)\d\d|[12]\d)(?![\d.,]|[A-Za-z])"
    r"|(?<!\d)(?:[01]\d|2[0-3])[h:][0-5]\d(?:[m:][0-5]\d)?s?(?!\d)"
)
#: Hexadecimal identifiers.
_HASHES = re.compile(
    r"(?<![0-9A-Za-z])(?=[0-9a-f]{8})(?=[a-f-]*+[0-9])(?=[0-9-]*+[a-f])"
    r"[0-9a-f]{8,}(?:-[0-9a-f]{4,12})*(?![0-9A-Za-z])",
    re.I,
)
#: Six digits of a date, the year first or last.
_SHORT_DATES = re.compile(
    r"(?<![\dA-Za-z.,])(?:[12]\d(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01])"
    r"|(?:0[1-9]|[12]\d|3[01])(?:0[1-9]|1[0-2])[12]\d)(?![\dA-Za-z.,])"
)
#: A year, which single letters before it do not name.
_YEAR = re.compile(r"(?:19|20)\d\d")
#: Bands of frequencies.
_BANDS = re.compile(
    r"(?<![\d.,])(?P<low>\d{1,5}(?:[.,]\d{1,3})?)(?i: ?hz)?[ _]?(?:-|–|~|to|bis|\.\.)[ _]?"
    r"(?P<high>\d{1,5}(?:[.,]\d{1,3})?) ?(?i:hz)"
)
#: Number of a copy, such as " (2)".
_COPY = re.compile(r"[ _]?\((\d{1,3})\)(?=$|[_. /])")
_KEY_WORDS = sorted((key for key in KEYS if len(key) > 1), key=lambda key: (key[0], -len(key)))
#: The longest word of a first letter comes first; the alternatives are by first letter, because they are tried in turn.
_WORDS_BEFORE = "|".join(
    f"{re.escape(letter)}(?:{'|'.join(re.escape(key[1:]) for key in keys)})"
    for letter, keys in groupby(_KEY_WORDS, key=lambda key: key[0])
)
#: Letters before a number. Several letters may follow any character; a single letter must begin a word, or be a capital
#: after a small letter. The "p" of 0p10 is a decimal sign.
_KEY = rf"(?P<key>(?i:{_WORDS_BEFORE})|(?:(?<![^\W\d_])(?!(?<=\d)p\d)|(?<=[a-zß-ÿ])(?=[A-Z]))[A-Za-z])"
#: Letters of Chinese and Japanese before a number.
_GLUED = r"(?P<glued>[\u3040-\u30ff\u3400-\u9fff々]{1,12}+)?"
_UNIT = "|".join(f"(?P<u{at}>{pattern})" for at, (pattern, _, _) in enumerate(UNITS))
#: A number with its unit. In "5 N10" the N belongs to the 10, because a gap separates it from the 5.
_WITH_UNIT = re.compile(
    rf"(?:{_KEY}(?:[ _=:]{{0,2}}|-)|{_GLUED})(?<![0-9])(?<![0-9][.,])"
    rf"(?P<sign>(?<![0-9A-Za-z])[+]|(?<=[_ =:])-|(?i:minus))?"
    rf"(?P<number>(?P<under>(?:(?<![A-Za-z])|(?<=[pP]))\d_(?=\d\d?(?i:bar)))?{_NUMBER})"
    rf"(?:(?P<gap>[ _-])|)(?:{_UNIT})(?(gap)(?![0-9]))"
)
#: A number behind letters, without a unit.
_KEYED = re.compile(rf"{_KEY}[ _=:#-]{{0,2}}(?<![0-9])(?P<number>{_NUMBER})")
#: A number before the sign that says "number" in Chinese and Japanese.
_NUMBERED = re.compile(r"(?<![0-9A-Za-z.,])\d{1,9}(?=[号號番])")
#: A number without letters and unit.
_BARE = re.compile(r"(?<![0-9A-Za-z])(?<![0-9][.,])(?P<number>\d{1,9}(?:[.,]\d{1,6})?)(?![0-9A-Za-z])")
#: Words within a piece of text without separators, and the separators.
_PARTS = re.compile(r"[A-ZÄÖÜ]?[a-zäöüßà-ÿ]+\d*|[A-ZÄÖÜ]+(?![a-zäöüßà-ÿ])\d*|[^\W_]+")
_JOINERS = re.compile(r"[\s_,;=#+()\[\]{}/\\.&]+|(?<![A-Za-z])-|-(?![A-Za-z])|" + _GONE)


def read_name(text: str) -> list[Token]:
    """The tokens of a name without its ending.

    Examples
    --------
    >>> [(token.what, token.text, token.value) for token in read_name("radial_1.7bar_L1000")]
    [('pressure', '1.7bar', 170000.0), ('number', 'L1000', 1000.0), ('word', 'radial', nan)]
    """
    left = unicodedata.normalize("NFKC", text[:_LONGEST])
    found: list[Token] = []
    steps: tuple[tuple[re.Pattern[str], Callable[[re.Match[str]], Token | None]], ...] = (
        (_SIZES, lambda match: Token("word", match[0].strip(), key="size")),
        (_DATES, lambda match: Token("mark", match[0], key="date")),
        (_SHORT_DATES, lambda match: Token("mark", match[0], key="date")),
        (_HASHES, lambda match: Token("mark", match[0], key="number")),
        (_COPY, lambda match: Token("repeat", match[0].strip(), float(match[1]))),
        (_WITH_UNIT, _valued),
        (_NUMBERED, lambda match: Token("mark", match[0], key="serial")),
        (_KEYED, _keyed),
        (_BARE, lambda match: _bare(match["number"])),
    )
    if {"random", "sweep"} & {kind_word(word) for word in _left_words(left)}:
        steps = ((_BANDS, _band), *steps)
    for pattern, made in steps:
        left = pattern.sub(lambda match, made=made: _taken(made(match), match[0], found), left)  # type: ignore[misc]
    found += (Token("word", word) if not kind_word(word) else Token("kind", word) for word in _left_words(left))
    return [token for token in found if token.what != "nothing"]


def _taken(token: Token | None, text: str, found: list[Token]) -> str:
    """The text that remains of a match; its token is added to `found`."""
    if token is None:
        return text
    found.append(token)
    # The text before the token is kept: it may be letters that belong to no number.
    return text[: max(text.find(token.text), 0)] + _GONE


def _valued(match: re.Match[str]) -> Token | None:
    """The token of a number with its unit; None for "n" without letters before the number, which is no newton."""
    place = next(place for place in range(len(UNITS)) if match[f"u{place}"])
    _, unit, what = UNITS[place]
    key = match["key"] or ""
    keys = KEYS.get(key.casefold(), ())
    own = not key or what in keys or (what == "added_mass" and keys == ("preload",))
    first = match.start("number") if match["glued"] or not own else match.start()
    text = match[0][first - match.start() :].strip(" _")
    if what == "nothing":
        return Token("nothing", text)
    if match[f"u{place}"] == "n" and not keys:
        return None
    what, value, doubt = _condition(match, text, what, unit)
    return Token(what, text, value, keys, key if own else "", doubt, match["glued"] or "")


def _condition(match: re.Match[str], text: str, what: str, unit: str) -> tuple[str, float, str]:
    """Condition, SI value and doubt of a number with its unit; only a temperature may be negative."""
    number, doubt = _number(match["number"].replace("_", "."))
    if what == "temperature" and match["sign"] in ("-", "minus"):
        number = -number
    if match["under"]:
        doubt = f"{text} taken as {number:g} {unit}"
    if what == "added_mass":
        key = match["key"] or ""
        if KEYS.get(key.casefold()) == ("preload",) or (not key and number >= _HEAVY):
            what, unit, doubt = "preload", "kgf", f"{text} taken as a load of {number:g} kgf"
        elif not key and match["sign"] is None:
            doubt = f"{text} taken as a mass that was added"
    return what, float(units.to_si([number], unit, KINDS_OF[what])[0]), doubt


def _band(match: re.Match[str]) -> Token | None:
    """The token of a band of frequencies; None if its first number is not the lower one."""
    low, high = _number(match["low"])[0], _number(match["high"])[0]
    return Token("band", match[0], low, high=high) if 0 < low < high else None


def _keyed(match: re.Match[str]) -> Token | None:
    """The token of a number behind letters, without a unit; None if the letters are not known, or for a value 0815."""
    keys = KEYS.get(match["key"].casefold())
    if keys is None:
        return None
    number, _ = _number(match["number"])
    if keys == ("specimen",):
        return Token("word", match[0].strip())
    if _YEAR.fullmatch(match["number"]) and len(match["key"]) == 1:
        return Token("mark", match["number"], key="date")
    if keys == ("repeat",):
        return Token("repeat", match[0], number)
    if keys[0] in MARKS:
        return Token("mark", match[0].strip(), number, key=keys[0])
    if match["number"].isdigit() and match["number"][0] == "0" and number:
        return None
    return Token("number", match[0], number, keys, match["key"])


def _bare(text: str) -> Token:
    """The token of a number alone; one with leading zeros or eight digits is no value, but a number of something."""
    if (text.startswith("0") and text.isdigit() and len(text) > 1) or len(text) > 7:
        return Token("mark", text, _number(text)[0], key="number")
    return Token("number", text, _number(text)[0])


def _number(text: str) -> tuple[float, str]:
    """A number with a decimal point, comma or "p", and a doubt where three digits behind a comma count as thousands."""
    if re.fullmatch(r"[1-9]\d{0,2},000", text):
        return float(text.replace(",", "")), f"{text} taken as {text.replace(',', '')}"
    return float(text.replace(",", ".").replace("p", ".")), ""


def _left_words(left: str) -> Iterator[str]:
    """The words of a text, split at punctuation and before capitals; words with a hyphen stay whole."""
    for piece in _JOINERS.split(left):
        if not piece:
            continue
        if "-" in piece.strip("-"):
            yield piece.strip("-")
        else:
            yield from _PARTS.findall(piece)


def kind_word(word: str) -> str:
    """Kind of test that a word names, "static", "random" ...; empty for another word."""
    bare = plain(word)
    return next((kind for kind, words in KIND_WORDS.items() if bare in words), "")


#: A line "key: value", with another separator or in quotation marks if need be.
_PAIR = re.compile(
    r"^[\s#%\"'/*;-]*+(?P<key>[^\W\d][^:=;\t\"]{0,60}?)\"?(?:\s*+(?:[:=;]|,(?=[^,]*+$))|[^\S\t]*+\t)\s*+"
    r"\"?(?P<value>[^\t]{0,199}[^\s\";,]|[^\t])[\s\";,]*+$"
)


def read_header(lines: Iterable[str]) -> list[Token]:
    """The tokens of the lines above a table, of the properties of a file, or of a file of notes.

    Examples
    --------
    >>> [(token.what, token.text, token.value) for token in read_header(["Pressure: 1.7 bar", "Reifen;Radial"])]
    [('pressure', 'Pressure: 1.7 bar', 170000.0), ('tyre', 'Radial', nan)]
    """
    return [token for line in lines for pair in _pairs(line[:1000]) for token in _of_pair(pair)]


def _pairs(line: str) -> list[str]:
    """The pairs "key: value" of a line."""
    parts = re.split(r"[;,|]\s*(?=[^\W\d][\w .]{0,40}\s?[:=])", line)
    return [part.strip() for part in parts if part.strip()]


def _of_pair(line: str) -> list[Token]:
    """The tokens of a pair "key: value"; for a text that is no such pair, the conditions in it."""
    match = _PAIR.match(line)
    if match is None or ("," in line and not re.search(r"[:=;\t]", line) and not _meant(match["key"])):
        return [token for token in read_name(line) if token.what in KINDS_OF and _meant(line) != "nothing"]
    key, unit = units.column_unit(match["key"])
    value = match["value"].strip()
    what = _meant(key)
    return _stated(what, line, value, unit, key) if what in KINDS_OF else _text_of(what, line, value)


def _text_of(what: str, line: str, value: str) -> list[Token]:
    """The token of a key whose value is a text."""
    if what in ("tyre", "construction"):
        return [Token(what, value[:80])]
    if what == "serial":
        return [Token("mark", value[:80], key="serial")]
    if what == "kind":
        return [Token("kind", word) for word in _left_words(value) if kind_word(word)][:1]
    return [Token("repeat", line, float(value))] if what == "repeat" and re.fullmatch(r"\d{1,6}", value) else []


def _meant(key: str) -> str:
    """Meaning of a key; empty if the key is not known."""
    spoken = key.casefold().replace("_", " ")
    return next((what for what, pattern in IN_HEADERS if pattern.search(spoken)), "")


def _stated(what: str, line: str, value: str, unit: str | None, key: str) -> list[Token]:
    """The token of a key with its value in SI; a number without a unit becomes a token "number"."""
    last = re.split(r"[\s_]", key)[-1]
    for default in (unit, last if last != key else None):
        try:
            return [Token(what, line, units.quantity(value, KINDS_OF[what], default_unit=default))]
        except UnitError:
            continue
    if kind_of_unit(unit):
        return []
    if re.fullmatch(r"\d{1,9}(?:[.,]\d{1,6})?", value):
        return [Token("number", line, _number(value)[0], (what,), key)]
    return []
