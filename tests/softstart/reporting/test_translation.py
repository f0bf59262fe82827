"""A report in another language: each of its sentences comes from a template, and one file has them all."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from softstart import Chain, Drive, InputError
from softstart.language import said, speaking
from softstart.reporting import Project, Translation, report, report_chain, write_sentences
from softstart.reporting.translation import every_template

from .conftest import untypeset

CRANE = Drive.load("crane-4amtkf")
SAME = Translation("en", {one: one for one in every_template()})
# each sentence in marks, and each heading of a table
MARKED = Translation(
    "x", {one: " | ".join(f"«{part}»" for part in one.split(" | ")) for one in every_template()}
)
# what is no sentence: names of strategies, of values in files, of units and of programs
STRATEGIES = (
    "direct, ramp, s-curve, shaped, state-feedback, take-up, acceleration-delay, current-limit-feedback, "
    "pulse-coast-hold, reduced-first-stage, reduced-two-stage"
)
OTHERS = (
    "K_dyn, dyn, rad, deg, arcmin, rpm, phi1, phi2, softstart, Python, UTC, gap, theta, hanging, motor, "
    "reactive, unknown"
)
NAMES = f"{STRATEGIES}, {OTHERS}".split(", ")
MANUALS = [
    "Danfoss VLT AutomationDrive FC",
    "Yaskawa GA800",
    "Control Techniques Unidrive M200",
    "Omron MX2 (3G3MX2)",
    "ABB DCS 500B",
]
UNTOLD = ("code", "pre", "style")  # files, commands, names in manuals


class _Texts(HTMLParser):
    """The texts of a page, those of pictures among them, without files and commands."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.within: list[str] = []
        self.found: list[str] = []
        self.feed(untypeset(page))

    def handle_starttag(self, tag, attrs):
        if tag in UNTOLD:
            self.within.append(tag)

    def handle_endtag(self, tag):
        if self.within and tag == self.within[-1]:
            self.within.pop()

    def handle_data(self, data):
        if not self.within and data.strip():
            self.found.append(data.strip())


def outside(text: str) -> str:
    """What stands in no marks."""
    depth, found = 0, ""
    for letter in text:
        depth += (letter == "«") - (letter == "»")
        found += letter if depth == 0 and letter != "»" else ""
    assert depth == 0, text[:300]
    return found


def untold(page: str, names: list[str]) -> list[str]:
    """Texts of a page that say something in no sentence, besides these names."""
    found = []
    for rest in outside("\n".join(_Texts(page).found)).splitlines():  # formulas of pictures are in pieces
        known = "|".join(re.escape(name) for name in sorted([*names, *NAMES], key=len, reverse=True))
        if re.search(r"[A-Za-z]{3,}", re.sub(known, "", rest)):
            found.append(rest)
    return found


@pytest.mark.parametrize(
    ("drive", "controllers"),
    [
        ("hoist-15kw", ["ramp", "s-curve", "pulse-coast-hold", "reduced-first-stage"]),
        ("servo-axis-small", ["ramp", "state-feedback"]),
        ("crane-4amtkf", None),
        ({"permissible_torque": 40.0}, ["ramp", "s-curve"]),
        ({"gap": 0.0, "load_kind": "reactive"}, ["ramp"]),
        ({"start_position": "unknown", "load_kind": "reactive", "torque_lag": 0.002}, ["ramp"]),
    ],
)
def test_a_report_says_nothing_that_is_no_sentence_of_the_translation(drive, controllers):
    drive = CRANE.replace(**drive) if isinstance(drive, dict) else drive
    made = report(drive, controllers=controllers, budget=0.0, project=Project(language=MARKED))
    values = [one.name.replace("_", " ") for sheet in made.sheets for one in sheet.settings]
    page = made.to_html()
    assert untold(page, [str(made.drive.name), *MANUALS, *values]) == []
    assert '<html lang="x">' in page
    assert page.count("«") > 200


def test_a_report_of_a_chain_says_nothing_that_is_no_sentence_of_the_translation():
    chain = Chain.load("crane-4-mass", also={f"shaft[{k}].damping_ratio": "0.02" for k in (1, 2, 3)})
    made = report_chain(chain, controllers=["ramp", "take-up"], budget=0.0, project=Project(language=MARKED))
    names = [chain.name, chain.assumed, *(one.name for one in chain.masses), "slope", *MANUALS]
    names += [one.name.replace("_", " ") for sheet in made.sheets for one in sheet.settings]
    assert untold(made.to_html(), names) == []
    assert made.headline.startswith("«")


def test_a_translation_into_the_same_language_changes_no_letter():
    def page(language: Translation) -> str:
        made = report(CRANE, controllers=["ramp", "shaped"], budget=0.0, project=Project(language=language))
        return replace(made, provenance=replace(made.provenance, made="")).to_html()

    assert page(SAME) == page(Translation())


def test_a_sentence_is_said_in_the_order_of_its_language(tmp_path):
    about = tmp_path / "about.toml"
    about.write_text('[project]\nlanguage = "german.toml"\ndecimal = "comma"\n', encoding="utf-8")
    write_sentences(tmp_path / "german.toml")
    whole = (tmp_path / "german.toml").read_text(encoding="utf-8")
    for english, german in {
        "Gentlest start: {name}.": "{name} startet am sanftesten.",
        "{what} {torque} peaks at {peak} N m instead of {direct_peak} N m under direct start, {saved} less; "
        "the start takes {time} s instead of {direct_time} s.": "{what} Statt {direct_peak} N m nur {peak} "
        "N m, in {time} s statt {direct_time} s: {saved} weniger{torque}.",
        "The shaft torque": "",
    }.items():
        assert f'"{english}" = ""\n' in whole
        whole = whole.replace(f'"{english}" = ""\n', f'"{english}" = "{german}"\n')
    (tmp_path / "german.toml").write_text(whole.replace('code = "en"', 'code = "de"'), encoding="utf-8")
    made = report(CRANE, controllers=["shaped"], budget=0.0, project=about)
    run, direct = made.choice.chosen.row.run, made.row("direct").run
    page = untypeset(made.to_html())
    assert '<html lang="de">' in page
    assert "shaped startet am sanftesten. Statt 164,8 N m nur 53,06 N m, in 0,3928 s statt" in page
    assert (round(direct.peak_torque, 1), round(run.peak_torque, 2)) == (164.8, 53.06)
    assert "The strategies compared" in page  # not translated yet
    assert said("The strategies compared") == "The strategies compared"


def test_a_file_of_sentences_keeps_what_stands_in_it(tmp_path):
    path = tmp_path / "de.toml"
    count, missing = write_sentences(path)
    assert count == missing == len(every_template()) > 400
    assert Translation.load(path) == Translation()
    path.write_text('code = "de"\n[sentences]\n"The chain" = "Die Kette"\n"Gone" = "Weg"\n', encoding="utf-8")
    assert write_sentences(path) == (count, count - 1)
    assert Translation.load(path) == Translation("de", {"The chain": "Die Kette"})
    assert '[unused]\n"Gone" = "Weg"\n' in path.read_text(encoding="utf-8")
    path.write_text("[sentences", encoding="utf-8")
    with pytest.raises(InputError, match="this is no TOML"):
        write_sentences(path)
    assert path.read_text(encoding="utf-8") == "[sentences"  # nothing is lost


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ('[sentences]\n"The chains" = "Die Ketten"', 'no such sentence; did you mean "The chain"?'),
        ('[sentences]\n"What nobody ever says here" = "x"', "softstart report --sentences writes them all."),
        ('[sentences]\n"{words} and {last}" = "{words} und"', "the value {last} is missing in the sentence."),
        ('[sentences]\n"{words} and {last}" = "{words} {end} {last}"', "value {end} here; use {words}, {l"),
        ('[sentences]\n"{words} and {last}" = "{words} und {last"', "a brace that is no value is doubled."),
        ('[sentences]\n"figure | value | unit" = "Größe | Wert"', 'give 3 headings, with " | "'),
        ('[sentences]\n"The chain" = 3', "give the sentence in quotes"),
        ('code = "d e"', "give the code of a language"),
        ('language = "de"', "language: a translation has code and the tables [sentences] and [unused]."),
        ("[sentences", "this is no TOML"),
        ("sentences = 3", "[sentences] is a table of sentences."),
    ],
)  # fmt: skip
def test_a_translation_that_would_spoil_a_report_is_refused(text, sentence):
    with pytest.raises(InputError) as raised:
        Translation.read(text, "de.toml")
    assert len(raised.value.sentences) == 1
    assert sentence in str(raised.value)
    assert str(raised.value).startswith("de.toml: ")


def test_a_project_names_the_mistakes_of_its_translation(tmp_path):
    about = tmp_path / "about.toml"
    about.write_text('[project]\nlanguage = "de.toml"\n', encoding="utf-8")
    with pytest.raises(InputError, match=r'\[project\] language = "de.toml": .*there is no such file'):
        Project.load(about)


def test_what_is_said_is_english_again_afterwards():
    heard = []
    with pytest.raises(KeyError), speaking({"The chain": "Die Kette"}):
        {}[heard.append(said("The chain"))]
    assert heard == ["Die Kette"]
    assert said("The chain") == "The chain"
