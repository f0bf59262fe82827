"""Files of tables: what is read, and what is said about everything that is wrong in them."""

import pytest

from softstart.errors import InputError
from softstart.input.documents import Table, read_document
from softstart.input.parameters import Parameter

TOP = Table("", (Parameter("name", "", "name", '"my chain"', default="unnamed"),))
MASS = Table(
    "mass",
    (
        Parameter("inertia", "kg*m^2", "inertia", '"0.1 kg*m^2"', "above 0"),
        Parameter("kind", "", "kind of mass", '"free"', default="free", choices=("free", "stuck")),
    ),
    many=True,
    least=2,
)
LAW = Table(
    "law",
    (Parameter("times", "s", "instants of the table", "[0, 1]", "0 or more", default=None, many=True),),
    required=False,
)
TABLES = (TOP, MASS, LAW)
GOOD = """
name = "two"
[[mass]]
inertia = "350 kg*cm^2"
[[mass]]
inertia = 0.2
kind = "stuck"
"""


def read(text, **more):
    return read_document(text, TABLES, "a chain", **more)


def sentences(text, **more):
    with pytest.raises(InputError) as caught:
        read(text, **more)
    return caught.value.sentences


def test_a_file_is_read_in_si_with_its_defaults():
    assert read(GOOD) == {
        "": {"name": "two"},
        "mass": [{"inertia": 0.035, "kind": "free"}, {"inertia": 0.2, "kind": "stuck"}],
        "law": None,
    }
    assert read(GOOD + "[law]\ntimes = ['0 ms', '500 ms']")["law"]["times"] == (0.0, 0.5)


def test_everything_that_is_wrong_is_told_at_once():
    text = GOOD.replace("0.2", '"0.2 N"').replace('"stuck"', '"stick"') + "colour = 1\n[laws]\ntimes = 3"
    assert sentences(text, where="my.toml") == (
        "my.toml: [laws]: a chain has no such table; did you mean [law]?",
        "my.toml: [mass] 2, colour = 1: [mass] has no key colour; it has inertia, kind.",
        'my.toml: [mass] 2, inertia = "0.2 N": N is a force, not an inertia; '
        'write an inertia as "0.035 kg*m^2" or as a bare number in kg*m^2.',
        'my.toml: [mass] 2, kind = "stick": the kind of mass is "free" or "stuck"; did you mean "stuck"?',
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "it is empty; a chain file has the tables [mass] and [law]"),
        ("[[mass]]\ninertia = 1", "a chain file needs at least 2, and there are 1; add [[mass]] tables"),
        ("[mass]\ninertia = 1", "there may be several; write [[mass]] before each"),
        ("nam = 'x'" + GOOD.replace('name = "two"', ""), "a chain file has no key nam; did you mean name?"),
        (GOOD.replace("inertia = 0.2", ""), 'needed; write for example inertia = "0.1 kg*m^2"'),
        (GOOD.replace("0.2", "1e31"), "its size in kg*m^2 must be between 1e-30 and 1e+30; check number"),
    ],
)  # fmt: skip
def test_each_mistake_has_its_sentence(text, said):
    assert any(said in sentence for sentence in sentences(text)), sentences(text)


def test_changes_go_before_what_the_file_says():
    changed = read(GOOD, also={"mass[2].inertia": "3 kg*m^2", "name": "three", "law.times": [1.0]})
    assert changed["mass"][1]["inertia"] == 3.0
    assert changed[""]["name"] == "three"
    assert changed["law"]["times"] == (1.0,)
    (only,) = sentences(GOOD, also={"mass[3].inertia": 1.0})
    assert only == "mass[3].inertia: write mass[N].inertia with N from 1 to 2."
    (only,) = sentences(GOOD, also={"mass.inertai": 1.0})
    assert only == "mass.inertai: a chain file has no such key; did you mean mass.inertia?"
