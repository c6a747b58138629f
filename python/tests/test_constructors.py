"""Mistakes are refused where they are made, in the words of Python."""

from __future__ import annotations

from typing import Any

import pytest
from tank_study import MODEL, tank

import lynkeus


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        ({"measured": ["nope"]}, "no output named 'nope'; it has y"),
        ({"unknown": ["neither"]}, "no input named 'neither'; it has inflow"),
        ({"noise": {"z": 1.0}}, '`noise` of \\[sensors\\]: no output is called "z"'),
        ({"limits": {"z": [0, 1]}}, '"z"'),
        ({"process_noise": {"q": 1.0}}, '"q"'),
        ({"box": {"q": [0, 1]}}, "the box has no side 'q'"),
        ({"parameters": {"q": 1.0}}, "no parameter `q`"),
        ({"observer": "nope"}, '"nope"'),
        ({"plot": {"show": ["q"]}}, '"q"'),
    ],
)
def test_a_study_knows_its_model(mistake: dict[str, Any], message: str) -> None:
    with pytest.raises(lynkeus.InputError, match=message) as raised:
        lynkeus.Study(MODEL, **mistake)
    # nobody wrote the text in which the name has a line
    assert "study:" not in str(raised.value)


def test_a_model_can_be_read() -> None:
    with pytest.raises(lynkeus.InputError, match="model.mo:1"):
        lynkeus.Model.from_modelica("model A Real x; equation der(x)=-x end A;")
    with pytest.raises(lynkeus.InputError, match="no model is called 'Tnk'.*'Tank'.*it has Tank"):
        lynkeus.Model(MODEL.text, "tank.mo", "Tnk")


def test_a_value_may_come_later() -> None:
    text = "model A parameter Real k; Real x(start=1, min=0, max=2); output Real y = x; equation der(x) = -k*x; end A;"
    study = lynkeus.Study(lynkeus.Model.from_modelica(text), observer="ekf")
    with pytest.raises(lynkeus.InputError, match="k"):
        study.design()
    assert study.replace(parameters={"k": 1.0}).design().family == "ekf"


def test_a_file_of_several_models_waits_for_the_choice() -> None:
    text = MODEL.text + MODEL.text.replace("Tank", "Other")
    with pytest.raises(lynkeus.InputError, match="Tank"):
        lynkeus.Study(lynkeus.Model.from_modelica(text))
    assert lynkeus.Study(lynkeus.Model.from_modelica(text, "Other")).check().plant == "Other"


def test_states_have_ranges() -> None:
    with pytest.raises(lynkeus.InputError, match="min <= max"):
        lynkeus.Model.from_function(lambda t, x: [-x[0]], states={"x": {"min": 1, "max": 0}})


def test_later_messages_name_the_place() -> None:
    with pytest.raises(lynkeus.InputError, match="nope"):
        tank().replace(noise={"nope": 1.0}).check()
