"""Simulates a Modelica model with the independent compiler `rumoca`.

usage: rumoca_crosscheck.py FILE.mo MODEL STEP COUNT [INPUT=VALUE ...]

Every input is held at its value; an array as `u={1,2}`. rumoca does not drive top-level
inputs, so each `input Real u(...)` is simulated as `parameter Real u(...) = VALUE`; the file
as it stands must compile too. Prints CSV: `t`, then every variable, at 0, STEP, 2*STEP, ...
"""

import re
import sys
from pathlib import Path

import rumoca


def hold_inputs(source: str, values: dict[str, str]) -> str:
    """The text with the inputs as parameters."""
    for name, value in values.items():
        head = rf"\binput(\s+Real\s+{re.escape(name)}\b(?:\s*\[[^\]]*\])?(?:\s*\([^;]*?\))?)"
        source, count = re.subn(head + r'(?=\s*[";])', rf"parameter\g<1> = {value}", source)
        if count != 1:
            sys.exit(f"found {count} declarations `input Real {name}`, expected 1")
    return source


def main() -> None:
    path, model, step, count, *inputs = sys.argv[1:]
    source = Path(path).read_text(encoding="utf-8")
    errors = [str(found) for found in rumoca.validate_source(source) if found.level == "error"]
    if errors:
        sys.exit("\n".join(errors))
    rumoca.Session().loads(source, model=model)

    held = hold_inputs(source, dict(item.split("=", 1) for item in inputs))
    config = rumoca.SimConfig(solver="bdf", rtol=1e-11, atol=1e-13, dt=float(step), max_wall_seconds=60)
    compiled = rumoca.Session().loads(held, model=model)
    result = compiled.simulate(t=(0.0, float(step) * int(count)), config=config)

    names = [name for name in result.names if not name.startswith("$")]
    columns = [[float(value) for value in result.time]]
    columns += [[float(value) for value in result[name]] for name in names]
    print(";".join(["t", *names]))
    for row in zip(*columns):
        print(";".join(repr(value) for value in row))


if __name__ == "__main__":
    main()
