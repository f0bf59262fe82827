"""Names and numbers of Structured Text: what every tool of IEC 61131-3 takes."""

from __future__ import annotations

import math
import re

import numpy as np

from softstart.errors import InputError
from softstart.export.statements import Kind

LONGEST = 32  # characters of a name, which some tools cut off
INFINITY = 2.0**126  # the largest power of two that REAL and LREAL share, so that both find it equal
INFINITY_NAME = "unlimited"  # INFINITY is a word of the C that some tools make

# keywords of IEC 61131-3, of its Instruction List and of actions, names of types and standard functions, and
# words that one tool or another reserves besides
WORDS = """
    abs abstract acos action add add_dt_time add_time adr and andn any any_bit any_char any_date
    any_duration any_elementary any_int any_magnitude any_num any_real any_signed any_string any_unsigned
    array asin at atan atan2 begin bitadr bool bool_to_lint by byte cal calc calcn case ceil char class
    concat configuration constant continue cos ctd ctu ctud d date date_and_time delete dint div divtime
    do ds dt dword else elsif en end_action end_case end_class end_configuration end_for end_function
    end_function_block end_if end_interface end_method end_namespace end_program end_property end_region
    end_repeat end_resource end_step end_struct end_transition end_type end_var end_while eno eof eq exit
    exp expt extends f_edge f_trig false final find floor for from function function_block ge goto gt if
    implements in indexof infinity ini initial_step insert int interface internal interval jmp jmpc jmpcn
    l ld ldate ldn ldt le left len limit lint ln log lower_bound lreal lt ltime ltod lword max method mid
    min mod move mul mux n namespace nan ne non_retain not null of on or orn override p pi pointer
    priority private program program_type property protected public r r1 r_edge r_trig read_only
    read_write real ref ref_to reference region repeat replace resource ret retain retc retcn return
    right rol ror round rs s s1 sd sel shl shr sign sin single sint sizeof sl sqr sqrt sr st step stn
    string struct sub super t tan task then this time time_of_day to tod tof ton tp transition true trunc
    type udint uint ulint union until upper_bound using usint ustring var var_access var_config
    var_external var_global var_in_out var_input var_inst var_output var_stat var_temp wchar while with
    word wstring xor
"""
RESERVED = frozenset(WORDS.split())


class Names:
    """Names of one scope: each is given out once, without regard to case.

    >>> names = Names()
    >>> [names.of(name) for name in ("T", "t_", "w1", "W1", "dt", "in__it")]
    ['T_value', 't_value_2', 'w1', 'W1_2', 'dt_value', 'in_it']
    """

    def __init__(self, taken: Names | None = None) -> None:
        self._names: dict[str, str] = {}
        self._taken: set[str] = set(taken._taken) if taken else {INFINITY_NAME, f"{INFINITY_NAME}_lreal"}

    def of(self, name: str) -> str:
        """The name in Structured Text, the same one each time."""
        if name not in self._names:
            self._names[name] = self.new(name)
        return self._names[name]

    def new(self, name: str) -> str:
        """A name that has not been given out yet, as near as possible to this one."""
        plain = re.sub(r"_+", "_", re.sub(r"[^A-Za-z0-9_]", "_", name)).strip("_") or "number"
        plain = plain if plain[0].isalpha() else f"n{plain}"
        if plain.lower() in RESERVED:
            plain += "_value"
        found, count = plain[:LONGEST].rstrip("_"), 1
        while found.lower() in self._taken:
            count += 1
            ending = f"_{count}"
            found = plain[: LONGEST - len(ending)].rstrip("_") + ending
        self._taken.add(found.lower())
        return found


def prefixed(prefix: str, name: str) -> str:
    """A name with the prefix of the export before it, or with the initials of that where it is too long.

    >>> prefixed("take_up", "step"), prefixed("current_limit_feedback", "state_after_contact")
    ('take_up_step', 'clf_state_after_contact')
    """
    long = f"{prefix}_{name}"
    if len(long) <= LONGEST:
        return long
    return f"{''.join(word[0] for word in prefix.split('_') if word)}_{name}"


def literal(value: bool | float, kind: Kind, single: bool) -> str:
    """A number as it is written; with the fewest digits that are the same number in its precision.

    >>> literal(1e-5, "real", False), literal(3, "whole", False), literal(-0.1, "real", True)
    ('1.0E-5', '3', '(-0.1)')
    >>> literal(float("-inf"), "double", False)
    '(-unlimited)'
    """
    if kind == "truth":
        return "TRUE" if value else "FALSE"
    if math.isnan(value):
        raise InputError("Structured Text has no NaN: a controller that sets one cannot be exported to it.")
    if math.isinf(value):
        text = INFINITY_NAME
    elif kind == "whole":
        text = str(abs(int(value)))
    else:
        text = _real(abs(float(value)), single and kind == "real")
    return f"(-{text})" if math.copysign(1.0, value) < 0.0 else text


def _real(value: float, single: bool) -> str:
    """A number of 0 or more."""
    if single:
        with np.errstate(over="ignore"):
            value = float(np.format_float_scientific(np.float32(value), unique=True))
        if value > float(np.finfo(np.float32).max):
            raise InputError(f"{value:g} is beyond the range of REAL; export with LREAL (float64).")
    text = repr(value).upper()
    if "E" not in text:
        return text
    mantissa, exponent = text.split("E")
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}E{int(exponent)}"


def comment(text: str) -> str:
    """A comment that no tool stumbles over, with a space before it; nothing for an empty text."""
    plain = " ".join(text.split()).encode("ascii", "replace").decode()
    plain = plain.replace("(*", "( *").replace("*)", "* )")
    return f" (* {plain} *)" if plain else ""
