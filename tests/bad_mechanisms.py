"""Bad loads over position as data, beside `tests.bad_input`: tables that cannot be meant, in a file or beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from tests.bad_input import Bad, BadFile

CRANK: Final = """
[move]
time = "80 ms"
end = { position = "90 deg" }

[load]
inertia = { position = ["0 deg", "20 deg", "40 deg", "60 deg", "80 deg", "100 deg"], value = ["3 g m^2", "4 g m^2", \
"5 g m^2", "4 g m^2", "3 g m^2", "2 g m^2"] }

[objective]
minimize = "force"
norm = "l2"
"""
_DEGREES: Final = '["0 deg", "20 deg", "40 deg", "60 deg", "80 deg", "100 deg"]'
_VALUES: Final = '["3 g m^2", "4 g m^2", "5 g m^2", "4 g m^2", "3 g m^2", "2 g m^2"]'


def _table(position: str = _DEGREES, value: str = _VALUES) -> str:
    return f"load.inertia={{position={position}, value={value}}}"


_OVERRIDES: Final = (
    ("not-monotone", _table(_DEGREES.replace('"40', '"10')), ("load.inertia", "must increase", "row 3", "sort")),
    ("twice", _table(_DEGREES.replace('"40', '"20')), ("load.inertia", "must increase", "twice")),
    ("too-short", _table(_DEGREES.replace(' deg"', ' mrad"')), ("load.inertia", "too short", "move.end.position")),
    ("few-rows", _table('["0 deg", "90 deg"]', '["1 g m^2", "1 g m^2"]'), ("needs 6 rows or more", "got 2", "finer")),
    ("without-unit", _table("[0, 20, 40, 60, 80, 100]"), ("0 has no unit", "rad")),
    ("unequal", _table(value='["3 g m^2"]'), ("as many values as positions", "1 and 6")),
    ("nan", _table(_DEGREES.replace("40 deg", "nan deg")), ("not finite",)),
    ("zero", _table(value=_VALUES.replace('"5', '"0')), ("must be > 0 everywhere", "at position 0.698")),
    ("negative", _table(value=_VALUES.replace('"5', '"-5')), ("must be > 0 everywhere",)),
    ("dips", _table(value=_VALUES.replace('"4', '"0.01', 1)), ("falls to", "between its rows", "finer")),
    ("of-torque", _table(value=_VALUES.replace("g m^2", "N m")), ("N m", "inertia")),
    ("no-value", f"load.inertia={{position={_DEGREES}}}", ("value: is missing",)),
    ("time-and-position", f"load.inertia={{position={_DEGREES}, time=[]}}", ("unknown key 'time'",)),
    ("csv-and-position", f'load.inertia={{csv="a.csv", position={_DEGREES}}}', ("either csv, or position and value",)),
    ("csv-number", "load.inertia={csv=3}", ("csv and column must be texts",)),
    ("csv-missing", 'load.inertia={csv="none.csv"}', ("none.csv", "cannot be read", "CSV table")),
    ("constant-torque", 'load.torque="3 N m"', ("load.torque", "table over position", "csv")),
    ("euler", 'transcription.scheme="euler"', ("transcription.scheme", "load over position", "exact")),
)


def _overrides() -> Iterator[Bad]:
    for name, override, words in _OVERRIDES:
        yield Bad(f"mechanism-{name}", words, CRANK, (override,))


CASES: Final = tuple(_overrides())

_ROWS: Final = "".join(f"{10 * k},{0.003 + 0.0001 * k},{0.1 * k}\n" for k in range(12))
_GOOD: Final = "theta [deg],J [kg m^2],T [N m]\n" + _ROWS


def _beside(table: str) -> Callable[[Path], object]:
    """Makes the problem file, and the table beside it."""

    def make(path: Path) -> None:
        text = CRANK.split("[load]")[0] + '[load]\ninertia = { csv = "load.csv" }\ntorque = { csv = "load.csv" }\n'
        path.write_text(text + "[objective]" + CRANK.split("[objective]")[1])
        path.with_name("load.csv").write_text(table)

    return make


FILES: Final = tuple(
    BadFile(f"mechanism-table-{name}", ("load.csv", *words), _beside(table))
    for name, table, words in (
        ("empty", "", ("holds no table", "header")),
        ("header-only", "theta [deg],J [kg m^2]\n", ("holds no table",)),
        ("without-units", _GOOD.replace(" [deg]", ""), ("'theta' does not say its unit", "brackets")),
        ("unknown-unit", _GOOD.replace("[deg]", "[degrees]"), ("unknown unit", "'deg'")),
        ("blank", _GOOD.replace("20,0.0032", "20,"), ("row 4", "J is ''", "fill it")),
        ("nan", _GOOD.replace("20,0.0032", "20,nan"), ("row 4", "J is 'nan'", "no finite number")),
        ("ragged", _GOOD + "1,2\n", ("row 14 has 2 cells", "header has 3")),
        ("no-torque", _GOOD.replace("N m", "N"), ("no column measures a torque", "N m")),
        ("two-inertias", _GOOD.replace("T [N m]", "K [kg m^2]"), ("2 columns measure an inertia", 'column = "J"')),
        ("decimal-comma", _GOOD.replace("0.0032", "0,0032"), ("row 4 has 4 cells",)),
        ("name-twice", _GOOD.replace("T [", "J ["), ("two columns have the name 'J'",)),
    )
) + tuple(
    BadFile(f"mechanism-table-{name}", words, _beside(table))
    for name, table, words in (
        ("gap", _GOOD.replace("".join(_ROWS.splitlines(True)[1:]), "") + "".join(
            f"{k},{0.003 + 0.0001 * k},0.1\n" for k in (1, 2, 3, 4, 5, 6, 7, 60, 61, 95)
        ), ("load.inertia", "has a gap from", "fill it")),
        ("backwards", _GOOD.replace("20,0.0032", "5,0.0032"), ("load.inertia", "must increase")),
        ("radians-meant", _GOOD.replace("[deg]", "[mrad]"), ("load.inertia", "too short", "its positions are in rad")),
    )
)  # fmt: skip
