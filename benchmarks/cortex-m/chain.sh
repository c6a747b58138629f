#!/usr/bin/env bash
# Writes a plant of many states and its study, to see how the code grows: chain.sh N FAMILY FOLDER
# (FAMILY: triangular or ekf). The study is FOLDER/chain.toml.
set -euo pipefail
n=$1 family=$2 folder=$3
mkdir -p "$folder"
repeated() { for _ in $(seq 2 "$1"); do printf '%s, ' "$2"; done; echo "$2"; }

cat >"$folder/chain.mo" <<PLANT
model Chain "Tanks in a row, each draining into the one before"
  input Real u(min = 0, max = 2) "Inflow of the last";
  Real x[$n](each start = 1, each min = 0.1, each max = 5) "Levels";
  output Real y = x[1] "Level of the first";
equation
  for i in 1:$((n - 1)) loop
    der(x[i]) = x[i + 1] - x[i] - 0.1*x[i]^3;
  end for;
  der(x[$n]) = u - x[$n] - 0.1*x[$n]^3;
end Chain;
PLANT

{
    echo 'plant = "chain.mo"'
    echo '[sensors]'
    echo 'measured = ["y"]'
    echo 'noise = { y = 0.01 }'
    if [ "$family" = ekf ]; then
        echo '[process_noise]'
        echo 'x = 0.01'
    fi
    echo '[observer]'
    echo "family = \"$family\""
    if [ "$family" = triangular ]; then
        echo 'theta = 1.2'
        echo "S = [{ diag = [$(repeated "$n" 3)], off = [$(repeated $((n - 1)) -1)] }]"
    fi
    echo '[simulate]'
    echo 'until = 2'
    echo 'output_step = 0.02'
    echo 'inputs = { u = "1 + sin(time)" }'
    echo 'seed = 1'
} >"$folder/chain.toml"
