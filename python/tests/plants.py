"""The plants of examples/ as Python functions, each in another way of writing them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import lynkeus as ly
import numpy as np

Plant = dict[str, Any]


def _range(low: float, high: float, start: float | None = None) -> dict[str, Any]:
    return {"min": low, "max": high, "start": start}


def bioreactor() -> Plant:
    def f(t: Any, x: Any, u: Any, p: Any) -> Any:
        X, S, F = x
        mu, D = u
        return {"S": D * (F - S) - mu * X / p.Y, "X": (mu - D) * X, "F": p.k * (p.F0 - F)}

    return {
        "f": f,
        "h": lambda t, x: {"cells": x.X, "substrate": x.S},
        "states": {"X": _range(0.5, 10, 3), "S": _range(0, 20, 5), "F": _range(0, 20, 8)},
        "inputs": {"mu": _range(0, 0.45, 0.2), "D": _range(0.05, 0.4, 0.2)},
        "params": {"Y": 0.5, "k": 0.1, "F0": 12},
    }


def column() -> Plant:
    """Twelve trays at once: no loop over them."""
    trays, feed = 12, 8
    holdup = np.full(trays, 0.55)
    holdup[[0, -1]] = 5.5

    def f(t: Any, x: Any, u: Any, p: Any) -> Any:
        L, V, Zf = u
        y = p.alpha * x / (1 + (p.alpha - 1) * x)
        # what enters each tray from above, the condenser left out
        flow = np.where(np.arange(2, trays + 1) <= feed, L, p.F + L)
        liquid = flow * (x[:-1] - x[1:])
        vapour = V * np.diff(y)
        fed = np.zeros(trays, dtype=object)
        fed[feed - 1] = p.F * (Zf - x[feed - 1])
        inner = fed[1:-1] + liquid[:-1] + vapour[1:]
        condenser, boiler = V * (y[1] - x[0]), liquid[-1] + V * (x[-1] - y[-1])
        return np.concatenate([[condenser], inner, [boiler]]) / p.H

    start = [0.93000585, 0.88953536, 0.84223977, 0.78925097, 0.73261728, 0.67505746]
    start += [0.61947090, 0.56837712, 0.47000139, 0.36710020, 0.27017424, 0.18748224]
    return {
        "f": f,
        "h": lambda t, x: (x[0], x[-1]),
        "states": {"x": {"start": start, "min": 0, "max": 1}},
        "inputs": {"L": _range(3, 6, 4.69), "V": _range(4, 8, 5.94), "Zf": _range(0, 1, 0.75)},
        "outputs": ["top", "bottom"],
        "params": {"alpha": 1.65, "F": 1.65, "H": holdup},
    }


def cstr() -> Plant:
    def f(t: Any, x: Any, u: Any, p: Any) -> Any:
        r = p.k0 * np.exp(-p.E / x.T)
        dilution = u.q / p.V
        return [
            dilution * (u.Cin - x.C) - r * x.C,
            dilution * (p.Tin - x.T) + p.H * r * x.C + p.c * (u.Tj - x.T),
        ]

    return {
        "f": f,
        "h": lambda t, x: x["T"],
        "states": {"C": _range(0, 1.8, 0.6), "T": _range(310, 390, 335)},
        "inputs": {"q": _range(50, 150, 100), "Tj": _range(300, 340, 320), "Cin": _range(0.2, 1.8, 1)},
        "outputs": ["temperature"],
        "params": {"V": 100, "k0": 7.2e10, "E": 8750, "H": 110, "c": 4, "Tin": 340},
    }


def farza() -> Plant:
    def f(t: Any, x: Any, u: Any, p: Any) -> Any:
        (x1, x2, x3, x4, x5), v, a = x, u[0], p[0]
        drift = np.array([(a - x3) * x4 - x1, x3 * x4 - x2, x4 * (1 + x4**2) - x3**3, x5 - x4**3, 0])
        gain = np.array([-x3, a - x3, -10 * ly.sin(t), -2 * ly.cos(t), 5 * ly.sin(2 * t)])
        return drift + gain * v

    limits = {"x1": (12, 1), "x2": (12, 1), "x3": (5, 1), "x4": (4, 2), "x5": (20, 10)}
    return {
        "f": f,
        "h": lambda t, x, u: x[:3],
        "states": {name: _range(-size, size, start) for name, (size, start) in limits.items()},
        "inputs": {"v": {"min": -6, "max": 6}},
        "outputs": ["y1", "y2", "y3"],
        "params": {"a": 1},
    }


def flexible_joint() -> Plant:
    # rows: states; columns: rates, weight, spring, friction, torque
    acts = np.zeros((4, 6))
    acts[[0, 2], [0, 1]] = 1
    acts[1, [2, 3]] = -1 / 0.5
    acts[3, 3:] = [1 / 0.1, -1 / 0.1, 1 / 0.1]

    def f(t: Any, x: Any, u: Any) -> Any:
        weight, spring, friction = 5 * np.sin(x.arm), 50 * (x.arm - x.motor), 0.3 * x.motor_rate
        return acts @ np.array([*x[1::2], weight, spring, friction, u.torque])

    return {
        "f": f,
        "h": lambda t, x: [x.arm],
        "states": {
            "arm": _range(-3, 3, 0.5),
            "arm_rate": _range(-5, 5, 0),
            "motor": _range(-3, 3, 0.5),
            "motor_rate": _range(-10, 10, 0),
        },
        "inputs": {"torque": _range(-10, 10, 0)},
        "outputs": ["angle"],
    }


def germani_manes() -> Plant:
    def f(t: Any, x: Any, u: Any) -> Any:
        return x[1] + (np.square(x[2]) - x[0]) * u[0], -x[2] * (1 + x[0] ** 2), np.sin(x[1])

    return {
        "f": f,
        "h": lambda t, x: x[0],
        "states": {name: _range(-1.5, 1.5, 0.5) for name in ("x1", "x2", "x3")},
        "inputs": {"u": _range(3, 7, 5)},
    }


def induction_motor() -> Plant:
    rotation = np.array([[0, 1], [-1, 0]])

    def f(t: Any, x: Any, u: Any, p: Any) -> Any:
        current, speed, flux = x[:2], x[2], x[3:]
        sigma = 1 - p.M**2 / (p.Ls * p.Lr)
        a = p.Rr / p.Lr
        K = p.M / (sigma * p.Ls * p.Lr)
        g = p.Rs / (sigma * p.Ls) + p.Rr * p.M**2 / (sigma * p.Ls * p.Lr**2)
        turned = p.p * speed * (rotation @ flux)
        torque = p.p * p.M / (p.J * p.Lr) * (flux[0] * current[1] - flux[1] * current[0])
        d_current = K * (a * flux + turned) - g * current + u[:2] / (sigma * p.Ls)
        d_speed = torque - (p.b * speed + u.load) / p.J
        return np.concatenate([d_current, [d_speed], a * (p.M * current - flux) - turned])

    return {
        "f": f,
        "h": lambda t, x: x[:3],
        "states": {
            "ia": _range(-40, 40, 0),
            "ib": _range(-40, 40, 0),
            "w": _range(-50, 200, 0),
            "fa": _range(-2, 2, 0),
            "fb": _range(-2, 2, 0),
        },
        "inputs": {"ua": _range(-320, 320), "ub": _range(-320, 320), "load": _range(0, 10)},
        "outputs": ["current_a", "current_b", "speed"],
        "params": {"Rs": 8, "Rr": 4, "Ls": 0.47, "Lr": 0.47, "M": 0.44, "p": 2, "J": 0.01, "b": 0.01},
    }


def lee() -> Plant:
    def oscillator(q: Any, v: Any, force: Any) -> Any:
        return -q + (1 - q**2) * v + force

    def f(t: Any, x: Any, u: Any) -> Any:
        x1, x2, x3, x4 = x
        (u,) = u
        return [
            x2 + 0.01 * x1 * u,
            oscillator(x1, x2, x3 * u),
            x4 + 0.01 * x2 * x3 * np.exp(u),
            oscillator(x3, x4, u),
        ]

    return {
        "f": f,
        "h": lambda t, x: x[::2],
        "states": {
            "x1": _range(-6, 6, 2),
            "x2": _range(-8, 8, 1),
            "x3": _range(-6, 6, 3),
            "x4": _range(-8, 8, 3.5),
        },
        "inputs": {"u": _range(-2, 2)},
    }


def ltaief() -> Plant:
    def f(t: Any, x: Any, u: Any) -> Any:
        u1, u2, u3, e1 = u
        seen = np.dot([u1, u2 * x.x1], x[1:])
        return [
            x.x1 * seen + x.x1 * u3,
            x.x3 - 10 * x.x2 + u3 - x.x2**3 + e1,
            -x.x3 - 2 * x.x1 * x.x2 - 10 * u1 * x.x2,
        ]

    return {
        "f": f,
        "h": lambda t, x: x.x1,
        "states": {"x1": _range(0.2, 4, 1), "x2": _range(-2, 2, 0.5), "x3": _range(-2, 2, 0.5)},
        "inputs": {"u1": _range(-1, 1), "u2": _range(-1, 1), "u3": _range(-5, 5), "e1": _range(-0.1, 0.1)},
        "outputs": ["y"],
    }


def predator_prey() -> Plant:
    def f(t: Any, x: Any, u: Any, p: Any) -> Any:
        hares, lynxes = x
        r, K, a, b, e, m = p
        hunt = a * hares / (1 + b * hares)
        return r * hares * (1 - hares / K) - hunt * lynxes, e * hunt * lynxes - m * lynxes

    return {
        "f": f,
        "states": {"hares": _range(0.2, 8, 3), "lynxes": _range(0.05, 6, 1)},
        "outputs": ["hares"],
        "params": {"r": 1.5, "K": 6, "a": 1.2, "b": 0.4, "e": 0.6, "m": 0.8},
    }


def quadrotor() -> Plant:
    def f(t: Any, x: Any, u: Any, p: Any) -> Any:
        s = u.wind - x.v
        return [x.v, p.g * ly.tan(x.roll) + (p.d1 + p.d2 * abs(s)) * s, x.rate, u.torque / p.J]

    return {
        "f": f,
        "h": lambda t, x: np.array([x.y, x.roll]),
        "states": {
            "y": _range(-200, 200, 0),
            "v": _range(-15, 15, 0),
            "roll": _range(-0.6, 0.6, 0),
            "rate": _range(-3, 3, 0),
        },
        "inputs": {"torque": _range(-0.2, 0.2, 0), "wind": _range(-8, 12, 0)},
        "outputs": ["position", "angle"],
        "params": {"g": 9.81, "J": 0.02, "d1": 0.3, "d2": 0.02},
    }


def two_tanks() -> Plant:
    def f(t: Any, x: Any, u: Any, p: Any) -> Any:
        upper, lower = x
        return [
            -p.k1 * ly.sqrt(upper) + p.k4 * u.pump,
            p.k2 * ly.sqrt(upper) - p.k3 * ly.sqrt(lower),
        ]

    volts = {"unit": "V", "max": 10}
    return {
        "f": f,
        "h": lambda t, x: x.lower,
        "states": {
            "upper": {**volts, "min": 0.05, "start": 3.99},
            "lower": {**volts, "min": 0.05, "start": 5.2},
        },
        "inputs": {"pump": {**volts, "min": 0, "start": 2}},
        "outputs": {"level": {"unit": "V"}},
        "params": {"k1": 0.03951, "k2": 0.07283, "k3": 0.06651, "k4": 0.03037},
    }


def van_der_pol_pair() -> Plant:
    def f(t: Any, x: Any, u: Any, p: Any) -> Any:
        (q, v), m = x.reshape(2, 2).T, np.array([p.m1, p.m2])
        spring = p.k * (q[::-1] - q)
        return np.stack([v, m * (1 - q**2) * v - [1, 1.5] * q + spring], axis=1).ravel()

    return {
        "f": f,
        "h": lambda t, x: x[0],
        "states": {
            "q1": _range(-3, 3, 1),
            "v1": _range(-5, 5, 0),
            "q2": _range(-3, 3, -1.5),
            "v2": _range(-5, 5, 1),
        },
        "outputs": ["position"],
        "params": {"m1": 1, "m2": 0.5, "k": 0.5},
    }


#: By the folder and file of the Modelica text.
PLANTS: Mapping[str, Plant] = {
    "bioreactor/bioreactor": bioreactor(),
    "column/column": column(),
    "cstr/cstr": cstr(),
    "farza/farza": farza(),
    "flexible-joint/flexible_joint": flexible_joint(),
    "germani-manes/germani_manes": germani_manes(),
    "induction-motor/induction_motor": induction_motor(),
    "lee/lee": lee(),
    "ltaief/ltaief": ltaief(),
    "predator-prey/predator_prey": predator_prey(),
    "quadrotor/quadrotor": quadrotor(),
    "two-tanks/two_tanks": two_tanks(),
    "van-der-pol-pair/van_der_pol_pair": van_der_pol_pair(),
}


def traced(f: Callable[..., Any], states: Any = ("x",), **given: Any) -> ly.Model:
    """A model of one function, for tests."""
    h = given.pop("h", None)
    return ly.Model.from_function(f, h, states=states, **given)


def derivatives(model: ly.Model, x: Any, t: float = 0.0, u: Any = ()) -> np.ndarray[Any, Any]:
    """x' of a model at a point."""
    return model.functions().f(t, x, u)
