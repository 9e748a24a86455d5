"""Bad plants as data, beside `tests.bad_input`: what is wrong, and the words that the one-line refusal must contain."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from tests.bad_input import Bad

POLES: Final = """
[plant]
poles = [0, -2]
gain = 2
input = [-1, 1]
final_value = 1
"""
POLYNOMIALS: Final = """
[plant]
numerator = [1]
denominator = [1, 0.2, 1]
input = [-1, 1]
final_value = 0.5
"""
MATRICES: Final = """
[plant]
A = [[0, 1], [-1, -0.2]]
B = [0, 1]
C = [1, 0]
input = 1
final_value = 0.5
"""
_BAND: Final = "band = ['7 Hz', '9 Hz']"
_FAULTS: Final[dict[str, tuple[tuple[str, tuple[str, ...]], ...]]] = {
    POLES: (
        ("poles=[0, 2]", ("plant: the pole at 2", "unstable", "stabilising loop")),
        ("zeros=[1, 2, 3]", ("plant: improper", "3 zeros against 2 poles", "add the poles")),
        ("zeros=[-2]", ("plant: the zero at -2", "uncontrollable", "remove both")),
        ("numerator=[1]", ("plant: numerator and poles are different descriptions", "or A, B, C and D")),
        ("A=[[1]]", ("plant: poles and A are different descriptions",)),
        ("poles=[]", ("plant: no poles", "set the input at once")),
        ("poles=3", ("plant.poles", "must be a list")),
        ("poles=['-1 rad/s']", ("plant.poles: must be a plain number", "time is in s")),
        ("poles=[nan]", ("plant.poles: must be finite", "1e30")),
        ("poles=[[1, 2, 3]]", ("plant.poles", "neither a number nor a pair [re, im]")),
        (f"poles=[{'-1, ' * 30}]", ("plant.poles", "at most 20 states")),
        (f"poles=[{'[-1, 2], ' * 15}]", ("plant.poles", "at most 20, got 30 with conjugates")),
        ("gain=0", ("plant.gain: 0", "not zero")),
        ("gain=inf", ("plant.gain: must be finite",)),
        ("gain='2 rad/s'", ("plant.gain: must be a plain number",)),
        ("input=[1, -1]", ("plant.input: min must be below max", "swap")),
        ("input=[1, 2, 3]", ("plant.input", "pair [min, max]", "3 values")),
        ("input=0", ("plant.input: must be > 0", "plus-minus")),
        ("input=-1", ("plant.input: must be > 0",)),
        ("input=5 V", ("plant.input: must be a plain number", "'5 V'")),
        ("input=nan", ("plant.input: must be finite",)),
        ("input=[0, 1]", ("plant.input: 0 to 1 cannot both start and stop", "allow both signs")),
        ("final_value=0", ("plant.final_value: a move of zero length",)),
        ("final_value=1 m", ("plant.final_value: must be a plain number",)),
        ("final_value=true", ("plant.final_value: must be a plain number", "True")),
        ("final_value=1e400", ("plant.final_value: must be finite", "inf")),
        ("final_input=0.1", ("plant.final_input: 0.1 keeps a plant with a pole at zero moving", "give 0")),
        ("robust=zvdd", ("plant.robust: must be", '"zvd"', "7 Hz")),
        ("robust=zvd", ("plant.robust", "no oscillatory pole", "list poles")),
        ("robust=3", ("plant.robust: must be", "got 3")),
        ("robust={}", ("plant.robust: give either band", "poles")),
        ("robust={poles = [-1], " + _BAND + "}", ("plant.robust: give either band",)),
        ("robust={poles = [-1], count = 2}", ("plant.robust: damping and count belong to a band",)),
        ("robust={poles = [0]}", ("plant.robust", "not zero")),
        ("robust={poles = [[1, 5]]}", ("plant.robust", "unstable")),
        ("robust={band = [7, 9]}", ("plant.robust.band: 7 has no unit", "8 Hz")),
        ("robust={band = ['7 m', '9 m']}", ("plant.robust.band", "a frequency is needed")),
        ("robust={band = ['7 Hz']}", ("plant.robust.band: needs a pair", "9 Hz")),
        ("robust={band = ['9 Hz', '7 Hz']}", ("plant.robust.band: needs a pair", "min <= max")),
        ("robust={" + _BAND + ", damping = 1.0}", ("plant.robust.damping", "below 1", "not per cent")),
        ("robust={" + _BAND + ", count = 0}", ("plant.robust.count: must be a whole number", "1 to 10")),
        ("robust={" + _BAND + ", count = 2.5}", ("plant.robust.count: must be a whole number",)),
        ("robust={" + _BAND + ", cuont = 3}", ("plant.robust.cuont: unknown key", "'count'")),
        ("ploes=[1]", ("plant.ploes: unknown key", "'poles'")),
        ("velocity=1", ("plant.velocity: unknown key", "known: numerator")),
    ),
    POLYNOMIALS: (
        ("denominator=[1, -0.2, 1]", ("plant: the pole at 0.1", "unstable")),
        ("numerator=[1, 0, 0, 0]", ("plant: improper",)),
        ("numerator=[0]", ("plant: numerator and denominator need finite coefficients",)),
        ("denominator=[]", ("plant: numerator and denominator need finite coefficients",)),
        ("denominator=[2]", ("plant: no poles",)),
        ("denominator=[1, 1e-30, 1e30]", ("plant.final_input", "outside the input limits")),
        ("denominator=[[1, 2], [3, 4]]", ("plant.denominator: must be a plain number",)),
        ("denominator=['1']", ("plant.denominator: must be a plain number",)),
        ("final_value=1.5", ("plant.final_input: 1.5", "outside the input limits", "move less")),
        ("final_value=1e-40", ("plant.final_value", "1e-30")),
        ("final_input=0.6", ("plant.final_input: 0.6 holds y = 0.6, not final_value = 0.5", "leave it out")),
        ("zeros=[1]", ("plant: numerator and zeros are different descriptions",)),
    ),
    MATRICES: (
        ("A=[[0, 1], [1]]", ("plant.A: must be square", "[2, 1]")),
        ("A=[[0, 1]]", ("plant.A: must be square",)),
        ("A=[]", ("plant.A: must be square",)),
        ("A=3", ("plant.A", "must be a list")),
        ("A=[[0, 1], [-1, nan]]", ("plant.A: must be finite",)),
        ("A=[[-1, 0], [0, -1]]", ("plant: the mode at -1", "uncontrollable", "remove it")),
        ("B=[1]", ("plant: A of (2, 2), B of 1", "B (n,)")),
        ("B=[0, 0]", ("plant: the mode", "uncontrollable")),
        ("C=[0, 0]", ("plant: the mode", "unobservable")),
        ("D=x", ("plant.D: must be a plain number",)),
    ),
}


def _texts() -> Iterator[Bad]:
    whole = "input = 1\nfinal_value = 1\n"
    for name, text, words in (
        ("empty", "[plant]\n", ("plant.input: is missing", "write input")),
        ("no-final-value", "[plant]\ninput = 1\n", ("plant.final_value: is missing", "write final_value")),
        ("no-description", f"[plant]\n{whole}", ("plant: is not described", "give numerator")),
        ("no-denominator", f"[plant]\n{whole}numerator = [1]\n", ("plant.denominator: is missing", "give numerator")),
        ("no-matrix", f"[plant]\n{whole}B = [1]\n", ("A: is missing", "or A, B, C and D")),
        ("misspelt", POLES.replace("[plant]", "[plnt]"), ("plnt: unknown key", "'plant'")),
        ("array", POLES.replace("[plant]", "[[plant]]"), ("plant: must be a section",)),
        ("with-a-move", POLES + '[move]\ntime = "1 s"\n', ("move: belongs to an axis", "leave one of them out")),
        ("with-limits", POLES + '[limits]\nforce = "1 N"\n', ("limits: belongs to an axis",)),
        ("with-an-unknown-section", POLES + "[weather]\n", ("weather: unknown key", "known: plant")),
    ):
        yield Bad(f"plant-{name}", words, text)
    yield Bad("plant-title", ("title: must be a text",), POLES, ("title=3",))
    yield Bad("plant-number", ("plant: must be a section with keys numerator",), POLES, ("plant=3",))


CASES: Final = (
    *(Bad(f"plant-{fault}", words, text, (f"plant.{fault}",)) for text in _FAULTS for fault, words in _FAULTS[text]),
    *_texts(),
)
