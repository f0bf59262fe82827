"""Functions of Structured Text for what IEC 61131-3 leaves open, or has not: each as Python has it.

`{name}` is the function, `{real}` the type of its number.
"""

from __future__ import annotations

# MIN and MAX of the standard do not say what they do with NaN; the first stays unless the second is smaller
MINIMUM = """
FUNCTION {name} : {real}
VAR_INPUT
    first : {real};
    second : {real};
END_VAR
IF second < first THEN
    {name} := second;
ELSE
    {name} := first;
END_IF;
END_FUNCTION
"""
MAXIMUM = MINIMUM.replace("second < first", "second > first")
# conversions to LINT round to nearest in one tool and cut in the other; both are right here
FLOOR = """
FUNCTION {name} : LINT
VAR_INPUT
    number : LREAL;
END_VAR
VAR
    found : LINT;
END_VAR
found := LREAL_TO_LINT(number);
IF LINT_TO_LREAL(found) > number THEN
    found := found - 1;
END_IF;
{name} := found;
END_FUNCTION
"""
CEILING = FLOOR.replace("> number", "< number").replace("found - 1", "found + 1")
CUT = """
FUNCTION {name} : LINT
VAR_INPUT
    number : LREAL;
END_VAR
VAR
    found : LINT;
END_VAR
found := LREAL_TO_LINT(number);
IF number >= 0.0 THEN
    IF LINT_TO_LREAL(found) > number THEN
        found := found - 1;
    END_IF;
ELSIF LINT_TO_LREAL(found) < number THEN
    found := found + 1;
END_IF;
{name} := found;
END_FUNCTION
"""
# from 2**52 on all numbers are whole; what is not a number stays so
FLOOR_REAL = """
FUNCTION {name} : {real}
VAR_INPUT
    number : {real};
END_VAR
IF ABS(number) < 4503599627370496.0 THEN
    {name} := {back}({floor}({to}(number)));
ELSE
    {name} := number;
END_IF;
END_FUNCTION
"""
ABSOLUTE = """
FUNCTION {name} : LINT
VAR_INPUT
    number : LINT;
END_VAR
IF number < 0 THEN
    {name} := -number;
ELSE
    {name} := number;
END_IF;
END_FUNCTION
"""
# a minus zero counts as zero: no comparison finds it
COPY_SIGN = """
FUNCTION {name} : {real}
VAR_INPUT
    size_of : {real};
    sign_of : {real};
END_VAR
IF sign_of < 0.0 THEN
    {name} := -ABS(size_of);
ELSE
    {name} := ABS(size_of);
END_IF;
END_FUNCTION
"""
SIGN = """
FUNCTION {name} : {real}
VAR_INPUT
    number : {real};
END_VAR
IF number > 0.0 THEN
    {name} := 1.0;
ELSIF number < 0.0 THEN
    {name} := -1.0;
ELSE
    {name} := number;
END_IF;
END_FUNCTION
"""
# number <> number is what some compilers take for FALSE
NOT_A_NUMBER = """
FUNCTION {name} : BOOL
VAR_INPUT
    number : {real};
END_VAR
{name} := NOT ((number <= 0.0) OR (number > 0.0));
END_FUNCTION
"""
FINITE = """
FUNCTION {name} : BOOL
VAR_INPUT
    number : {real};
END_VAR
VAR CONSTANT
    unlimited : {real} := {infinity};
END_VAR
{name} := (number < unlimited) AND (number > -unlimited);
END_FUNCTION
"""
# ATAN2 came with the third edition, and not to all tools
ARC_TANGENT = """
FUNCTION {name} : {real}
VAR_INPUT
    y : {real};
    x : {real};
END_VAR
VAR CONSTANT
    half_turn : {real} := 3.141592653589793;
    quarter_turn : {real} := 1.5707963267948966;
END_VAR
IF x > 0.0 THEN
    {name} := ATAN(y / x);
ELSIF x < 0.0 THEN
    IF y >= 0.0 THEN
        {name} := ATAN(y / x) + half_turn;
    ELSE
        {name} := ATAN(y / x) - half_turn;
    END_IF;
ELSIF y > 0.0 THEN
    {name} := quarter_turn;
ELSIF y < 0.0 THEN
    {name} := -quarter_turn;
ELSE
    {name} := 0.0;
END_IF;
END_FUNCTION
"""
FLOOR_QUOTIENT = """
FUNCTION {name} : LINT
VAR_INPUT
    number : LINT;
    divisor : LINT;
END_VAR
VAR
    quotient : LINT;
    left_over : LINT;
END_VAR
quotient := number / divisor;
left_over := number - quotient * divisor;
IF left_over <> 0 THEN
    IF (left_over < 0) XOR (divisor < 0) THEN
        quotient := quotient - 1;
    END_IF;
END_IF;
{name} := quotient;
END_FUNCTION
"""
FLOOR_REMAINDER = """
FUNCTION {name} : LINT
VAR_INPUT
    number : LINT;
    divisor : LINT;
END_VAR
{name} := number - {quotient}(number, divisor) * divisor;
END_FUNCTION
"""
FROM_TRUTH = """
FUNCTION {name} : LINT
VAR_INPUT
    truth : BOOL;
END_VAR
IF truth THEN
    {name} := 1;
ELSE
    {name} := 0;
END_IF;
END_FUNCTION
"""

# helper: (text, helpers that it calls, has one for each kind of number)
HELPERS: dict[str, tuple[str, dict[str, str], bool]] = {
    "min": (MINIMUM, {}, True),
    "max": (MAXIMUM, {}, True),
    "floor": (FLOOR, {}, False),
    "ceil": (CEILING, {}, False),
    "cut": (CUT, {}, False),
    "floor_real": (FLOOR_REAL, {"floor": "floor"}, True),
    "ceil_real": (FLOOR_REAL, {"floor": "ceil"}, True),
    "abs_whole": (ABSOLUTE, {}, False),
    "copysign": (COPY_SIGN, {}, True),
    "sign": (SIGN, {}, True),
    "isnan": (NOT_A_NUMBER, {}, True),
    "isfinite": (FINITE, {}, True),
    "atan2": (ARC_TANGENT, {}, True),
    "floor_quotient": (FLOOR_QUOTIENT, {}, False),
    "floor_remainder": (FLOOR_REMAINDER, {"quotient": "floor_quotient"}, False),
    "from_truth": (FROM_TRUTH, {}, False),
}
