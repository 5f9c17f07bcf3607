"""Numbers with each fault are understood; plain ones are left alone."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.model.xml.source import XmlSource
from dynx.rules.numbers_in_text import (
    Misspelling,
    decimal,
    is_number,
    misspelled_number,
    misspelled_vector,
    numeric_attributes,
)

numbers = st.floats(allow_nan=False, allow_infinity=False)
decimals = numbers.map(repr).filter(lambda text: "." in text)


@given(numbers)
def test_a_plain_number_has_no_fault(x: float) -> None:
    assert is_number(repr(x))
    assert misspelled_number(repr(x)) is None
    assert misspelled_number(f"+{abs(x)!r}") is None
    assert misspelled_number(f" \t\n{x!r}") is None


@given(numbers)
def test_a_number_is_written_as_it_was(x: float) -> None:
    assert float(decimal(x)) == x
    assert is_number(decimal(x))
    assert decimal(-0.0) == "0"
    assert len(decimal(x)) <= len(repr(x))


@given(st.lists(numbers, min_size=3, max_size=3), st.sampled_from([" ", "  "]))
def test_a_plain_vector_has_no_fault(xyz: list[float], blank: str) -> None:
    assert misspelled_vector(f" {blank.join(map(repr, xyz))} ") is None


@given(decimals)
def test_a_decimal_comma_is_read_as_the_point(text: str) -> None:
    found = misspelled_number(text.replace(".", ","))
    assert found is not None
    assert (found.fault, found.meant) == ("comma", text)


@given(st.lists(decimals, min_size=3, max_size=3), st.sampled_from([" ", ", ", "; "]))
def test_decimal_commas_of_a_vector(words: list[str], between: str) -> None:
    found = misspelled_vector(between.join(word.replace(".", ",") for word in words))
    assert found is not None
    assert (found.fault, found.meant.split()) == ("comma", words)


@given(st.lists(decimals, min_size=3, max_size=3), st.sampled_from([",", ", ", " , ", ";"]))
def test_commas_between_numbers(words: list[str], between: str) -> None:
    found = misspelled_vector(between.join(words))
    assert found is not None
    assert (found.fault, found.meant.split()) == ("separator", words)


@given(st.lists(numbers.map(repr), min_size=1, max_size=6).filter(lambda words: len(words) != 3))
def test_a_vector_of_another_length_is_cut_or_filled(words: list[str]) -> None:
    found = misspelled_vector(" ".join(words))
    assert found is not None
    assert (found.fault, found.meant.split()) == ("count", [*words, "0", "0"][:3])


@given(decimals, st.sampled_from([".", "kg", " m", "rad", " kg*m^2"]))
def test_what_stands_behind_a_number_is_cut_off(text: str, rest: str) -> None:
    found = misspelled_number(text + rest)
    assert found is not None
    assert (found.fault, found.meant) == ("rest", text)


@given(st.lists(numbers.map(repr), min_size=3, max_size=3), st.sampled_from(["\t", "\n", " \n ", "\u00a0"]))
def test_odd_white_space_of_a_vector(words: list[str], blank: str) -> None:
    found = misspelled_vector(blank.join(words))
    assert found is not None
    assert (found.fault, found.meant.split()) == ("tab", words)


@pytest.mark.parametrize(
    ("written", "fault", "meant"),
    [
        ("2.5 ", "blank", "2.5"),
        (" 2.5\n", "blank", "2.5"),
        ("\u00a02.5", "blank", "2.5"),
        ("inf", "infinite", "1.7976931348623157e+308"),
        ("-Infinity", "infinite", "-1.7976931348623157e+308"),
        ("1e999", "infinite", "1.7976931348623157e+308"),
        ("-1e999", "infinite", "-1.7976931348623157e+308"),
        ("-1.57.", "rest", "-1.57"),
        ("1.5d-3", "rest", "1.5e-3"),
        ("0x10", "rest", "16.0"),
        ("-0x1.8p-2", "rest", "-0.375"),
        ("\u22121.5", "minus", "-1.5"),
        ("1e\u20133", "minus", "1e-3"),
        (" ", "empty", ""),
        ("1,250.5", "comma", "1250.5"),
    ],
)
def test_single_numbers(written: str, fault: str, meant: str) -> None:
    found = misspelled_number(written)
    assert found is not None
    assert (found.fault, found.meant) == (fault, meant)


@pytest.mark.parametrize(
    "written",
    [
        *("heavy", "nan", "\u2212", "\u22121,5,2", "0x1p9999", "1,2,3", "1-2", "--1", "a b"),
        *("25mm", "90deg", "90 \u00b0", "50%", "1/5", "2*pi", "1.5+2", "3 x 4", "1e"),
    ],
)
def test_what_is_no_number_is_a_word(written: str) -> None:
    found = misspelled_number(written)
    assert found is not None
    assert (found.fault, found.meant) == ("word", "")


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("a b c", "0 0 0"),
        ("1 2 nan", "1 2 0"),
        ("inf 2kg -3", "0 2 -3"),
        ("1/5 2 90deg", "0 2 0"),
        ("1,2,3,4", ""),
        ("a", ""),
        ("1 2 x 4", ""),
    ],
)
def test_words_of_a_vector_are_zero(written: str, meant: str) -> None:
    found = misspelled_vector(written)
    assert found is not None
    assert (found.fault, found.meant) == ("word", meant)


@pytest.mark.parametrize("written", ["${mass}", "2.5${unit}", "$(env XYZ)", "$(optenv XYZ)", "${a} 0 0"])
def test_what_xacro_did_not_expand_is_not_understood(written: str) -> None:
    assert misspelled_number(written) == Misspelling("expression", "")
    assert misspelled_vector(written) == Misspelling("expression", "")


def test_an_environment_variable_means_its_default() -> None:
    assert misspelled_vector("$(optenv XYZ 1 2 3)") == Misspelling("expression", "1 2 3")
    assert misspelled_number("$(optenv MASS 2.5)") == Misspelling("expression", "2.5")
    assert misspelled_number("$(optenv XYZ 1 2 3)") == Misspelling("expression", "")
    assert misspelled_vector("$(optenv XYZ $(arg x) 2 3)") == Misspelling("expression", "")


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("${3.0/2}", "1.5"),
        ("-${pi - pi}", "-0"),
        ("${-(1 + 2) * 0.5}", "-1.5"),
        ("${1/0}", ""),
        ("${9**9**9}", ""),
        ("${__import__('os')}", ""),
        ("${'a' * 3}", ""),
        ("${" + "(" * 150 + "1" + ")" * 30 + "}", ""),
    ],
)
def test_arithmetic_of_xacro_has_its_value(written: str, meant: str) -> None:
    assert misspelled_number(written) == Misspelling("expression", meant)
    vector = misspelled_vector(f"{written} 0 ${{1 + 1}}")
    assert vector == Misspelling("expression", f"{meant} 0 2" if meant else "")


@pytest.mark.parametrize("minus", ["\u2212", "\u2013", "\uff0d"])
def test_a_vector_with_another_minus(minus: str) -> None:
    found = misspelled_vector(f"{minus}1 2\t{minus}.5")
    assert found is not None
    assert (found.fault, found.meant) == ("minus", "-1 2 -.5")


def test_a_comma_can_part_thousands() -> None:
    found = misspelled_number("1,250")
    assert found is not None
    assert (found.meant, found.otherwise) == ("1.250", "1250")


SHAPES = (
    '<box size="1 2 3"/>',
    '<sphere radius="4"/>',
    '<cylinder radius="5" length="6"/>',
    '<capsule radius="7" length="8"/>',
    '<mesh filename="a.stl" scale="9 10 11"/>',
)
ALL_NUMBERS = f"""<robot name="r">
  <link name="a"><inertial><origin xyz="1 2 3" rpy="4 5 6"/><mass value="7"/>
    <inertia ixx="8" ixy="9" ixz="10" iyy="11" iyz="12" izz="13"/></inertial>
  {"".join(f"<visual><origin xyz='1 2 3'/><geometry>{shape}</geometry></visual>" for shape in SHAPES)}
  {"".join(f"<collision><origin rpy='1 2 3'/><geometry>{shape}</geometry></collision>" for shape in SHAPES)}
  </link>
  <link name="b"/>
  <joint name="j" type="revolute"><origin xyz="1 2 3" rpy="4 5 6"/><parent link="a"/><child link="b"/>
    <axis xyz="7 8 9"/><limit lower="10" upper="11" effort="12" velocity="13"/>
    <dynamics damping="14" friction="15"/><mimic joint="k" multiplier="16" offset="17"/>
    <calibration rising="18" falling="19"/>
    <safety_controller soft_lower_limit="20" soft_upper_limit="21" k_position="22" k_velocity="23"/></joint>
</robot>"""


def test_the_attributes_with_numbers_of_links_and_joints_are_numeric() -> None:
    found = [(each.name, each.count) for each in numeric_attributes(XmlSource(ALL_NUMBERS))]
    written = re.findall(r"""(\w+)=["']([\d ]+)["']""", ALL_NUMBERS)
    assert sorted(found) == sorted((name, len(numbers.split())) for name, numbers in written)
