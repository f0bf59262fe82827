"""Files with several tables of one name, and with columns: what is read, and mistakes with their place."""

import pytest

from softstart import Chain, InputError
from softstart.input.columns import Wanted, read_columns

GOOD = """
name = "two"
[[mass]]
inertia = "350 kg*cm^2"
[[shaft]]
stiffness = 5
[[mass]]
inertia = 0.2
kind = "reactive"
"""


def test_changes_go_before_what_the_file_says():
    changed = Chain.from_toml(GOOD, also={"mass[2].inertia": "3 kg*m^2", "name": "three"})
    assert [mass.inertia for mass in changed.masses] == [0.035, 3.0]
    assert [mass.kind for mass in changed.masses] == ["active", "reactive"]
    assert changed.name == "three"


@pytest.mark.parametrize(
    ("text", "also", "said"),
    [
        ("", {}, "my.toml: it is empty; a chain file has the tables [mass] and [shaft]"),
        ("[[mass]]\ninertia = 1", {}, "my.toml: [[mass]]: a chain file needs at least 2, and there are 1; "),
        ("[mass]\ninertia = 1", {}, "my.toml: [mass]: there may be several; write [[mass]] before each"),
        (GOOD.replace("name", "nam"), {}, "a chain file has no key nam; did you mean name?"),
        (GOOD + "colour = 1", {}, "my.toml: [mass] 2, colour = 1: [mass] has no key colour; it has "),
        (GOOD.replace("reactive", "reactiv"), {}, '[mass] 2, kind = "reactiv": the kind of the load'),
        (GOOD, {"mass[3].inertia": 1.0}, "mass[3].inertia: write mass[N].inertia with N from 1 to 2."),
        (GOOD, {"mass.inertai": 1.0}, "mass.inertai: a chain file has no such key; did you mean mass.in"),
    ],
)
def test_each_mistake_has_its_sentence(text, also, said):
    with pytest.raises(InputError) as caught:
        Chain.from_toml(text, where="my.toml", also=also)
    assert any(said in sentence for sentence in caught.value.sentences), caught.value.sentences


def test_columns_of_other_names_are_taken_in_order_only_where_there_is_none_too_many():
    """Which of three are time and torque, nobody knows."""
    wanted = (Wanted(("time", "t"), "s"), Wanted(("torque", "u"), "N*m"))
    two, three = "zeit,moment\n1,2\n", "zeit,weg,moment\n1,3,2\n"
    for text in (two, three.replace("moment", "u").replace("zeit", "T")):
        assert [column.tolist() for column in read_columns(text, "here", wanted).values] == [[1.0], [2.0]]
    for text in (three, three.replace("zeit", "t")):
        with pytest.raises(InputError, match="it must name the columns, as time,torque"):
            read_columns(text, "here", wanted)
