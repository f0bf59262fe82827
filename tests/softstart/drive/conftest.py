"""What the tests of bad input share."""

import re

import pytest

from softstart.errors import InputError

GOOD = {
    "motor_inertia": 0.035,
    "starting_torque": 62.0,
    "stiffness": 368.465,
    "gap": 0.5,
    "load_inertia": 0.175,
    "load_torque": 7.16,
    "target_speed": 92.0,
}


@pytest.fixture
def sentences():
    """The sentences of the InputError that an attempt must raise: clear text."""

    def raised(attempt):
        with pytest.raises(InputError) as error:
            attempt()
        found = error.value.sentences
        assert str(error.value) == "\n".join(found)
        assert all(re.search(r"[.?]$", sentence) and "\n" not in sentence for sentence in found)
        assert not any("Traceback" in sentence for sentence in found)
        return found

    return raised
