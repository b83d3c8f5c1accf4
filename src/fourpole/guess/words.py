"""Words, in several languages, by which people name recordings, conditions and channels."""

from __future__ import annotations

import re


def _words(text: str) -> frozenset[str]:
    """The words of a text as a set."""
    return frozenset(text.split())


#: Endings of file names that identify a format; any other text behind a dot is part of the name.
ENDINGS = _words("csv txt asc dat tsv prn mf4 mdf dl3 tdms h5 hdf5 hdf mat uff unv uf58 wav wave tdx lvm log data out")

#: Letters before a number in a name, by the condition that they identify.
_KEY_WORDS = {
    "pressure": "p pr press pressure druck reifendruck luftdruck fülldruck fuelldruck innendruck infl inflation "
    "pression presion pressione pi bar kpa 圧力 空気圧 内圧 气压 胎压 压力 充气压力 氣壓 胎壓 壓力",
    "preload": "l fz fv fn load preload pl last vorlast radlast kraft force precharge précharge charge precarga carga "
    "kn 荷重 静荷重 予荷重 予圧 負荷 载荷 预载 预载荷 负荷 负载 垂直载荷 載荷 預載 預載荷",
    "frequency": "freq frequency frequenz frequence fréquence fr n rpm hz 周波数 加振周波数 频率 頻率 回転数 转速",
    "temperature": "t temp temperature temperatur température 温度 溫度 室温",
    "added_mass": "m dm mass masse added addedmass zusatz zusatzmasse 付加質量 質量 质量 附加质量 配重",
    "amplitude": "a amp ampl amplitude x s hub ecc stroke 振幅 片振幅",
    "repeat": "r rep repeat run wdh wiederholung lauf try take trial versuch essai mess meas 回 繰返し 重复",
    "specimen": "tyre tire reifen pneu neumático neumatico pneumatico specimen sample probe prüfling prüfkörper muster "
    "éprouvette eprouvette échantillon echantillon probeta muestra provino campione "
    "タイヤ 試料 試験片 供試体 供試タイヤ ブッシュ サンプル 试样 试件 样品 样件 轮胎 輪胎 衬套 試樣 樣品",
    "serial": "sn s/n ser serial serien seriennummer seriennr serialno série id "
    "シリアル 製造番号 编号 序列号 編號 番号",
    "number": "no no. nr nr. n° nº num numéro numero # № 第",
    "count": "v ver version rev rec file cycle cyc test",
}
#: Conditions that the letters before a number may identify; of several, the value of the number selects one.
KEYS: dict[str, tuple[str, ...]] = {word: (what,) for what, words in _KEY_WORDS.items() for word in words.split()}
KEYS["f"] = KEYS["n"] = ("frequency", "preload")
#: Letters before a number that neither states a condition nor is a word: a number of a specimen, or of a recording.
MARKS = ("serial", "number", "count")

#: Units behind a number in a name: pattern of the text, unit, and condition that a number with this unit states.
UNITS: tuple[tuple[str, str, str], ...] = (
    ("(?i:mbar)", "mbar", "pressure"),
    ("(?i:bar)", "bar", "pressure"),
    ("(?i:kpa)|千帕|キロパスカル", "kPa", "pressure"),
    ("(?:MPa|MPA)", "MPa", "pressure"),
    ("(?i:hpa)", "hPa", "pressure"),
    ("(?i:psig?)", "psi", "pressure"),
    ("(?:Pa|PA)(?![a-zA-Z])", "Pa", "pressure"),
    ("(?i:khz)", "kHz", "nothing"),
    ("(?i:hz)|赫兹|ヘルツ", "Hz", "frequency"),
    ("(?i:rpm)|1/min|min-1|U/min", "rpm", "frequency"),
    ("(?i:kn)(?![a-zA-Z])|千牛|キロニュートン", "kN", "preload"),
    ("(?i:dan)(?![a-zA-Z])", "daN", "preload"),
    ("(?i:lbf)(?![a-zA-Z])", "lbf", "preload"),
    ("(?i:kgf|kp)(?![a-zA-Z])", "kgf", "preload"),
    ("[Nn](?![a-zA-Z])|牛顿?|ニュートン", "N", "preload"),
    ("(?i:kg)(?![a-zA-Z])|公斤|千克", "kg", "added_mass"),
    ("(?i:deg[ _]?c|° ?c|grad|celsius)(?![a-zA-Z])|C(?![a-zA-Z0-9])", "degC", "temperature"),
    ("(?i:deg[ _]?f|° ?f)(?![a-zA-Z])", "degF", "temperature"),
    ("(?i:mm)(?![a-zA-Z])", "mm", "amplitude"),
    ("(?i:um|µm|μm)(?![a-zA-Z])", "um", "amplitude"),
    ("(?i:km[/_-]?h|kph|mph|m[/_-]s2?)(?![a-zA-Z])", "", "nothing"),
    ("(?:ms|min|s|sec|h|cyc(?:les)?)(?![a-zA-Z])", "", "nothing"),
)

#: Words that identify the kind of a test; the first kind that has a word counts.
KIND_WORDS: dict[str, frozenset[str]] = {
    "static": _words(
        "static stat statics statisch statik statique estatico statico quasistatic quasistatisch quasistatique qs ld "
        "kennlinie federkennlinie loaddeflection ramp slow k1 estática loadcurve springrate "
        "静的 静特性 静荷重試験 静态 静刚度 静剛性 靜態"
    ),
    "random": _words(
        "random rnd noise whitenoise pink rauschen zufall stochastisch aléatoire aleatoire bruit aleatorio ruido "
        "multisine psd ランダム 随机 隨機"
    ),
    "sweep": _words("sweep swept sinesweep chirp gleitsinus gleitend durchlauf balayage barrido スイープ 扫频 掃頻"),
    "dynamic": _words(
        "dynamic dyn dynamics dynamisch dynamik dynamique dinamico sine sinus harmonic vib vibration schwing "
        "動的 動特性 动态 動態 动刚度 正弦"
    ),
    "calibration": _words(
        "cal calib calibration kal kalib kalibrierung rigid rigidmass starr starrkörper starrmasse dummymass etalonnage"
    ),
}

#: Words in names of recordings that are no part of a specimen's name.
PASSED_OVER = _words(
    "tyre tire tyres tires reifen pneu pneus neumatico pneumatico specimen sample probe prüfling test tests rec "
    "recording recordings record messung messungen mess measurement measurements meas data daten log logs run "
    "file csv txt raw roh final neu new old alt copy kopie copie export kraft weg force load preload vorlast "
    "radlast last pressure druck pression precharge frequency frequenz freq temperature temperatur temp bar kpa "
    "psi hz and und at bei with mit the of n kn f p l v fz results signals signal time date datum series serie "
    "campaign sn no nr deg c essai mesure rpm pression précharge fréquence charge éprouvette "
    "試験 测试 試験結果 数据 データ 結果 タイヤ 轮胎 试样 試料"
)
#: Words that rather name a place, a direction, a state or a condition of a specimen than a specimen.
STATES = _words(
    "left right links rechts gauche droite izquierda derecha izq der li re l r vl vr hl hr fl fr rl rr lh rh "
    "front rear vorne hinten vorn avant arrière oben unten top bottom inner outer innen aussen außen warm "
    "kalt hot cold chaud froid worn used before after vorher nachher vor nach pre post up down auf ab dry wet "
    "trocken nass lateral vertical vertikal horizontal axial longitudinal x y z low high lo hi slow fast min "
    "max day night tag woche week camber sturz slip schlupf amplitude amplitud speed cycle zyklus "
    "左 右 前 後 后 上 下 新 旧 冷 热 熱 新品 中古"
)

#: Constructions, each by a part of a tyre's name that identifies it.
CONSTRUCTIONS: tuple[tuple[str, str], ...] = (
    ("radial", "radial-ply"),
    ("crossply", "cross-ply"),
    ("xply", "cross-ply"),
    ("diagonal", "cross-ply"),
    ("biasply", "cross-ply"),
)


def _patterns(**patterns: str) -> tuple[tuple[str, re.Pattern[str]], ...]:
    """Names with their compiled patterns, in the given order."""
    return tuple((what, re.compile(pattern)) for what, pattern in patterns.items())


#: Meanings of the key of a line "key: value" in a header, by patterns; the first matching pattern has priority.
IN_HEADERS = _patterns(
    nothing=r"sampl|abtast|filter|cut-?off|corner|channel|kanal|sensor|ambient|atmos|barom|umgebung|duration|dauer|limit",
    added_mass=r"added|zusatz|additional mass|extra mass|\bdm\b",
    moving_mass=r"\bmass|masse\b|^m$",
    preload_stiffness=r"^k_?3$|(preload|pre-load|rig|suspension) (spring|stiffness)|spring (rate|stiffness|constant)"
    r"|federrate|federsteifigkeit|vor(spann|last)feder|^preload.stiffness",
    preload_damping=r"^c_?3$|preload.damp|damper|dämpfung der feder",
    pressure=r"press(?!ed)|druck|presi[oó]n|pression|inflation|^pi?$|圧力|空気圧|内圧|气压|胎压|压力",
    preload=r"pre-?load|vorlast|radlast|vorspannkraft|pr[ée]-?charge|(static|wheel|vertical|normal) (load|force)|^load$"
    r"|^last$|^fz$|^l$|precarga|荷重|载荷|预载",
    frequency=r"freq|fr[ée]q|^f$|drehzahl|^rpm$|speed of (the )?cam|周波数|频率",
    temperature=r"temp|温度",
    amplitude=r"amplitude|eccentric|exzentri|^hub$|stroke",
    kind=r"^(test ?)?(kind|type|art|mode|test|versuch|versuchsart|test ?type)$",
    repeat=r"^(run|repeat|rep|wiederholung|lauf)\b",
    tyre=r"^(tyre|tire|reifen|pneu|specimen|sample|probe|pr(ü|ue|u)fling|neum[aá]tico|pneumatico|dut|part)"
    r"(\W*(name|type|typ|model|modell|no|nr|id|size|bezeichnung|number))?\W*$"
    r"|^(éprouvette|échantillon|タイヤ|試料|試験片|供試体|试样|试件|样品|轮胎|衬套)",
    serial=r"^(s/?n|serial|seri(e|al)n(umme)?r|num[ée]ro de s[ée]rie|シリアル|製造番号|编号|序列号)",
    construction=r"^(construction|bauart|carcass|karkasse|ply)$",
)

#: Words in the name of a channel, by the quantity that they identify.
NAMES: dict[str, frozenset[str]] = {
    "force": _words(
        "f fz fx fy fn fin fout force forces kraft load loadcell cell kmd kraftaufnehmer kraftmessdose effort forza "
        "fuerza kracht last radlast lc lastzelle charge carga crisp"
    ),
    "acceleration": _words(
        "a acc accel accelerometer acceleration accelero beschl beschleunigung bs aceleracion aceleración "
        "accelerazione accélération accelération accélé accele g az pcb"
    ),
    "velocity": _words(
        "v vel velocity veloc geschw geschwindigkeit vitesse velocidad velocita velocità lsv vibrometer ldv schnelle "
        "vz"
    ),
    "displacement": _words(
        "x s z d u w disp displ displacement weg position pos travel lvdt deflection defl einfederung verschiebung "
        "depl deplacement déplacement desplazamiento spostamento laser compression stroke hub pot potentiometer "
        "extensometer wegaufnehmer auslenkung height höhe"
    ),
    "time": _words("t time zeit temps tiempo tempo timestamp timestamps times uhrzeit"),
    "reference": _words(
        "ref reference referenz tacho tachometer trigger trig encoder keyphasor drehgeber winkel angle"
    ),
    "drive": _words("drive"),
    "temperature": _words("temp temperature temperatur tc thermo pt100"),
    "pressure": _words("p pressure druck pression reifendruck luftdruck inflation"),
    "frequency": _words("freq frequency frequenz drehzahl rpm"),
}  # fmt: skip
#: What the name of a command signal contains, in small letters: none of them names a measured quantity.
COMMAND = re.compile(
    r"(?<![^\W\d_])(?:commands?|cmd|set[ _-]?point|demand|cola(?![^\W\d_])|soll(?!icit))"
    r"|f(?:ü|ue)hrungsgr(?:ö|oe)(?:ss|ß)e|sollwert|setpoint|consigne|consigna|指令|目標|目标|设定值|給定|给定"
)
#: Words in the name of a channel at the contact, and in that of a channel at the moving mass.
LOWER = _words("lower bottom unten unter untere bas inf inferieur boden ground")
UPPER = _words("upper top oben ober obere haut sup superieur")
IN = LOWER | _words(
    "1 in input contact road base shaker exciter platform plate actuator kontakt eingang entree entrée anregung "
    "drive latsch patch cam erreger platte table"
)
OUT = UPPER | _words(
    "2 out output wheel rim axle mass sprung ausgang sortie felge rad achse masse response antwort jante roue hub "
    "body aufbau far"
)
#: Words by which loggers number their channels; a number beside such a word does not identify the side.
NUMBERED = _words("channel ch chan kanal voie canal sensor signal input ai analog col column spalte")
#: Words in the name of the vertical channel of a quantity, and in names of its other channels.
MAIN = _words("z fz load last radlast loadcell deflection defl einfederung vertical vertikal")
MINOR = _words("fx fy mx my mz lateral x y longitudinal quer längs raw command soll")
