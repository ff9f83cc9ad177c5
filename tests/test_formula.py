"""Formulae: numpy's values for what is allowed, and one sentence with the column for what is not."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wavetank.base.errors import InputError
from wavetank.base.formula import FUNCTIONS, MAX_DEPTH, MAX_LENGTH, Formula

X, Y = np.meshgrid(np.linspace(-3.0, 7.0, 9), np.linspace(-2.0, 2.0, 5))

# ---------------------------------------------------------------- numpy is the oracle
# A formula and the same in Python with numpy, side by side: numbers are float64 in both.
LEAVES = st.one_of(
    st.sampled_from([("x", "x"), ("y", "y"), ("pi", "np.pi"), ("a", "(2 * x - 1)")]),
    st.one_of(st.floats(0, 1e3), st.integers(0, 99)).map(lambda value: (repr(value), f"np.float64({value!r})")),
)
SAME = ["({} + {})", "({} - {})", "{} * {}", "({}) / ({})", "-{}", "+({})"]
NAMES = {"min": "minimum", "max": "maximum"}
ARGUMENTS = {name: f"({', '.join('{}' for _ in kinds)})" for name, (_, kinds) in FUNCTIONS.items() if name != "where"}
CALLS = [(f"{name}{slots}", f"np.{NAMES.get(name, name)}{slots}") for name, slots in ARGUMENTS.items()]
CHOICES = [
    ("({})**({})", "np.power({}, {})"),  # which differs from ** of float64 in the last digit
    ("where({} < {}, {}, {})", "np.where({} < {}, {}, {})"),
    ("where(({} >= {}) & ~({} == {}), {}, {})", "np.where(({} >= {}) & np.logical_not({} == {}), {}, {})"),
    ("where({} > {} or {} != {}, {}, {})", "np.where(({} > {}) | ({} != {}), {}, {})"),
    ("where(not {} <= {} < {}, {}, {})", "np.where(np.logical_not(({0} <= {1}) & ({1} < {2})), {3}, {4})"),
]


def built(parts):
    """Return pairs of templates that are filled with pairs of texts."""

    def fill(template):
        filled = st.tuples(*[parts] * template[0].count("{}"))
        return filled.map(
            lambda pairs: tuple(text.format(*(pair[n] for pair in pairs)) for n, text in enumerate(template))
        )

    return st.sampled_from([(one, one) for one in SAME] + CALLS + CHOICES).flatmap(fill)


@settings(max_examples=120)
@given(st.recursive(LEAVES, built, max_leaves=8))
def test_a_formula_has_numpy_s_values(pair):
    text, oracle = pair
    formula = Formula(text, where={"a": "2*x - 1"})
    with np.errstate(all="ignore"):
        expected = np.broadcast_to(eval(oracle, {"np": np, "x": X, "y": Y}), X.shape)
    if np.isfinite(expected).all():
        found = formula(X, Y)
        assert (found.dtype, found.shape) == (np.float64, X.shape)
        np.testing.assert_array_equal(found, expected)
    else:
        with pytest.raises(InputError, match="must be finite"):
            formula(X, Y)


@settings(max_examples=120)
@given(st.text(alphabet="xy012.+-*/()<>=&|~, sinmaxwhereos_[]:'", max_size=40))
def test_any_text_is_a_formula_or_refused_in_a_sentence(text):
    """Python is not asked: whatever the text, nothing but an ``InputError`` comes of it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Python's grammar warns of '2or 3'
        try:
            Formula(text)(X, Y)
        except InputError as error:
            assert str(error).endswith(".")


def test_the_elliptic_shoal():
    """Berkhoff, Booij and Radder 1982: a shoal on a slope of 1:50, turned by 20 degrees."""
    formula = Formula(
        "where((xr/3)**2 + (yr/4)**2 <= 1, slope - shoal, slope)",
        where={
            "a": "20*pi/180",
            "xr": "x*cos(a) - y*sin(a)",
            "yr": "x*sin(a) + y*cos(a)",
            "slope": "where(xr < -5.82, 0.45, 0.45 - (5.82 + xr)/50)",
            "shoal": "-0.3 + 0.5*sqrt(1 - (xr/3.75)**2 - (yr/5)**2)",
        },
    )
    x, y = np.meshgrid(np.linspace(-10.0, 12.0, 221), np.linspace(-10.0, 10.0, 201))
    angle = np.deg2rad(20.0)
    xr, yr = x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)
    expected = np.full_like(x, 0.45)
    expected[xr >= -5.82] -= (5.82 + xr[xr >= -5.82]) / 50
    top = (xr / 3) ** 2 + (yr / 4) ** 2 <= 1
    expected[top] -= -0.3 + 0.5 * np.sqrt(1 - (xr[top] / 3.75) ** 2 - (yr[top] / 5) ** 2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # the root of negative numbers off the shoal is nobody's concern
        np.testing.assert_allclose(formula(x, y), expected, rtol=0, atol=1e-15)
    assert formula(0.0, 0.0) == pytest.approx(0.45 - 5.82 / 50 - 0.2)


# ---------------------------------------------------------------- what is allowed
def test_values_have_the_coordinates_common_shape():
    assert Formula("0.5")(X, 0.0).shape == X.shape
    assert Formula("x + y")(np.zeros((3, 1)), np.ones(4)).shape == (3, 4)
    assert Formula("x")(1, 2).shape == ()
    values = Formula("x")(X, Y)
    values += 1.0  # a copy, not the coordinates themselves
    assert X[0, 0] == -3.0


def test_variables_and_helpers_in_any_order_have_their_values():
    """Helpers may be numbers or conditions."""
    assert Formula("x*t", variables=("x", "t"))(2.0, 3.0) == 6.0
    with pytest.raises(InputError, match="'y' is an unknown name"):
        Formula("y", variables=("x", "t"))
    where = {"c": "b + a", "b": "2*a", "a": 1.5, "shallow": "x > c or y > c"}
    assert Formula("where(shallow, c, -c)", where=where)(5.0, 0.0) == 4.5


def test_a_branch_that_is_not_taken_makes_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = Formula("where(x > 0, sqrt(x) + log(x), 1/x)")(np.array([-4.0, 4.0]), 0.0)
    np.testing.assert_allclose(found, [-0.25, 2 + np.log(4.0)])


# ---------------------------------------------------------------- what is refused
KNOWN = "allowed are: abs, arccos, arccosh, arcsin, arcsinh, arctan, arctan2, arctanh, clip, cos, cosh, exp, hypot, "
NOT_ALLOWED = "allowed are numbers, names, + - * / **, comparisons < <= > >= == !=, and, or, not, and functions."


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("x + __import__('os')", f"formula, column 5: '__import__' is not a function of a formula; {KNOWN}"),
        ("2*x.__class__", f"formula, column 3: 'x.__class__' is not allowed in a formula; {NOT_ALLOWED}"),
        ("x[0]", f"formula, column 1: 'x[0]' is not allowed in a formula; {NOT_ALLOWED}"),
        ("lambda: x", f"formula, column 1: 'lambda: x' is not allowed in a formula; {NOT_ALLOWED}"),
        ("[x for x in y]", f"formula, column 1: '[x for x in y]' is not allowed in a formula; {NOT_ALLOWED}"),
        ("(x := 3)", f"formula, column 2: 'x := 3' is not allowed in a formula; {NOT_ALLOWED}"),
        ("f'{x}'", f"formula, column 1: \"f'{{x}}'\" is not allowed in a formula; {NOT_ALLOWED}"),
        ("min(*x)", "formula, column 1: 'min(*x)' must have 2 arguments."),
        ("sin(x=y)", "formula, column 1: 'sin(x=y)' must have 1 argument."),
        ("sin(*x)", f"formula, column 5: '*x' is not allowed in a formula; {NOT_ALLOWED}"),
        ("np.sin(x)", "formula, column 1: 'np.sin' is not a function of a formula; "),
        ("(lambda: x)()", "formula, column 2: 'lambda: x' is not a function of a formula; "),
        ("1 + x ^ 2", "formula, column 1: '1 + x ^ 2' holds an operator that is not allowed; a power is written **."),
        ("x % 2", f"formula, column 1: 'x % 2' holds an operator that is not allowed; {NOT_ALLOWED}"),
        ("1 if x > 0 else 2", "is not allowed in a formula; a choice is written where(condition, a, b)."),
        ("x is y", f"formula, column 1: 'x is y' holds an operator that is not allowed; {NOT_ALLOWED}"),
        ("2 + sin", "formula, column 5: 'sin' is a function and needs its arguments, sin(...)."),
        ("atan2(y, x)", "column 1: 'atan2' is not a function of a formula; did you mean 'arctan2'? allowed are"),
        ("2 * slopes", f"formula, column 5: 'slopes' is an unknown name; did you mean 'slope'? {KNOWN}"),
        ("x > 0 & y > 0", "formula, column 5: '0' is a number; a condition is needed here."),
        ("where(x, 1, 2)", "formula, column 7: 'x' is a number; a condition is needed here."),
        ("(x > 0) * 2", "formula, column 2: 'x > 0' is a condition; a number is needed here."),
        ("x > 0", "formula, column 1: 'x > 0' is a condition; a number is needed here."),
        ("'x'", "formula, column 1: \"'x'\" is not a finite real number."),
        ("2j", "formula, column 1: '2j' is not a finite real number."),
        ("True", "formula, column 1: 'True' is not a finite real number."),
        ("1e999", "formula, column 1: '1e999' is not a finite real number."),
        ("9" * 400, "is not a finite real number."),
        ("2x", "formula, column 1: invalid decimal literal in '2x'."),
        ("x +", "formula, column 1: invalid syntax in 'x +'."),
        ("", "formula, column 1: invalid syntax in ''."),
        ("x # d", "formula, column 3: '#' received; must be ASCII, no comments."),
        ("2·x", "formula, column 2: '·' received; must be ASCII, no comments."),
        ("x\0", "formula, column 2: '\\x00' received; must be ASCII, no comments."),
        ("+".join("x" * (MAX_DEPTH + 1)), "is nested too deeply; at most 100 levels, or terms of a sum, are allowed."),
        ("-" * 3000 + "x", "is nested too deeply; at most 100 levels"),
        ("(" * 1000 + "x" + ")" * 1000, "formula, column 201: too many nested parentheses in "),
        ("x" * (MAX_LENGTH + 1), "formula: has 4001 characters; at most 4000 are allowed."),
    ],
)
def test_formula_is_refused_with_its_column(text, sentence):
    with pytest.raises(InputError) as error:
        Formula(text, where={"slope": "x/50"})
    assert sentence in str(error.value) and str(error.value).endswith(".") and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("where", "sentence"),
    [
        ({"a": "b", "b": "c", "c": "a"}, r"^helpers must not need one another in a circle: (\w) -> \w -> \w -> \1\.$"),
        ({"a": "2*a"}, r"in a circle: a -> a\.$"),
        ({"x": "1"}, "^helper 'x': must have another name; this one has a meaning in every formula.$"),
        ({"sin": "1"}, "^helper 'sin': must have another name; this one has a meaning in every formula.$"),
        ({"lambda": "1"}, "^helper 'lambda': must have another name; this one has a meaning in every formula.$"),
        ({"a b": "1"}, "^helper 'a b': must have a name of letters, digits and _, a letter first.$"),
        ({"__class__": "1"}, "^helper '__class__': must have a name of letters, digits and _, a letter first.$"),
        ({"a": "1 + x^2"}, "^helper 'a', column 1: '1 . x.2' holds an operator that is not allowed"),
        ({"a": "1 + b"}, "^helper 'a', column 5: 'b' is an unknown name; allowed are: "),
    ],
)
def test_helpers_are_refused(where, sentence):
    with pytest.raises(InputError, match=sentence):
        Formula("x", where=where)


NOT_FINITE = [("1/x", "inf at x = 0"), ("x + sqrt(x - 1)", "nan at x = 0"), ("9**9**9**9", "inf at x = 1")]


@pytest.mark.parametrize(("text", "sentence"), NOT_FINITE)
def test_values_must_be_finite(text, sentence):
    with pytest.raises(InputError) as error:
        Formula(text)(np.array([1.0, 0.0]), 2.0)
    assert str(error.value) == f"formula '{text}': {sentence}, y = 2; must be finite."
