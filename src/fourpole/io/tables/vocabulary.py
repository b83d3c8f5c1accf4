"""What the columns of tables are called in English, German, French, Chinese and Japanese, and what each is."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

from fourpole.words import vocabulary
from fourpole.words.heads import is_command, quantity_named, words_of


@dataclass(frozen=True)
class Role:
    """What a column may be.

    Attributes
    ----------
    says : str
        Its name in messages.
    symbol, unit : str
        A usual name of such a column, and a usual unit of it.
    kinds : tuple of str
        Kinds of its unit.
    bare : str
        Unit of a column that states none; empty if the unit must be stated.
    """

    says: str
    symbol: str
    unit: str
    kinds: tuple[str, ...]
    bare: str = ""


_MOTIONS = ("velocity", "displacement", "acceleration")
_LEVEL = ("stiffness", "pressure")
#: Kinds of a ratio of motion over force, and of force over motion, with the power of jω that makes it V1/F1 or F1/V1.
MOTION_PER_FORCE = {"receptance": 1, "mobility": 0, "accelerance": -1}
FORCE_PER_MOTION = {"stiffness": -1, "damping": 0, "mass": 1}
_RATIOS = (*MOTION_PER_FORCE, *FORCE_PER_MOTION)
ROLES: dict[str, Role] = {
    "frequency": Role("frequency", "f", "Hz", ("frequency",)),
    "storage": Role("K', or the storage modulus", "K'", "kN/m", _LEVEL),
    "loss": Role("K'', or the loss modulus", "K''", "kN/m", _LEVEL),
    "magnitude": Role("|K*|, or the modulus of G* or E*", "|K*|", "kN/m", _LEVEL),
    "angle": Role(
        "phase of the force ahead of the motion, loss angle, or phase of a ratio", "phase", "deg", ("angle",)
    ),
    "tan": Role("loss factor tan δ", "tan delta", "1", ("ratio",), "1"),
    "damping": Role("damping C = K''/ω", "C", "N s/m", ("damping",)),
    "R": Role("real part of V1/F1, or of another ratio of motion and force", "R", "m/(N s)", _RATIOS),
    "I": Role("imaginary part of V1/F1, or of another ratio of motion and force", "I", "m/(N s)", _RATIOS),
    "ratio": Role("modulus of a ratio of motion and force", "|A1/F1|", "(m/s^2)/N", _RATIOS),
    "TR": Role("transmissibility |V2/V1|", "TR", "1", ("ratio",), "1"),
    "Re(TR)": Role("real part of V2/V1", "Re(TR)", "1", ("ratio",), "1"),
    "Im(TR)": Role("imaginary part of V2/V1", "Im(TR)", "1", ("ratio",), "1"),
    "frf": Role("frequency response of a UFF file", "1+Z/1+Z", "(m/s^2)/N", ()),
    "force": Role("force amplitude F1", "F1", "N", ("force",)),
    "motion": Role("motion amplitude", "x", "mm", _MOTIONS),
    "u(storage)": Role("standard uncertainty of K'", "u(K')", "N/m", _LEVEL),
    "u(loss)": Role("standard uncertainty of K''", "u(K'')", "N/m", _LEVEL),
    "time": Role("time after the step", "t", "s", ("time",)),
    "relaxation": Role("K(t), or the relaxation modulus", "K(t)", "kN/m", _LEVEL),
    "compliance": Role("creep compliance J(t)", "J(t)", "mm/N", ("receptance", "compliance")),
    "u(relaxation)": Role("standard uncertainty of K(t)", "u(K(t))", "N/m", _LEVEL),
    "u(compliance)": Role("standard uncertainty of J(t)", "u(J(t))", "mm/N", ("receptance", "compliance")),
    "coherence": Role("coherence of force and motion", "coherence", "1", ("ratio",), "1"),
    "temperature": Role("temperature", "T", "°C", ("temperature",)),
    "pressure": Role("inflation pressure", "p", "bar", ("pressure",)),
    "preload": Role("preload", "preload", "N", ("force",)),
    "amplitude": Role("amplitude of the deflection, 0-to-peak", "amplitude", "mm", ("displacement",)),
    "tyre": Role("name of the specimen", "specimen", "", ()),
    "load": Role("load", "F", "N", ("force",)),
    "deflection": Role("deflection", "x", "mm", ("displacement",)),
    "radius": Role("loaded radius", "RL", "mm", ("displacement",)),
    "distance": Role("distance along the road", "distance", "m", ("displacement",)),
    "height": Role("height of the road", "height", "mm", ("displacement",)),
}
#: Other names of roles that an option may use.
ALIASES = {"phase": "angle", "loss angle": "angle", "loss factor": "tan", "tan delta": "tan", "C": "damping",
           "specimen": "tyre", "velocity": "motion", "displacement": "motion", "acceleration": "motion"}  # fmt: skip

_TABLES = vocabulary()["tables"]
#: Heads that may mean more than one quantity.
UNCLEAR = frozenset(_TABLES["unclear"].split())
#: Heads of an angular frequency: rad/s, where they state no unit.
TURNING = frozenset(_TABLES["turning"].split())

_PRIMES = str.maketrans({"′": "'", "’": "'", "‘": "'", "´": "'", "`": "'", "ʹ": "'", "＇": "'", "″": "''", "”": "''",
                         "“": "''", "ʺ": "''", '"': "''"})  # fmt: skip


def plain(name: str) -> str:
    """A head in small letters without blanks and punctuation, and with plain primes.

    Examples
    --------
    >>> plain("K″"), plain("Loss Factor"), plain("tan(δ)"), plain("E_stor")
    ("k''", 'lossfactor', 'tan(δ)', 'estor')
    """
    text = unicodedata.normalize("NFKC", name.translate(_PRIMES)).translate(_PRIMES).casefold()
    return re.sub(r"[\s_\-.,:/]+", "", text)


def _readings() -> dict[str, list[tuple[str, str]]]:
    """Role and letter of each head."""
    found: dict[str, list[tuple[str, str]]] = {}
    for role, words in (*_TABLES["heads"].items(), ("frequency", _TABLES["turning"])):
        for word in words.split():
            found.setdefault(plain(word), []).append((role, ""))
    for role, letters in _TABLES["levels"].items():
        for letter, words in letters.items():
            for word in words.split():
                found.setdefault(plain(word), []).append((role, letter))
        for letter in "KGEMc":
            for form in _TABLES["symbols"][role].split():
                found.setdefault(plain(form.format(letter)), []).append((role, letter.replace("c", "K")))
    found.update({"kprime": [("storage", "K")], "kdoubleprime": [("loss", "K")]})
    return found


_READINGS = _readings()
#: Words of the parts of a complex quantity by role, of what it is by letter, and those that say nothing.
_PARTS = {role: frozenset(_TABLES["words"][role].split()) for role in ("storage", "loss", "magnitude", "angle")}
_OF = {letter: frozenset(text.split()) for letter, text in _TABLES["words"]["of"].items()}
_FILLING = frozenset(_TABLES["words"]["filling"].split())
_WRITTEN = sorted(
    (word for some in (*_PARTS.values(), *_OF.values(), _FILLING) for word in some), key=len, reverse=True
)
_IN_HAN = re.compile("|".join(re.escape(word) for word in _WRITTEN if word > "\u3000"))
_STDS, _MEANS = (frozenset(_TABLES["labels"][key].split()) for key in ("std", "mean"))
#: Patterns of how a head states an amplitude, with the amplitude from 0 to the peak of one of it.
_AMPLITUDES = {kind: (re.compile(pattern), factor) for kind, (pattern, factor) in _TABLES["amplitudes"].items()}
#: Roles of the parts of a ratio of motion and force, and of a transmissibility; "" is one without a word for its part.
_RATIO = {"storage": "R", "loss": "I", "magnitude": "ratio", "angle": "angle", "": "ratio"}
_TR = {"storage": "Re(TR)", "loss": "Im(TR)", "magnitude": "TR", "angle": "angle", "": "TR"}


def readings(name: str) -> list[tuple[str, str]]:
    """The roles that a head may have, each with its letter: K, G, E, M for a modulus of either, or empty.

    A word and a symbol together, as in "Storage modulus G'" or "relaxation modulus E(t)", are the symbol; u() around a
    head is its uncertainty.

    Examples
    --------
    >>> readings("储能模量"), readings("Speichermodul (E′)"), readings("u(K'')"), readings("tan(δ)")
    ([('storage', 'M')], [('storage', 'E')], [('u(loss)', 'K')], [('tan', '')])
    """
    *rest, last = name.replace("_", " ").split() or [""]
    if rest and last.casefold() in (*_STDS, *_MEANS):
        found = readings(" ".join(rest))
        return (
            found if last.casefold() in _MEANS else [(f"u({role})", of) for role, of in found if f"u({role})" in ROLES]
        )
    text = plain(name)
    if text.startswith("u(") and text.endswith(")"):
        inner = _READINGS.get(text[2:-1], [])
        return [(f"u({role})", letter) for role, letter in inner if f"u({role})" in ROLES]
    if text in _READINGS:
        return _READINGS[text]
    bare = re.sub(r"[()\[\]]", "", text)
    if bare in _READINGS:
        return _READINGS[bare]
    return _word_and_symbol(text if text.endswith("(t)") else bare) or _of_words(name)


def _word_and_symbol(text: str) -> list[tuple[str, str]]:
    """The roles of a word and a symbol together, each with the letter of the symbol."""
    for symbol, found in _READINGS.items():
        if len(symbol) < 2 or not re.search(r"['*δ|]", symbol.replace("(t)", "'")):
            continue
        for rest in (text.removesuffix(symbol), text.removeprefix(symbol)):
            roles = {role for role, _ in _READINGS.get(rest, [])} if rest != text else set()
            if roles & {role for role, _ in found}:
                return [one for one in found if one[0] in roles]
    return []


def _of_words(name: str) -> list[tuple[str, str]]:
    """The roles of a head by its words, if all of them are known; its unit says what a part of nothing else is of.

    Examples
    --------
    >>> _of_words("G_storage"), _of_words("Real"), _of_words("Accelerance phase"), _of_words("storage of operator")
    ([('storage', 'G')], [('storage', 'K'), ('storage', 'M'), ('R', '')], [('angle', '')], [])
    """
    words = {part for word in words_of(name) for part in (_IN_HAN.findall(word) if word > "\u3000" else [word])}
    words = {*words, *re.findall(r"[a-z]\d[a-z]\d", plain(name))} - _FILLING
    part = [role for role, known in _PARTS.items() if known & words]
    letters = [letter for letter, known in _OF.items() if known & words]
    known = frozenset[str]().union(*(_PARTS[role] for role in part), *(_OF[letter] for letter in letters))
    if len(part) > 1 or not words or words - known:
        return []
    role = part[0] if part else ""
    for of, parts in (("ratio", _RATIO), ("TR", _TR)):
        if of in letters:
            return [(parts[role], "")] if len(letters) == 1 else []
    if not role:
        return []
    if role == "angle":
        return [("angle", "")]
    if letters:
        sharp = [letter for letter in letters if letter in "GE"] or letters
        return [(role, sharp[0])] if len(sharp) == 1 else []
    return [(role, "K"), (role, "M"), (_RATIO[role], "")]


def amplitude_of(head: str) -> tuple[str, float]:
    """How a head states an amplitude (rms, pp, peak, or empty), and the amplitude from 0 to the peak of one of it.

    Examples
    --------
    >>> amplitude_of("F_pp_N"), amplitude_of("Force (N rms)")[0], amplitude_of("x [mm]")
    (('pp', 0.5), 'rms', ('', 1.0))
    """
    text = head.casefold()
    return next(((kind, factor) for kind, (form, factor) in _AMPLITUDES.items() if form.search(text)), ("", 1.0))


def channel_roles(name: str) -> list[str]:
    """The roles that a head has as that of a channel of a recording, by the words of `init`.

    Examples
    --------
    >>> channel_roles("Standardkraft"), channel_roles("Hubweg"), channel_roles("Sollweg")
    (['load', 'force'], ['deflection', 'motion'], [])
    """
    of = "" if is_command(name) else quantity_named(name)
    return [role for role, named in _TABLES["channels"].items() if of in named.split()]
