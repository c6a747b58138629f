"""Answers in notebooks: well-formed, whatever they say, and with what they found."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

import lynkeus

STUDIES = ["two-tanks/study.toml", "two-tanks/smoothed.toml", "germani-manes/practical.toml"]


def text(answer: lynkeus.Answer) -> str:
    """All that a cell shows."""
    return "".join(ElementTree.fromstring(answer._repr_html_()).itertext())


def cells(answer: lynkeus.Answer) -> list[list[str]]:
    """The rows of all tables, as texts; the page is XML as well."""
    page = ElementTree.fromstring(answer._repr_html_())
    return [["".join(td.itertext()) for td in row.iter("td")] for row in page.iter("tr")]


@pytest.mark.filterwarnings("ignore::lynkeus.NotCredible")
@pytest.mark.parametrize("name", STUDIES)
def test_answers_are_well_formed(examples: Path, name: str) -> None:
    study = lynkeus.Study.load(examples / name)
    for answer in (study.check(), study.design(), study.certify(), study.simulate(), study.how_well()):
        assert any(any(row) for row in cells(answer)), type(answer).__name__


def test_what_a_page_says_is_what_was_found(examples: Path) -> None:
    study = lynkeus.Study.load(examples / "two-tanks" / "study.toml")
    found = study.check()
    check = cells(found)
    assert "upper, lower, pump: known everywhere" in text(found)
    assert sum(row[:1] == ["proved"] for row in check) == len(found.families[0].checks)
    design = study.design()
    gain = design.summary["injection"]["lower"]["level"]
    row = next(row for row in cells(design) if row[:1] == ["lower"])
    assert row == ["lower", f"{gain['at_start']:.6g}", gain["expression"]]
    run = study.simulate()
    row = next(row for row in cells(run) if row[:1] == ["pump"])
    assert row[:4] == ["pump", "V", f"{run.final.pump:.4g}", f"{run.errors.pump.rms_last_half:.3g}"]
    assert all(note in text(run) for note in run.notes)
    sweep = study.tune()
    knee = [row for row in cells(sweep) if "knee" in "".join(row[-1:])]
    assert [row[0] for row in knee] == [f"{sweep.knee['keys'].theta:.4g}"]
    compared = cells(study.replace(compare={"families": ["triangular", "ekf"]}).compare())
    assert [row[0] for row in compared if row] == ["triangular", "ekf"]
    many = cells(study.simulate(runs=3))
    assert [row[:2] for row in many if row] == [[name, "V"] for name in ("upper", "lower", "pump")]


@pytest.mark.filterwarnings("ignore::lynkeus.NotCredible")
@pytest.mark.parametrize("name", STUDIES)
def test_a_notebook_shows_what_the_command_prints(examples: Path, name: str) -> None:
    study = lynkeus.Study.load(examples / name)
    plain = re.compile(r"[\s:=]")
    for answer in (study.check(), study.design(), study.certify(), study.simulate(runs=2)):
        shown = plain.sub("", text(answer))
        for line in str(answer).splitlines():
            if not re.search(r"proved +\d+ ", line):  # a text counts what a page lists
                assert plain.sub("", line.removeprefix("  ").removeprefix("note: ").partition("…")[0]) in shown, line


def test_verdicts_have_their_colours(examples: Path) -> None:
    page = lynkeus.Study.load(examples / "two-tanks" / "study.toml").check()._repr_html_()
    assert '--yes,#15803d);font-weight:600">fits</span>' in page
    assert "style" not in page[page.index("<li>upper") :].partition("</li>")[0]


def test_nothing_of_a_model_becomes_markup() -> None:
    tank = """
    model Tank "<script>alert(1)</script> & \\"more\\""
      input Real inflow(min = 0, max = 5, unit = "<b>&");
      Real level(start = 4, min = 0.1, max = 10, unit = "<i>") "<img src=x>";
      output Real y = level;
    equation
      der(level) = inflow - 0.5*sqrt(level);
    end Tank;"""
    study = lynkeus.Study(
        lynkeus.Model.from_modelica(tank),
        unknown=["inflow"],
        observer={"theta": 1.0},
        simulate={"until": 20, "inputs": {"inflow": 1.2}},
    )
    for answer in (study.check(), study.design(), study.simulate(), study.simulate(runs=2)):
        tags = {element.tag for element in ElementTree.fromstring(answer._repr_html_()).iter()}
        assert not tags & {"script", "img", "i"}


@pytest.mark.filterwarnings("ignore::lynkeus.NotCredible")
def test_many_runs_tell_what_speaks_against_them() -> None:
    """x' = x³/10 leaves every range before the end from some of the starts."""
    model = lynkeus.Model.from_modelica(
        """
        model Growth
          Real x(start = 1, min = -10, max = 10);
          output Real y = x;
        equation
          der(x) = x^3/10;
        end Growth;"""
    )
    simulate = {"until": 4, "output_step": 0.1, "spread": {"x": 0.3}, "method": "rk4", "step": 0.01, "seed": 5}
    study = lynkeus.Study(model, observer={"family": "triangular", "theta": 2}, simulate=simulate)
    runs = study.simulate(runs=12)
    assert runs.refusal is not None
    assert text(runs).count(f"not credible: {runs.refusal}") == 1
