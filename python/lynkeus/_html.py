"""Answers as HTML, for notebooks: the parts of a report as tables, verdicts coloured, pictures inline."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from .errors import LynkeusError

if TYPE_CHECKING:
    from .results import Answer

Report = Mapping[str, Any]

GOOD, BAD, OPEN = "#1a7f37", "#b42318", "#9a6700"
COLOURS = {
    "proved": GOOD,
    "refuted": BAD,
    "undecided": OPEN,
    "fits": GOOD,
    "does not fit": BAD,
    "credible": GOOD,
    "not credible": BAD,
    "everywhere": GOOD,
    "locally everywhere": OPEN,
    "locally everywhere while inputs are constant": OPEN,
    "almost everywhere": OPEN,
    "in part of the box": OPEN,
    "within limits": OPEN,
    "up to disturbances": OPEN,
    "knee": GOOD,
}
CELL = "padding:0.15em 0.8em;text-align:left;vertical-align:top"


class Markup(str):
    """A text that is HTML already."""


def verdict(word: str) -> Markup:
    """A word, in its colour where it decides something."""
    colour = COLOURS.get(word)
    style = f' style="color:{colour};font-weight:600"' if colour else ""
    return Markup(f"<span{style}>{escape(word)}</span>")


def cell(value: Any) -> str:
    """What a cell of a table shows: numbers with four digits, a dash for nothing."""
    match value:
        case Markup():
            return value
        case None:
            return "–"
        case bool():
            return "yes" if value else "no"
        case float():
            return escape(f"{value:.4g}")
        case str():
            return verdict(value) if value in COLOURS else escape(value)
        case [*items]:
            return ", ".join(map(cell, items))
        case _:
            return escape(str(value))


def table(caption: str, head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A table; nothing where it has no rows."""
    body = "".join(
        "<tr>" + "".join(f'<td style="{CELL}">{cell(value)}</td>' for value in row) + "</tr>" for row in rows
    )
    if not body:
        return ""
    titles = "".join(f'<th style="{CELL}">{escape(title)}</th>' for title in head)
    title = f'<caption style="text-align:left;font-weight:600">{escape(caption)}</caption>'
    return f"<table>{title}<thead><tr>{titles}</tr></thead><tbody>{body}</tbody></table>"


def listing(lines: Iterable[str]) -> str:
    """Remarks, one below the other."""
    items = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return f"<ul>{items}</ul>" if items else ""


def _knowledge(found: Sequence[Report], _: Report) -> str:
    return "".join(
        table(part["words"], ["quantity", "known"], [(n, q["known"]) for n, q in part["quantities"].items()])
        for part in found
    )


def _families(found: Sequence[Report], report: Report) -> str:
    return _compared(found) if "against" in report else "".join(map(_examined, found))


def _examined(family: Report) -> str:
    checks = [(c["verdict"], c["name"], c["detail"]) for c in family["checks"]]
    head = f"<p><b>{escape(family['family'])}</b>: {verdict(family['fit'])} – {escape(family['summary'])}</p>"
    return head + table("", ["verdict", "condition", "detail"], checks)


def _compared(families: Sequence[Report]) -> str:
    names = list(dict.fromkeys(name for row in families for name in row.get("rms", {})))
    titles = ["family", *(f"RMS {name}" for name in names), "peak", "settling", "µs/sample", ""]
    return table("", titles, [_row(family, names) for family in families])


def _row(family: Report, names: Sequence[str]) -> list[Any]:
    if "rms" not in family:  # it could not run
        return [family["family"], *(None for _ in names), None, None, None, _reason(family)]
    seconds = family.get("seconds_per_sample")
    errors = [family["rms"].get(name) for name in names]
    said = "credible" if family.get("credible", True) else "not credible"
    took = None if seconds is None else 1e6 * seconds
    return [family["family"], *errors, family.get("peak"), family.get("settling_time"), took, said]


def _reason(family: Report) -> str:
    return next((str(v) for k, v in family.items() if k != "family" and isinstance(v, str)), "")


def _certificate(found: Report, _: Report) -> str:
    parts = [found, *([found["theorem"]] if found.get("theorem") else [])]
    return "".join(map(_proof, parts))


def _proof(part: Report) -> str:
    # inequality and theorem share some of them
    checks = dict.fromkeys((c["verdict"], c["name"], c["detail"]) for c in part.get("hypotheses", []))
    constants = [(c["name"], c["value"], c["meaning"]) for c in part.get("constants", [])]
    return (
        f"<p>{escape(part['basis'])}: {verdict(part['verdict'])}</p>"
        + table("", ["verdict", "condition", "detail"], checks)
        + table("", ["constant", "value", "meaning"], constants)
        + listing(part.get("notes", []))
    )


def _injection(found: Report, _: Report) -> str:
    rows = [
        (name, sensor, gain["at_start"], gain["expression"])
        for name, sensors in found.items()
        for sensor, gain in sensors.items()
    ]
    return table("what a unit of a reading's error adds", ["to", "by", "at the start", "gain"], rows)


def _gain(found: Report, _: Report) -> str:
    rows = [(name, sensor, value) for name, sensors in found.items() for sensor, value in sensors.items()]
    return table("what a unit of a reading's error adds", ["to", "by", "gain"], rows)


def _parameters(found: Report, _: Report) -> str:
    return table("parameters", ["", ""], found.items())


def _final(found: Report, report: Report) -> str:
    errors = report.get("errors", {})
    rows = [
        (name, value, *(errors.get(name, {}).get(k) for k in ("rms_last_half", "peak", "settled_at")))
        for name, value in found.items()
    ]
    titles = ["estimated", "last value", "RMS error, last half", "largest error", "settled at"]
    return table("", titles, rows)


def _innovations(found: Report, _: Report) -> str:
    rows = [
        (name, s["taken"], s["missing"], s["rejected"], s["consistency_last_half"]) for name, s in found.items()
    ]
    return table("", ["sensor", "taken", "missing", "rejected", "consistency (1 is as declared)"], rows)


def _doubts(found: Sequence[Report], _: Report) -> str:
    rows = [(d["level"], d["name"], d["text"]) for d in found]
    return table("", ["doubt", "of", "why"], rows)


def _standard_error(found: Report, report: Report) -> str:
    rows = [
        (name, found[name], report["standard_error_of_start"].get(name), report["scale"].get(name))
        for name in report.get("ranked", found)
    ]
    return table("", ["quantity", "standard error", "of its start", "range"], rows)


def _rows(found: Any, report: Report) -> str:
    if not isinstance(found, Sequence):
        return ""  # of a run: how many
    knee = (report.get("knee") or {}).get("keys")
    keys = [key["key"] for key in report["keys"]]
    figures = [k for k, v in (found[0].items() if found else ()) if not isinstance(v, Mapping)]
    rows = [
        [*row["keys"].values(), *(row.get(f) for f in figures), "knee" if row["keys"] == knee else ""]
        for row in found
    ]
    return table("", [*keys, *(f.replace("_", " ") for f in figures), ""], rows)


def _quantities(found: Report, report: Report) -> str:
    rows = [
        (name, q.get("unit"), *(q["rms_last_half"].get(k) for k in ("mean", "q95", "worst")))
        for name, q in found.items()
    ]
    caption = f"RMS errors over the last half of the rows, {report['completed']} of {report['runs']} runs"
    return table(caption, ["quantity", "unit", "mean", "95 % below", "worst"], rows)


def _notes(found: Sequence[str], _: Report) -> str:
    return listing(found)


#: what is made of the parts of a report, in this order
PARTS: dict[str, Callable[[Any, Report], str]] = {
    "knowledge": _knowledge,
    "families": _families,
    "parameters": _parameters,
    "injection": _injection,
    "gain": _gain,
    "certificate": _certificate,
    "final": _final,
    "innovations": _innovations,
    "doubts": _doubts,
    "standard_error": _standard_error,
    "quantities": _quantities,
    "rows": _rows,
    "warnings": _notes,
    "notes": _notes,
}


def page(answer: Answer) -> str:
    """An answer: its first line, the parts of its report, its picture, and its text to be unfolded."""
    report, text = answer.summary, str(answer)
    parts = "".join(make(report[key], report) for key, make in PARTS.items() if report.get(key))
    title, _, rest = text.partition("\n")
    whole = f"<details><summary>as text</summary><pre>{escape(text)}</pre></details>" if rest else ""
    return f"<div><p><b>{escape(title)}</b>{_credible(answer)}</p>{parts}{_picture(answer)}{whole}</div>"


def _credible(answer: Answer) -> str:
    if answer.refusal is None:
        return ""
    return f" {verdict('not credible')}: {escape(str(answer.refusal))}"


def _picture(answer: Answer) -> str:
    try:
        return answer.to_svg() or ""
    except LynkeusError:
        return ""  # nothing that can be drawn
