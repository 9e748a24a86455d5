"""A study as a tidy table: one row a case, what was varied and what came of it, units in the headings."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from trajopt import units

if TYPE_CHECKING:
    import pandas as pd

    from trajopt.study.plan import Plan
    from trajopt.study.store import Kept

Column = tuple[str, list[Any]]  # heading, and a value a case; None where there is none
_NUMBERS: Final = {"objective": "", "duration": " [s]", "lower_bound": "", "gap": ""}


def table(plan: Plan, answers: Sequence[Kept]) -> pd.DataFrame:
    """case, name, problem (where there are several), the overrides, status, minimised, objective (SI), duration,
    lower bound and gap, metrics (SI), message. Nothing in it depends on who solved what, when, or how fast."""
    import pandas as pd

    found = [kept.answer for kept in answers]
    columns: list[Column] = [("case", [case.number for case in plan.cases]), *_labels(plan), *overrides(plan)]
    columns += [(name, [answer.get(name) for answer in found]) for name in ("status", "minimised")]
    columns += [(name + unit, _floats(answer.get(name) for answer in found)) for name, unit in _NUMBERS.items()]
    columns += [*_metrics(found), ("message", [answer["message"] or None for answer in found])]
    return pd.DataFrame(dict(columns))


def timings(plan: Plan, answers: Sequence[Kept]) -> pd.DataFrame:
    """case, seconds that it took, tries."""
    import pandas as pd

    rows = [(case.number, kept.seconds, kept.tries) for case, kept in zip(plan.cases, answers, strict=True)]
    return pd.DataFrame(rows, columns=["case", "seconds", "tries"])


def _labels(plan: Plan) -> list[Column]:
    columns: list[Column] = []
    if any(case.name for case in plan.cases):
        columns.append(("name", [case.name or None for case in plan.cases]))
    if len(plan.bases) > 1:
        columns.append(("problem", [plan.bases[case.base][0] for case in plan.cases]))
    return columns


def overrides(plan: Plan) -> list[Column]:
    """A column a key: numbers where all its values are, or are quantities of one kind (in the first one's unit); else
    texts, lists and tables as JSON."""
    given = [dict(case.overrides) for case in plan.cases]
    keys = dict.fromkeys(key for case in given for key in case)
    return [_override(key, [case.get(key) for case in given]) for key in keys]


def _override(key: str, values: list[Any]) -> Column:
    present = [value for value in values if value is not None]
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in present):
        return key, values if len(present) == len(values) and _whole(present) else _floats(values)
    unit, number = _quantities(present)
    if number is not None:
        return f"{key} [{unit}]", _floats(None if value is None else number(value) for value in values)
    return key, [value if isinstance(value, str | None) else json.dumps(value, default=str) for value in values]


def _whole(values: Sequence[Any]) -> bool:
    return all(isinstance(value, int) and abs(value) < 1 << 53 for value in values)


def _quantities(texts: Sequence[Any]) -> tuple[str, Callable[[str], float] | None]:
    """The unit of texts that are quantities of one kind, and how to read them in it."""
    try:
        parsed = [units.parse(text) for text in texts if isinstance(text, str)]
    except units.UnitError:
        return "", None
    if len(parsed) < len(texts) or len({dimension for _, dimension, _ in parsed}) != 1:
        return "", None
    unit = parsed[0][2]
    factor = units.parse(f"1 {unit}")[0]

    def number(text: str) -> float:
        value, _, written = units.parse(text)
        return float(text.strip().removesuffix(unit)) if written == unit else value / factor

    return unit, number


def _metrics(answers: Sequence[Mapping[str, Any]]) -> list[Column]:
    found = [
        {f"{name}{_unit(name, answer['rotary'])}": value for name, value in answer["metrics"].items()}
        if "metrics" in answer else {}
        for answer in answers
    ]  # fmt: skip
    headings = dict.fromkeys(heading for metrics in found for heading in metrics)
    return [(heading, _floats(metrics.get(heading) for metrics in found)) for heading in headings]


def _unit(metric: str, rotary: bool) -> str:
    """The unit of a metric of a move or a plant, in brackets; empty for what has none."""
    if metric == "distance" or metric.startswith("residual_vibration"):
        metric = "position"
    for name in (metric, metric.partition("_")[2]):  # rms_force is a kind of its own, peak_force is a force
        if (kind := units.kinds(rotary).get(name)) is not None:
            return f" [{kind.unit}]"
    return " [%]" if metric.endswith("_residual") else ""


def _floats(values: Any) -> list[float]:
    return [float("nan") if value is None else float(value) for value in values]
