"""Flattens and simulates a model of parts with the independent compiler `rumoca`.

usage: rumoca_flattened.py SOURCE.mo MODEL RENDERING STEP COUNT [INPUT=VALUE ...]

Prints what the compiler writes as RENDERING, a line `====`, and the CSV of rumoca_crosscheck.py.
The inputs are held by a model that holds the plant as its only part.
"""

import sys
from pathlib import Path

import rumoca


def main() -> None:
    path, model, rendering, step, count, *inputs = sys.argv[1:]
    source = Path(path).read_text(encoding="utf-8")
    print(rumoca.Session().loads(source, model=model).render(rendering).strip())
    print("====")

    held = f"{source}\nmodel Held {model} plant({', '.join(inputs)}); end Held;\n"
    config = rumoca.SimConfig(solver="bdf", rtol=1e-11, atol=1e-13, dt=float(step), max_wall_seconds=60)
    result = rumoca.Session().loads(held, model="Held").simulate(t=(0.0, float(step) * int(count)), config=config)
    names = [name for name in result.names if name.startswith("plant.")]
    columns = [[float(value) for value in result.time]]
    columns += [[float(value) for value in result[name]] for name in names]
    print(";".join(["t", *(name.removeprefix("plant.") for name in names)]))
    for row in zip(*columns):
        print(";".join(repr(value) for value in row))


if __name__ == "__main__":
    main()
