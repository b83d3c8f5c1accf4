"""Each regular expression takes time in proportion to its text, whatever the text is.

A new pattern gets a line in `WORST`; `fuzz/fuzz_patterns.py --only ROOM` looks for its worst text.
"""

import pytest
from tests.patterns import seconds, uses

pytestmark = pytest.mark.thorough

#: Processor time per character [s] that a pattern may take; the slowest takes half of it on a quiet machine.
LIMIT = 2e-6
#: Patterns whose module shortens the text first, with its largest length.
LONGEST = {
    "words/heads._AT_END": 100,
    "guess/names._HASHES": 400,
    "words/heads._SET_OFF": 100,
    "units.frequency_grid": 4000,
}
#: Patterns that are applied to no text of others, or whose text is measured by another line.
OWN = {
    "guess/pattern._unit_at": "spellings of units, after a number in the name of a file",
    "io/origin._head": "the checkout of Fourpole itself",
    "lab/dataset._unused": "names of files, of at most 255 characters",
    "plot/layout._LINK": "a drawing of our own, in which matplotlib has escaped all names",
    "plot/lineart._path": "a drawing of our own",
    "report/html._STYLE_SHEET": "a drawing of our own",
    "report/page._compact": "a drawing of our own",
    "served/pages/run.run_routes": "options of a command, by patterns of two lengths",
}
#: The slowest text of each pattern: its beginning, what is repeated, its end.
WORST = {
    "app/console._CONTROL": ("", "\x9f", "1"),
    "app/report._SIZE": ("1", " ", "!"),
    "app/report._colour": ("", "a", ""),
    "campaign/row._is_band": ("", "za\t", "1"),
    "campaign/row._is_band#2": ("", "0-", "\x00"),
    "campaign/row._key": ("", "9Z", "]"),
    "campaign/row._united": ("", "\ne", ","),
    "campaign/row._ENTRY": ("", "1", ","),
    "campaign/place._NUMBERS": ("", "9.", "a"),
    "core/sources._MASS": ("added mass ", "a", "\n~"),
    "export/fmi/description._OF_BELT": ("#ifdef BELT\n", "a\n", "#e"),
    "export/materials._name": ("", "\u5b57#", "\n~"),
    "export/source._NUMBER": ("", "-0.119", "\n~"),
    "export/source._identifier": ("", "(", "Z "),
    "export/tydex._OURS": ("", "SUPPLIER , fourpole ", ","),
    "export/tydex._file_names": ("", "<\x00[e", "<]#"),
    "paper1982/claims._WORDS": ("", "  ", "\t"),
    "findings/facts.natural": ("", "$", "a"),
    "guess/conditions.constructions_of": ("", "_", "\t"),
    "guess/gather._NEVER": ("", ".docx", "é"),
    "guess/gather._NOTES": ("", ".txt", "1"),
    "guess/gather._counting": ("", "09", ""),
    "guess/gather._is_shared": ("", "a", ""),
    "guess/names._BANDS": ("", "199.19 ", "a"),
    "guess/names._BARE": ("", "'", "91.9"),
    "guess/names._COPY": ("", "(9", "Z "),
    "guess/names._DATES": ("", "-.", "]"),
    "guess/names._HASHES": ("", "ffffffff-", ""),
    "guess/names._JOINERS": ("", "-", ","),
    "guess/names._KEYED": ("freq_#99,", "9", "a"),
    "guess/names._NUMBERED": ("", "191", "11"),
    "guess/names._PAIR": ("%;E", "\t", "x\ty"),
    "guess/names._PARTS": ("", "{", "Ö19"),
    "guess/names._SHORT_DATES": ("", "111021191019{", "1"),
    "guess/names._SIZES": ("", "99.99 -\t11", ""),
    "guess/names._WITH_UNIT": ("", "-9_9", "Z "),
    "guess/names._YEAR": ("", "a", ""),
    "guess/names._number": ("", "99", ""),
    "guess/names._of_pair": ("", "a", ""),
    "guess/names._text_of": ("", "1", ","),
    "guess/names._pairs": ("", " , ", "\x00"),
    "guess/names._stated": ("", "a", ""),
    "guess/names._stated#2": ("", "\t", ","),
    "guess/names.plain": ("", "\u5b57", "]"),
    "guess/pattern._NAMES_LIKE": ("", "a", ""),
    "guess/pattern._parts_of": ("", ",", ""),
    "guess/pattern._BAND": ("", "a", ""),
    "guess/pattern._FIELD": ("", "{}", "\t"),
    "guess/pattern._NUMBERS": ("", "-1", "é"),
    "guess/specimens._consecutive": ("", "\x00", "\n~"),
    "guess/specimens._doubt_on_words": ("", "A", "a"),
    "guess/names.IN_HEADERS": ("", "\u6e29\u5ea6", "Z "),
    "guess/write._tyres": ("", "_", "\n~"),
    "io/clock._DATE_ALONE": ("", " ", "!"),
    "io/clock._KNOWN": ("", "\n", "\t"),
    "io/clock._UNDATED": ("", " ", "\n~"),
    "io/columns._SLASHED": ("", "0/9/0", "a"),
    "io/convert._OURS": ("", "19", "!"),
    "io/documents._AT_LINE": ("", "at line ", ""),
    "io/documents._LETTERS": ("", "a", "\u00e4"),
    "io/documents._BARE": ("=", "1", ","),
    "io/documents._HALF": ("", "é", ""),
    "io/documents._DIGITS": ("", "1_", "a"),
    "io/documents._LONG_KEY": ("-_.", " ", "a"),
    "io/documents._TEXTS": ("", "''\":\"", ","),
    "io/published._HASH": ("", "a", ""),
    "io/published._NAME": ("", "a", ""),
    "io/published._NEW": ("", "a", ""),
    "io/door._DEVICES": ("conout$  .", ",", ","),
    "io/formats/guard._TIME": ("", "a", ""),
    "io/recordings._JSON": (" \t{", "\t", "\n~"),
    "io/formats/lvm._END_OF_HEADER": ("", "a, ", "\x00"),
    "io/formats/lvm._SEGMENT": ("", "Channels", "a"),
    "io/formats/lvm._SPECIAL": ("", "\n***Start_Special***", ""),
    "io/formats/lvm._content": ("Separator ", "_", "Separator-a"),
    "io/formats/matlab.asked": ("(:,", "1", ""),
    "io/formats/tdms._SCALE": ("", "a", ""),
    "io/formats/text._CATMAN_RATE": ("", "0", ""),
    "io/formats/text._INTERVAL": ("deltat- [", "\x00", "\n~"),
    "io/formats/text._RATE": ("scan rate", " ", "\n~"),
    "io/formats/tydex._KEYWORD": ("**", "A", "\n~"),
    "io/recordings._TYDEX": ("**", "\n", "é"),
    "io/formats/uff._MARK": ("    -1", " ", "    -1  "),
    "io/recordings._UFF": ("", "\x00", "1"),
    "io/formats/variables._NAMES": ("", "nam", "\n~"),
    "io/formats/variables._RATES": ("", "_sample_", "\x00"),
    "io/formats/variables._STEPS": ("", "sample_", "\x00"),
    "io/formats/variables._UNITS": ("", "uni", "\n~"),
    "io/recordings._NO_RECORDINGS": ("", " ", ","),
    "io/layout._CATMAN_TIME": ("Time 00 - ", " ", "\n~"),
    "io/layout._DECIMAL_COMMA": ("", "a", ""),
    "io/layout._NAME_AND_UNIT": ("", "a\n", ""),
    "io/layout._NTH": ("a.1", "0", "\x00"),
    "io/layout._NUMBER": ("+.", "9", "\n~"),
    "io/layout._NUMBERS": ("", "1", "a"),
    "io/layout._SIGNS": ("", "<|", "\x00"),
    "io/layout._UNIT_CELL": ("[", "!", "\x00"),
    "io/layout._WORD": ("", '" ', "!"),
    "io/layout._names_in": ("", " \\", "\n~"),
    "io/origin._COMMIT": ("", "a", ""),
    "io/origin.origin_of": ("name", "\n", "!"),
    "io/origin._head#2": ("", "refs/-", "\t"),
    "io/remote._URL": ("a", "z", "a"),
    "io/remote._check_steps": ("", "/", "\x00"),
    "io/remote.fetched": ("", "a", "*"),
    "io/remote.local_path": ("", "a", ""),
    "io/rows._LINE_END": ("", "\r", ","),
    "io/source._ASCII": ("", "\x7f\u5b57", "\t"),
    "io/source._CHINESE": ("", "°þ", "a"),
    "io/source._JAPANESE": ("", "ß¦", "\t"),
    "io/stretches._RESULT": ("", "segment", "a"),
    "io/tables/cells._ROW": ("", "+", "1"),
    "io/tables/cells._of_texts": ("", "Units\t", "a"),
    "io/tables/columns._PER_SECOND": ("s", "\t", ""),
    "io/tables/columns._UNIT": ("", "é", "a"),
    "io/tables/responses._unit": ("(1/1)*", "\t", "(1/:1 )*:)"),
    "io/tables/vocabulary.plain": ("", "\t", "\t"),
    "io/tables/vocabulary.readings": ("", "[", "\n~"),
    "io/tables/vocabulary._word_and_symbol": ("", "é", "a"),
    "io/write._HIDDEN": ("", ".a.00ff0f09a000.tmp", "Z "),
    "lab/dataset._taken": ("", "E<1", "\t"),
    "plot/layout._DIGITS": ("", "1.9911", "a"),
    "plot/layout._GROUP_NAME": ("", '<g id="a', "1"),
    "plot/layout._OF_TEXT": ("", "\n 1", "a"),
    "plot/layout._POINT": ("", "<use a", ""),
    "report/front._DAY": ("", "1", "!"),
    "report/html._UNFIT": ("", "\x7f", "a"),
    "report/html._HARMLESS": ("#", "-", ""),
    "report/html._is_harmless": ("", 'url( "', ""),
    "report/page._compact#2": (">", "\n", "x"),
    "report/page.size": ("", '1viewBox="9-- .', "\n~"),
    "report/front._CUT": ("", "-1_", "x"),
    "report/front.rated_load": ("", "\n ", ""),
    "paper1982/words._label": ("", "\t", ","),
    "served/editing._DOUBT": ("# doubt:", "\t", "\n~"),
    "served/editing._KEY": ("", "a", " "),
    "served/editing._PLACE": ("campaign.toml: 1. ", "a", "campaign.toml: [__1] a__"),
    "served/editing._QUOTED": ("", "' '", ","),
    "served/editing._ROW": ("", "tests.csv row 911: ", "a"),
    "served/editing._TABLE": ("# [", "a", ""),
    "served/editing._of_row": ("", ")", "]"),
    "served/editing._typed": ("", "1", ","),
    "served/site._CARD": ("", 'xlink:href="#-"', ""),
    "served/workspace._key": ("", "Ee", ","),
    "served/workspace.new_folder": ("", "{", "'\x00"),
    "study/cache._LINE": ("", "a ", ""),
    "study/cache._FORMER": ("", "a", ""),
    "study/repeated._NUMBER": ("", "-199e+99", "é"),
    "study/watch._key": ("", "Z", "Z "),
    "units._ATTACHED": ("", "]]", "\t"),
    "units._BAND": ("1", " ", "!"),
    "units._BRACKETED": ("a", " ", "x"),
    "units._CHARGE": ("", "n", "é"),
    "units._QUANTITY": ("", "a", ""),
    "units._THOUSANDS": ("", "a", ""),
    "units._decimal_comma": ("", "!", "Z "),
    "units._number_and_unit": ("", "a", ""),
    "units._range": ("009.", "9", "\x00"),
    "units.frequency_grid": ("", "0 e", ""),
    "units.frequency_grid#2": ("", ",", ""),
    "units/grammar._JOINED": ("", "a", ""),
    "units/grammar._TOKEN": ("", " ", ""),
    "units/kinds._likely": ("", "a", ""),
    "units/kinds._likely#2": ("", "a", ""),
    "units/kinds._likely#3": ("", "Z", "\t"),
    "io/layout._THOUSANDS": ("", "1\u202f", "!"),
    "io/tables/cells._COMPLEX_CELL": ("", "1", "!"),
    "io/tables/vocabulary._AMPLITUDES": ("", "p-", "!"),
    "io/tables/vocabulary._IN_HAN": ("", "频", "1"),
    "io/tables/vocabulary._of_words": ("", "a1", "!"),
    "words/heads._AT_END": ("a", " ", "x!"),
    "words/heads._COMMAND": ("", "}", "a"),
    "words/heads._MODELS": ("871", "1", "a"),
    "words/heads._KINDED": ("", "a ", "!"),
    "words/heads._SET_OFF": ("a", " in ", ","),
    "words/heads._SPLIT": ("", "9ü", "1"),
    "words/heads.words_of": ("", " ", "-"),
    "virtual/folder._campaign_toml": ("", "_", "é"),
    "virtual/folder.prepare": ("", "a", ""),
}


@pytest.fixture(scope="module")
def known():
    return uses()


def test_every_pattern_has_its_worst_text(known):
    assert {key for key, several in known.items() if key not in OWN} == set(WORST)
    assert set(OWN) <= set(known)
    assert set(LONGEST) <= set(WORST)
    assert all(one.pattern is not None for key in WORST for one in known[key])


@pytest.mark.parametrize("key", WORST)
def test_a_pattern_is_linear(known, key):
    before, repeated, after = WORST[key]
    longest, each = LONGEST.get(key, 250_000), LIMIT
    for length in (16_000, 250_000):  # the shorter text shows a quadratic pattern within a second
        size = min(length, longest)
        text = before + repeated * ((size - len(before + after)) // len(repeated)) + after
        most = max(each * length * len(known[key]), 0.25)  # a busy machine; a quadratic pattern takes a second
        taken = sum(seconds(one, text, length // size) for one in known[key])
        if taken > most:  # perhaps by chance
            taken = sum(seconds(one, text, length // size) for one in known[key])
        assert taken <= most
        # a machine that is slow with the shorter text is as slow with the longer one
        each = max(LIMIT, 3 * taken / length / len(known[key]))
