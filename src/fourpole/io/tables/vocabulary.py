"""What the columns of tables are called in English, German, French, Chinese and Japanese, and what each is."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass


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
ROLES: dict[str, Role] = {
    "frequency": Role("frequency", "f", "Hz", ("frequency",)),
    "storage": Role("K', or the storage modulus", "K'", "kN/m", _LEVEL),
    "loss": Role("K'', or the loss modulus", "K''", "kN/m", _LEVEL),
    "magnitude": Role("|K*|, or the modulus of G* or E*", "|K*|", "kN/m", _LEVEL),
    "angle": Role("phase of the force ahead of the motion, or loss angle", "phase", "deg", ("angle",)),
    "tan": Role("loss factor tan δ", "tan delta", "1", ("ratio",), "1"),
    "damping": Role("damping C = K''/ω", "C", "N s/m", ("damping",)),
    "R": Role("R = Re(V1/F1)", "R", "m/(N s)", ("mobility",)),
    "I": Role("I = Im(V1/F1)", "I", "m/(N s)", ("mobility",)),
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
    "distance": Role("distance along the road", "distance", "m", ("displacement",)),
    "height": Role("height of the road", "height", "mm", ("displacement",)),
}
#: Other names of roles that an option may use.
ALIASES = {"phase": "angle", "loss angle": "angle", "loss factor": "tan", "tan delta": "tan", "C": "damping",
           "specimen": "tyre", "velocity": "motion", "displacement": "motion", "acceleration": "motion"}  # fmt: skip

_WORDS = {
    "frequency": """
        frequency freq f frequenz messfrequenz prüffrequenz anregungsfrequenz fréquence frequence 频率 頻率 测试频率
        周波数 測定周波数""",
    "tan": """
        tanδ tandelta tand tanδelta lossfactor losstangent dampingfactor verlustfaktor facteurdeperte facteurdepertes
        facteurd'amortissement tangentedelta 损耗因子 损耗因数 损失因子 损耗角正切 損失正接 損失係数 損失因子""",
    "angle": """
        phase phi φ ϕ alpha α delta δ phaseangle angle phasef1v1 phasef1x1 phasefv phasefx lossangle phaselag phaseshift
        phasenwinkel phasenverschiebung phasendifferenz verlustwinkel anglededéphasage déphasage angledeperte
        angledephase 损耗角 损失角 相位 相位角 相位差 滞后角 損失角 位相 位相角 位相差""",
    "damping": """
        c damping dampingcoefficient dämpfung dämpfungskonstante dämpfungsbeiwert amortissement 阻尼 阻尼系数 減衰
        減衰係数""",
    "R": "r rem re(m) remobility re(v1f1) mobilityre",
    "I": "i imm im(m) immobility im(v1f1) mobilityim",
    "force": "f1 f force forceamplitude fin forcein kraft kraftamplitude effort amplitudedeforce 力 力幅 荷重振幅",
    "motion": """
        v1 v velocity velocityamplitude x1 x displacement displacementamplitude amplitude deflection s s1 u1 weg
        wegamplitude a1 a acceleration accelerationamplitude déplacement 位移 位移振幅 振幅 変位 変位振幅""",
    "coherence": "coherence coh γ² γ2 γ^2 kohärenz cohérence 相干 相干函数 相干系数 コヒーレンス",
    "time": "time t zeit temps 时间 時間",
    "compliance": """
        j(t) d(t) jcreep creepcompliance compliance kriechnachgiebigkeit nachgiebigkeit compliancedefluage 蠕变柔量
        クリープコンプライアンス""",
    "temperature": """
        temperature temp t temperatur probentemperatur sampletemperature température temperature degc 温度 试样温度
        試料温度""",
    "pressure": "pressure inflationpressure p innendruck fülldruck luftdruck pression 胎压 气压 空気圧 内圧",
    "preload": "preload vorlast précharge precharge 预载 预载荷 预紧力 予荷重 予圧荷重",
    "amplitude": """
        amplitude deflectionamplitude displacementamplitude wegamplitude amplitudededéplacement 振幅 位移振幅
        変位振幅""",
    "tyre": "tyre tire specimen sample probe prüfling reifen pneu éprouvette échantillon 试样 样品 試料 試験片",
    "load": """
        load force axialforce f fz f1 kraft axialkraft
        last radlast radialload verticalload charge effort 载荷 力 荷重 負荷""",
    "deflection": """
        deflection displacement axialdisplacement extension x x1 z d s travel weg axialweg δ
        einfederung compression flèche déplacement enfoncement 位移 变形
        挠度 変位 たわみ""",
    "distance": """
        distance x s u position station chainage way weg strecke wegstrecke distanceparcourue abscisse 距离 里程
        距離""",
    "height": "height z h elevation profile level höhe profil hauteur altitude 高度 高程 高さ 標高",
}  # fmt: skip
#: Heads of a stiffness or a modulus, without letter: K for a stiffness, M for a modulus that may be G or E.
_LEVELS = {
    "storage": {
        "K": "storagestiffness speichersteifigkeit rigiditédeconservation raideurdeconservation 储能刚度 貯蔵ばね定数",
        "M": """
            storagemodulus speichermodul moduledeconservation moduledestockage 储能模量 储存模量 存储模量 貯蔵弾性率""",
        "G": "storageshearmodulus 储能剪切模量 貯蔵せん断弾性率 貯蔵剪断弾性率 gstor gprime gp",
        "E": "estor eprime",
    },
    "loss": {
        "K": "lossstiffness verluststeifigkeit rigiditédeperte raideurdeperte 损耗刚度 損失ばね定数",
        "M": "lossmodulus verlustmodul moduledeperte moduledepertes 损耗模量 损失模量 損失弾性率",
        "G": "lossshearmodulus 损耗剪切模量 損失せん断弾性率 損失剪断弾性率 gloss gdoubleprime gpp",
        "E": "eloss edoubleprime",
    },
    "magnitude": {
        "K": """
            dynamicstiffness dynstiffness dynamischesteifigkeit dynsteifigkeit dynamischefedersteifigkeit kdyn cdyn
            rigiditédynamique raideurdynamique 动刚度 动态刚度 動ばね定数 動的ばね定数 絶対ばね定数""",
        "M": "complexmodulus komplexermodul modulecomplexe 复数模量 复模量 複素弾性率",
        "G": "complexshearmodulus komplexerschubmodul 复数剪切模量 複素せん断弾性率",
        "E": "",
    },
    "relaxation": {
        "K": "relaxationstiffness relaxationssteifigkeit",
        "M": "relaxationmodulus stressrelaxationmodulus relaxationsmodul modulederelaxation 松弛模量 緩和弾性率",
        "G": "shearrelaxationmodulus",
        "E": "",
    },
}
_SYMBOLS = {
    "storage": "{}' re{}* re{} re({}*) re({}) {}*' real{}*",
    "loss": "{}'' im{}* im{} im({}*) im({}) {}*'' imag{}*",
    "magnitude": "|{}*| |{}| {}* abs{}* abs({}*) {}*abs mag{}*",
    "relaxation": "{}(t) {}relax",
}
#: Heads that may mean more than one quantity.
_UNCLEAR = """
    k stiffness steifigkeit raideur rigidité 刚度 ばね定数 modulus modul module e g elasticmodulus youngsmodulus
    young'smodulus shearmodulus elastizitätsmodul schubmodul 模量 弾性率"""
UNCLEAR = frozenset(_UNCLEAR.split())
#: Heads of an angular frequency: rad/s, where they state no unit.
_TURNING = """
    omega ω w angularfrequency angfrequency angfreq kreisfrequenz winkelfrequenz pulsation fréquenceangulaire 角频率
    圆频率 角周波数 角振動数"""
TURNING = frozenset(_TURNING.split())

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
    for role, words in (*_WORDS.items(), ("frequency", _TURNING)):
        for word in words.split():
            found.setdefault(plain(word), []).append((role, ""))
    for role, letters in _LEVELS.items():
        for letter, words in letters.items():
            for word in words.split():
                found.setdefault(plain(word), []).append((role, letter))
        for letter in "KGE":
            for form in _SYMBOLS[role].split():
                found.setdefault(plain(form.format(letter)), []).append((role, letter))
    found.update({"kprime": [("storage", "K")], "kdoubleprime": [("loss", "K")]})
    return found


_READINGS = _readings()


def readings(name: str) -> list[tuple[str, str]]:
    """The roles that a head may have, each with its letter: K, G, E, M for a modulus of either, or empty.

    A word and a symbol together, as in "Storage modulus G'" or "relaxation modulus E(t)", are the symbol; u() around a
    head is its uncertainty.

    Examples
    --------
    >>> readings("储能模量"), readings("Speichermodul (E′)"), readings("u(K'')"), readings("tan(δ)")
    ([('storage', 'M')], [('storage', 'E')], [('u(loss)', 'K')], [('tan', '')])
    """
    text = plain(name)
    if text.startswith("u(") and text.endswith(")"):
        inner = _READINGS.get(text[2:-1], [])
        return [(f"u({role})", letter) for role, letter in inner if f"u({role})" in ROLES]
    if text in _READINGS:
        return _READINGS[text]
    bare = re.sub(r"[()\[\]]", "", text)
    if bare in _READINGS:
        return _READINGS[bare]
    return _word_and_symbol(text if text.endswith("(t)") else bare)


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
