"""PEtab problems, made here, beside what SciPy makes of the same equations."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("petab", reason="the package petab is not installed")
pytest.importorskip("libsbml", reason="the package python-libsbml is not installed")
integrate = pytest.importorskip("scipy.integrate")

import lynkeus  # noqa: E402
import lynkeus.petab  # noqa: E402

#: A becomes B, which leaves; in a compartment of 2, with a function, a local parameter and an assigned start
MODEL = """<?xml version="1.0" encoding="UTF-8"?>
<sbml xmlns="http://www.sbml.org/sbml/level3/version1/core" level="3" version="1">
<model id="chain" timeUnits="second" extentUnits="mole" substanceUnits="mole">
<listOfFunctionDefinitions><functionDefinition id="flow"><math xmlns="http://www.w3.org/1998/Math/MathML">
  <lambda><bvar><ci>k</ci></bvar><bvar><ci>c</ci></bvar><apply><times/><ci>k</ci><ci>c</ci></apply></lambda>
</math></functionDefinition></listOfFunctionDefinitions>
<listOfCompartments><compartment id="vessel" size="2" constant="true"/></listOfCompartments>
<listOfSpecies>
  <species id="A" compartment="vessel" initialConcentration="3" hasOnlySubstanceUnits="false"
    boundaryCondition="false" constant="false"/>
  <species id="B" compartment="vessel" initialAmount="1" hasOnlySubstanceUnits="false"
    boundaryCondition="false" constant="false"/>
  <species id="W" compartment="vessel" initialAmount="0" hasOnlySubstanceUnits="true"
    boundaryCondition="false" constant="false"/>
</listOfSpecies>
<listOfParameters>
  <parameter id="k1" value="1" constant="true"/><parameter id="k2" value="1" constant="true"/>
  <parameter id="a0" value="9" constant="true"/><parameter id="dose" value="0" constant="true"/>
  <parameter id="whole" constant="false"/>
</listOfParameters>
<listOfInitialAssignments><initialAssignment symbol="A"><math xmlns="http://www.w3.org/1998/Math/MathML">
  <ci>a0</ci></math></initialAssignment></listOfInitialAssignments>
<listOfRules><assignmentRule variable="whole"><math xmlns="http://www.w3.org/1998/Math/MathML">
  <apply><plus/><ci>A</ci><ci>B</ci></apply></math></assignmentRule></listOfRules>
<listOfReactions>
<reaction id="turn" reversible="false" fast="false">
  <listOfReactants><speciesReference species="A" stoichiometry="1" constant="true"/></listOfReactants>
  <listOfProducts><speciesReference species="B" stoichiometry="2" constant="true"/></listOfProducts>
  <kineticLaw><math xmlns="http://www.w3.org/1998/Math/MathML">
    <apply><times/><ci>vessel</ci><apply><ci>flow</ci><ci>k1</ci><ci>A</ci></apply></apply></math></kineticLaw>
</reaction>
<reaction id="leave" reversible="false" fast="false">
  <listOfReactants><speciesReference species="B" stoichiometry="1" constant="true"/></listOfReactants>
  <listOfProducts><speciesReference species="W" stoichiometry="1" constant="true"/></listOfProducts>
  <kineticLaw><math xmlns="http://www.w3.org/1998/Math/MathML">
    <apply><times/><ci>vessel</ci><ci>half</ci><ci>k2</ci><ci>B</ci></apply></math>
    <listOfLocalParameters><localParameter id="half" value="0.5"/></listOfLocalParameters></kineticLaw>
</reaction>
<reaction id="feed" reversible="false" fast="false">
  <listOfProducts><speciesReference species="A" stoichiometry="1" constant="true"/></listOfProducts>
  <kineticLaw><math xmlns="http://www.w3.org/1998/Math/MathML">
    <apply><times/><ci>vessel</ci>
      <piecewise><piece><ci>dose</ci><apply><lt/>
        <csymbol encoding="text" definitionURL="http://www.sbml.org/sbml/symbols/time">t</csymbol>
        <cn>1.3</cn></apply></piece><otherwise><cn>0</cn></otherwise></piecewise></apply></math></kineticLaw>
</reaction>
</listOfReactions>
</model>
</sbml>
"""
YAML = """format_version: 1
parameter_file: parameters.tsv
problems:
- condition_files: [conditions.tsv]
  measurement_files: [measurements.tsv]
  observable_files: [observables.tsv]
  sbml_files: [model.xml]
"""
PARAMETERS = """parameterId	parameterScale	lowerBound	upperBound	nominalValue	estimate
k1	log10	1e-3	1e3	0.8	1
k2	log	1e-3	1e3	0.6	1
a0	lin	0	10	2.5	1
b_low	lin	0	10	0.7	1
scale_1	log10	1e-3	1e3	1.5	1
scale_2	log10	1e-3	1e3	0.4	1
s	log10	1e-3	10	0.05	1
offset	lin	-1	1	0.1	0
"""
CONDITIONS = """conditionId	dose	B
rest	0	b_low
fed	0.9	0.25
"""
OBSERVABLES = """observableId	observableFormula	noiseFormula	observableTransformation
a	observableParameter1_a * A + offset	noiseParameter1_a	lin
b	B	s	log10
w	W + whole	s * (1 + W)	lin
"""
TRUTH = {"k1": 0.8, "k2": 0.6, "a0": 2.5, "b_low": 0.7, "scale_1": 1.5, "scale_2": 0.4, "s": 0.05, "offset": 0.1}


def solved(p: Mapping[str, float], condition: str, t: float) -> np.ndarray[Any, Any]:
    """A, B (concentrations) and W (an amount), by SciPy, in two legs."""
    dose, b = {"rest": (0.0, p["b_low"]), "fed": (0.9, 0.25)}[condition]

    def f(t: float, x: Any, fed: float) -> list[float]:
        turn, leave = p["k1"] * x[0], 0.5 * p["k2"] * x[1]
        return [fed - turn, 2 * turn - leave, 2 * leave]

    x = np.array([p["a0"], b, 0.0])
    for begin, end, fed in ((0.0, min(t, 1.3), dose), (1.3, t, 0.0)):
        if end > begin:
            x = integrate.solve_ivp(f, (begin, end), x, rtol=1e-12, atol=1e-13, args=(fed,)).y[:, -1]
    return x


def predicted(p: Mapping[str, float], row: list[str]) -> tuple[float, float]:
    """What is measured, and its noise; of b by its logarithm."""
    x = solved(p, row[1], float(row[2]))
    if row[0] == "a":
        return p[row[4]] * x[0] + p["offset"], float(row[5])
    if row[0] == "b":
        return math.log10(x[1]), p["s"]
    return x[2] + x[0] + x[1], p["s"] * (1 + x[2])


def by_scipy(p: Mapping[str, float], rows: list[list[str]]) -> float:
    found = 0.0
    for row in rows:
        mean, sd = predicted(p, row)
        value = float(row[3])
        if row[0] == "b":
            found += math.log(value * math.log(10))
            value = math.log10(value)
        found += 0.5 * ((value - mean) / sd) ** 2 + 0.5 * math.log(2 * math.pi * sd**2)
    return found


def measured() -> list[list[str]]:
    """Rows of the table, with noise: two scalings, three known noises, replicates."""
    random = np.random.default_rng(7)
    rows: list[list[str]] = []
    for condition in ("rest", "fed"):
        for t in (0.5, 1.0, 2.0, 3.5, 5.0):
            for k in (1, 2):
                rows.append(["a", condition, str(t), "", f"scale_{k}", "0.03" if t < 3 else "0.06"])
            rows += [["b", condition, str(t), "", "", ""] for _ in range(2)]
            if condition == "fed":
                rows.append(["w", condition, str(t), "", "", ""])
    for row in rows:
        mean, sd = predicted(TRUTH, row)
        value = mean + sd * random.normal()
        row[3] = repr(float(10**value if row[0] == "b" else value))
    return rows


@pytest.fixture(scope="module")
def rows() -> list[list[str]]:
    return measured()


Written = Callable[..., Path]


@pytest.fixture()
def written(tmp_path: Path, rows: list[list[str]]) -> Written:
    """A problem's files, with replacements: ``written(model=("old", "new"))``."""
    head = "observableId	simulationConditionId	time	measurement	observableParameters	noiseParameters"
    files = {
        "problem.yaml": YAML,
        "model.xml": MODEL,
        "parameters.tsv": PARAMETERS,
        "conditions.tsv": CONDITIONS,
        "observables.tsv": OBSERVABLES,
        "measurements.tsv": "\n".join([head, *("\t".join(row) for row in rows), ""]),
    }

    def write(**changes: tuple[str, str]) -> Path:
        for name, text in files.items():
            for old, new in [changes[k] for k in changes if name.startswith(k)]:
                assert old in text
                text = text.replace(old, new)
            (tmp_path / name).write_text(text)
        return tmp_path / "problem.yaml"

    return write


@pytest.fixture()
def problem(written: Written) -> lynkeus.petab.Problem:
    return lynkeus.petab.load(written())


def test_the_likelihood_is_scipy_s(problem: lynkeus.petab.Problem, rows: list[list[str]]) -> None:
    assert problem.conditions == ["rest", "fed"] and not problem.notes
    assert set(problem.outputs.values()) == {"a", "b", "w"}
    assert problem.values() == TRUTH
    assert problem.nll() == pytest.approx(by_scipy(TRUTH, rows), abs=1e-6)
    other = {**TRUTH, "k1": 1.1, "b_low": 0.9, "s": 0.08, "scale_2": 0.5}
    assert problem.nll(other) == pytest.approx(by_scipy(other, rows), abs=1e-6)
    assert by_scipy(other, rows) - by_scipy(TRUTH, rows) > 10


def test_simulations_are_in_the_units_of_measurements(
    problem: lynkeus.petab.Problem, rows: list[list[str]]
) -> None:
    means = [predicted(TRUTH, row)[0] for row in rows]
    expected = [10**mean if row[0] == "b" else mean for mean, row in zip(means, rows, strict=True)]
    np.testing.assert_allclose(problem.simulations(), expected, rtol=1e-7)


def test_a_fit_ends_where_scipy_s_likelihood_is_least(
    problem: lynkeus.petab.Problem, rows: list[list[str]]
) -> None:
    fit = problem.fit(starts=1)
    assert fit.is_credible and fit.converged
    values = problem.values(fit)
    least = by_scipy(values, rows)
    assert problem.nll(fit) == pytest.approx(least, abs=1e-3)
    assert least < by_scipy(TRUTH, rows)
    for name in set(TRUTH) - {"offset"}:
        sd = fit.parameters[name].sd
        assert sd is not None and abs(values[name] - TRUTH[name]) < 4 * sd
        for factor in (0.98, 1.02):
            assert by_scipy({**values, name: factor * values[name]}, rows) > least
    assert values["offset"] == 0.1


def test_the_files_are_the_same_problem(
    problem: lynkeus.petab.Problem, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert lynkeus.petab.main([str(tmp_path / "problem.yaml"), "-o", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert said.startswith(f"lynkeus fit {tmp_path / 'out' / 'study.toml'}") and repr(problem.constant) in said
    study = lynkeus.Study.load(tmp_path / "out" / "study.toml")
    logs = sorted((tmp_path / "out").glob("log*.csv"))
    assert len(logs) == 2
    again = study.replace(fit={"starts": 1}).fit(logs)
    assert again.values == pytest.approx(problem.fit(starts=1).values, rel=1e-9)


def test_a_prior_on_the_scale_is_on_a_logarithm(written: Written, rows: list[list[str]]) -> None:
    head, first, *rest = PARAMETERS.splitlines()
    with_prior = [f"{head}\tobjectivePriorType\tobjectivePriorParameters"]
    with_prior.append(f"{first}\tparameterScaleNormal\t{math.log10(0.9)};0.001")
    with_prior += [f"{line}\t\t" for line in rest]
    problem = lynkeus.petab.load(written(parameters=(PARAMETERS, "\n".join(with_prior) + "\n")))
    assert problem.nll() == pytest.approx(by_scipy(TRUTH, rows), abs=1e-6)
    values = problem.values(problem.fit(starts=1))
    # the prior is much narrower than what the measurements say
    assert math.log10(values["k1"]) == pytest.approx(math.log10(0.9), abs=0.003)


EVENT = """<listOfEvents><event id="kick" useValuesFromTriggerTime="true"><trigger initialValue="true"
persistent="true"><math xmlns="http://www.w3.org/1998/Math/MathML"><apply><gt/><ci>A</ci><cn>1</cn></apply></math>
</trigger><listOfEventAssignments><eventAssignment variable="B"><math
xmlns="http://www.w3.org/1998/Math/MathML"><cn>1</cn></math></eventAssignment></listOfEventAssignments></event>
</listOfEvents></model>"""


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"model": ("</model>", EVENT)}, 'the event "kick": expected a model without events'),
        ({"model": ('fast="false"', 'fast="true"')}, 'the fast reaction "turn"'),
        ({"observables": ("log10", "log2")}, 'b: expected the transformation lin, log or log10, found "log2"'),
        ({"observables": ("B\ts", "B + unheard\ts")}, 'observable b: nothing is called "unheard"'),
        ({"observables": ("B\ts", "B +* 2\ts")}, "observable b: expected a formula"),
        ({"conditions": ("dose", "doze")}, 'the model has nothing called "doze"'),
        ({"measurements": ("a\trest\t0.5", "a\trest\tinf")}, "row 1: a steady state (time = inf) in a condition"),
        ({"measurements": ("a\trest\t0.5", "a\trest\t-0.5")}, "row 1: expected a time from 0 on, found -0.5"),
        ({"measurements": ("a\trest\t0.5", "a\tresting\t0.5")}, 'row 1: no condition is called "resting"'),
        ({"measurements": ("scale_1\t0.03", "\t0.03")}, "row 1: nothing stands for observableParameter1_a"),
        ({"parameters": ("1e-3\t1e3\t0.8", "0\t1e3\t0.8")}, "k1: a log10 scale from 0"),
        ({"model": ("<ci>half</ci>", "<apply><factorial/><ci>half</ci></apply>")}, 'the function "factorial"'),
    ],
)
def test_what_is_not_read_is_refused_by_name(written: Written, changes: Any, told: str) -> None:
    with pytest.raises(lynkeus.InputError) as caught:
        lynkeus.petab.load(written(**changes))
    assert told in str(caught.value) and ".yaml" in str(caught.value)


#: what is fed settles: A comes to dose/k1, B to 4 dose/k2, and W, which would not, stays out
STEADY = MODEL.replace('<cn>1.3</cn>', '<cn>1e99</cn>').replace(
    '<listOfProducts><speciesReference species="W" stoichiometry="1" constant="true"/></listOfProducts>', ""
)


def test_a_log_may_begin_in_a_steady_state(tmp_path: Path) -> None:
    (tmp_path / "problem.yaml").write_text(YAML)
    (tmp_path / "model.xml").write_text(STEADY)
    (tmp_path / "parameters.tsv").write_text("\n".join(PARAMETERS.splitlines()[:4]) + "\n")
    conditions = "conditionId\tdose\tB\nfed\t0.9\t0.25\nkept\t0.3\tNaN\nanew\t0\t2\n"
    (tmp_path / "conditions.tsv").write_text(conditions)
    (tmp_path / "observables.tsv").write_text(
        "observableId\tobservableFormula\tnoiseFormula\na\tA\t0.1\nb\tB\t0.1\n"
    )
    rows = "observableId\tpreequilibrationConditionId\tsimulationConditionId\ttime\tmeasurement\n"
    for condition in ("kept", "anew"):
        for t in (0, 1, 4):
            rows += f"a\tfed\t{condition}\t{t}\t0.7\nb\tfed\t{condition}\t{t}\t1.1\n"
    rows += "a\t\tfed\tinf\t1\nb\t\tfed\tinf\t5\n"
    (tmp_path / "measurements.tsv").write_text(rows)
    problem = lynkeus.petab.load(tmp_path / "problem.yaml")
    assert problem.conditions == ["fed kept", "fed anew", "fed"]

    k1, k2 = TRUTH["k1"], TRUTH["k2"]
    expected: list[float] = []
    for dose, b in ((0.3, 4 * 0.9 / k2), (0.0, 2.0)):
        for t in (0.0, 1.0, 4.0):
            f: Any = lambda t, x, dose=dose: [dose - k1 * x[0], 2 * k1 * x[0] - 0.5 * k2 * x[1]]
            x = np.array([0.9 / k1, b])
            if t > 0:
                x = integrate.solve_ivp(f, (0.0, t), x, rtol=1e-12, atol=1e-12).y[:, -1]
            expected += [*x]
    expected += [0.9 / k1, 4 * 0.9 / k2]
    np.testing.assert_allclose(problem.simulations(), expected, rtol=1e-6)
    found = np.array([float(line.split("\t")[4]) for line in rows.splitlines()[1:]])
    nll = np.sum(0.5 * ((found - expected) / 0.1) ** 2 + 0.5 * math.log(2 * math.pi * 0.01))
    assert problem.nll() == pytest.approx(nll, abs=1e-4)


def test_a_package_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch, written: Written) -> None:
    def absent(name: str) -> Any:
        raise ImportError(name)

    monkeypatch.setattr("importlib.import_module", absent)
    with pytest.raises(ImportError, match="needs the package petab: pip install 'lynkeus\\[petab\\]'"):
        lynkeus.petab.load(written())


def test_values_have_to_be_those_of_the_problem(problem: lynkeus.petab.Problem) -> None:
    with pytest.raises(lynkeus.InputError, match='no parameter called "k3"'):
        problem.nll({"k3": 1.0})
    with pytest.raises(lynkeus.InputError, match="offset is not estimated"):
        problem.nll({"offset": 0.2})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert problem.nll({"offset": 0.1}) == problem.nll()
