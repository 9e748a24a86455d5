"""A study file: one base problem or many, and the overrides that make its cases; read under caps, frozen."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from math import prod
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import AfterValidator, BeforeValidator, ValidationError

from trajopt import problem_file, units
from trajopt.errors import BadInput
from trajopt.fields import Section, nearest
from trajopt.problem import OneLine
from trajopt.study.answer import key_of
from trajopt.study.overrides import MOST, Override, Row, flat, listed, read_table

MANY: Final = 10_000  # cases: more are refused unless they are meant
_SHOWN: Final = 20  # faults looked for before the file is refused


def _texts(value: Any) -> Any:
    return (value,) if isinstance(value, str) else value


class Plot(Section):
    """What the picture of a study shows: columns without their units (``move.time``, ``peak_power``). ``y``: a row of
    panels each; ``panels``: a column of panels each of its values; ``series``: a curve each of its values."""

    x: str
    y: Annotated[tuple[str, ...], BeforeValidator(_texts)]
    series: str | None = None
    panels: str | None = None


def _some(value: Any) -> Any:
    if value is not None and not isinstance(value, str | dict):
        raise ValueError(f"must be a file, a ready-made problem's name or a section, got {units.shown(value)}")
    return value


def _axes(grid: dict[str, Any]) -> dict[str, Any]:
    axes = dict(flat("", grid))
    for key, values in axes.items():
        if not isinstance(values, list):
            raise ValueError(f'{key}: must be a list of values such as ["0.8 s", "1 s"], got {units.shown(values)}')
        if not values:
            raise ValueError(f"{key}: is empty; list at least one value, or leave the key out")
    return axes


class _File(Section):
    """The keys of a study file."""

    title: OneLine = ""
    problem: Annotated[Any, AfterValidator(_some)] = None
    problems: tuple[str, ...] = ()
    grid: Annotated[dict[str, Any], AfterValidator(_axes)] = {}
    case: tuple[dict[str, Any], ...] = ()
    table: str | None = None
    plot: Plot | None = None


@dataclass(frozen=True)
class Case:
    """One problem of a study. ``key`` is its identity in the store; ``fault`` says why it has none."""

    number: int
    base: int
    overrides: tuple[Override, ...]
    where: str
    name: str = ""
    key: str = ""
    fault: str = ""


@dataclass(frozen=True)
class Plan:
    """The cases of a study, in order. ``bases``: name -> content of a problem file; ``folder``: of files that cases
    name."""

    title: str
    bases: tuple[tuple[str, Mapping[str, Any]], ...]
    cases: tuple[Case, ...]
    plot: Plot | None = None
    folder: Path = Path()

    def content(self, case: Case) -> dict[str, Any]:
        """What a problem file of this case would hold. Raises BadInput."""
        data: dict[str, Any] = copy.deepcopy(dict(self.bases[case.base][1]))
        for key, value in case.overrides:
            problem_file.assign(data, key, copy.deepcopy(value), f"{case.where}, {key}")
        return problem_file.carry_tables(data, case.where, self.folder)

    @property
    def solvable(self) -> list[Case]:
        """The cases that can be meant."""
        return [case for case in self.cases if not case.fault]


def load(path: str | Path, keep_going: bool = False, many: bool = False) -> Plan:
    """The plan in a study file, or in the ready-made study of that name.

    With ``keep_going`` a case that cannot be meant is kept, as BAD_INPUT; ``many`` allows more than `MANY`.
    Raises BadInput, TooMany.
    """
    source = problem_file.find(Path(path), problem_file.ready_made("studies"), "study")
    name = str(path)
    data = problem_file.read_toml(problem_file.read_text(source), name)
    return from_dict(data, name, source.parent, keep_going, many)


def from_dict(
    data: dict[str, Any], name: str = "study", folder: Path = Path(), keep_going: bool = False, many: bool = False
) -> Plan:
    """The plan stated by the content of a study file; ``folder`` is where the files that it names are looked for.

    Raises BadInput, TooMany.
    """
    try:
        file = _File.model_validate(data)
    except ValidationError as error:
        raise problem_file.refused(name, problem_file.explain(error, _File)) from None
    rows, axes = _rows(file, name, folder), file.grid
    _refuse_contradictions(file, rows, name)
    bases = tuple(_bases(file, name, folder))
    count = len(bases) * len(rows) * prod(len(values) for values in axes.values())
    _refuse_many(count, many, name)
    plan = Plan(file.title, bases, tuple(_combined(len(bases), rows, axes)), file.plot, folder)
    return replace(plan, cases=tuple(_checked(plan, name, keep_going)))


class TooMany(BadInput):
    """More cases than anybody asks for by hand; allowed when they are meant."""


def _refuse_many(count: int, many: bool, name: str) -> None:
    if count > MOST:
        raise problem_file.refused(name, f"states {count:,} cases; at most {MOST:,} are taken: thin out [grid]")
    if count > MANY and not many:
        text = f"states {count:,} cases; more than {MANY:,} need --yes, if they are meant"
        raise TooMany(str(problem_file.refused(name, text)))


def _refuse_contradictions(file: _File, rows: Sequence[Row], name: str) -> None:
    if (file.problem is None) == (not file.problems):
        raise problem_file.refused(name, 'problem: give one problem = "move.toml" or a list of problems')
    if not (file.problems or file.grid or file.case or file.table):
        raise problem_file.refused(name, "nothing varies; add [grid], [[case]], table or problems")
    if file.case and file.table is not None:
        raise problem_file.refused(name, "case: give the cases here or in the table, not both")
    for key in (file.plot.x, file.plot.series, file.plot.panels) if file.plot else ():
        varied = {"name", "problem", *file.grid, *(other for row in rows for other, _ in row.overrides)}
        if key is not None and key not in varied:
            raise problem_file.refused(name, f"plot: {key} is not varied{nearest(key, sorted(varied))}")
    for key in file.grid:
        if any(key == other for row in rows for other, _ in row.overrides):
            raise problem_file.refused(name, f"grid.{key}: is given a case as well; leave one of them out")


def _bases(file: _File, name: str, folder: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    if isinstance(file.problem, dict):
        yield "", problem_file.carry_tables(file.problem, name, folder)
        return
    ready = problem_file.ready_made()
    for text in (file.problem,) if file.problem is not None else file.problems:
        path = problem_file.find(Path(text), ready, "problem", folder)
        where = f"{name}: {text}"
        content = problem_file.read_toml(problem_file.read_text(path), where)
        yield Path(text).stem, problem_file.carry_tables(content, where, path.parent)


def _rows(file: _File, name: str, folder: Path) -> list[Row]:
    if file.table is not None:
        return read_table(folder / file.table)
    if not file.case:
        return [Row("")]
    return [listed(f"case {i}", entry, name) for i, entry in enumerate(file.case, 1)]


def _combined(bases: int, rows: Sequence[Row], axes: Mapping[str, Sequence[Any]]) -> Iterator[Case]:
    """Problems × rows × grid, the last fastest."""
    every = product(range(bases), rows, product(*axes.values()))
    for number, (base, row, values) in enumerate(every, 1):
        where = row.where or f"case {number}"
        overrides = (*row.overrides, *zip(axes, values, strict=True))
        yield Case(number, base, overrides, where, row.name, fault=row.fault)


@dataclass
class _Faults:
    """What is wrong with the cases so far: the whole file is refused, or with ``keep_going`` the cases alone."""

    name: str
    keep_going: bool
    found: list[tuple[str, str]] = field(default_factory=list)

    def add(self, case: Case, message: str) -> Case:
        self.found.append((case.where, message))
        if not self.keep_going and len(self.found) >= _SHOWN:
            self.refuse()
        return Case(case.number, case.base, case.overrides, case.where, case.name, fault=message)

    def refuse(self) -> None:
        """Raises BadInput with the first fault in full and the places of the others."""
        (_, first), *others = self.found
        places = ", ".join(dict.fromkeys(where.rpartition(", ")[2] for where, _ in others))
        also = f"; faults as well: {places}" if others else ""
        remedy = "" if self.keep_going else "; mend them, or do without (--keep-going)"
        raise BadInput(f"{problem_file.refused(self.name, first)}{also}{remedy if others else ''}")


def _checked(plan: Plan, name: str, keep_going: bool) -> Iterator[Case]:
    """The cases with their keys. Raises BadInput for what cannot be meant, and for one problem stated twice."""
    faults, known = _Faults(name, keep_going), dict[str, Case]()
    for case in plan.cases:
        if case.fault:
            yield faults.add(case, case.fault)
            continue
        try:
            key = key_of(problem_file.from_dict(plan.content(case), _words(case)).hash)
        except BadInput as error:
            yield faults.add(case, str(error))
            continue
        if (twin := known.get(key)) is not None:
            yield faults.add(case, f"{_words(case)}: states the same problem as {twin.where}; leave one of them out")
            continue
        known[key] = case
        yield Case(case.number, case.base, case.overrides, case.where, case.name, key)
    if faults.found and (not keep_going or not known):
        faults.refuse()


def _words(case: Case) -> str:
    """Where a case is stated, and by which overrides."""
    if not case.where.startswith("case "):
        return case.where
    return f"{case.where} ({', '.join(f'{key} = {units.shown(value)}' for key, value in case.overrides)})"
