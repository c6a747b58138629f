#!/usr/bin/env bash
# Exported estimators on Cortex-M4F and M7 under qemu: equality with the host, instructions, memory.
# Prints the tables of docs/export.md ("On microcontrollers"). Usage: run.sh [FOLDER]
# On Debian: apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm
#   LYNKEUS  the command (target/release/lynkeus, else target/debug/lynkeus)
#   OPTIMISE options of the compilers (-O2)
# A tool that is missing ends it with a line that starts with "skipped:".
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
out=${1:-$root/target/cortex-m}
optimise=${OPTIMISE:--O2}
common="-std=c99 $optimise -ffp-contract=off -ffunction-sections -fdata-sections"
cross=arm-none-eabi-gcc
rows=100

for tool in "$cross" arm-none-eabi-size qemu-system-arm cc awk; do
    command -v "$tool" >/dev/null || { echo "skipped: the estimators on Cortex-M: no $tool"; exit 0; }
done
lynkeus=${LYNKEUS:-}
for built in "$root"/target/release/lynkeus "$root"/target/debug/lynkeus; do
    [ -n "$lynkeus" ] || { [ -x "$built" ] && lynkeus=$built; } || true
done
[ -x "$lynkeus" ] || { echo "skipped: the estimators on Cortex-M: no lynkeus; cargo build --release"; exit 0; }

m4="-mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16"
m7="-mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-d16"

# The log of a study as arrays of C: case_header FOLDER NAME REAL STEP LOG
case_header() {
    awk -v name="$2" -v real="$3" -v step="$4" -v most="$rows" -v log_file="$5" '
        function number(cell) { return cell == "" ? "(REAL)NAN" : "(REAL)" (cell ~ /[.eE]/ ? cell : cell ".0") }
        BEGIN {
            capitals = toupper(name)
            printf "#include \"%s.h\"\n#include <math.h>\n", name
            printf "#define STATE %s_state\n#define INIT %s_init\n#define PUSH %s_push\n", name, name, name
            printf "#define SIGNALS %s_SIGNALS\n#define ESTIMATES %s_ESTIMATES\n", capitals, capitals
            printf "#define REAL %s\n#define STEP %s\n", real, step
        }
        FILENAME != log_file && /_signal_names\[/ { inside = 1; next }
        FILENAME != log_file && /^};/ { inside = 0 }
        FILENAME != log_file { if (inside) { gsub(/[ ",]/, ""); wanted[++signal_count] = $0 }; next }
        FNR == 1 { FS = ","; $0 = $0; for (i = 1; i <= NF; i++) place[$i] = i; next }
        FNR <= most + 1 {
            count++
            times = times $1 ", "
            line = ""
            for (i = 1; i <= signal_count; i++) line = line (i > 1 ? ", " : "") number($(place[wanted[i]]))
            samples = samples "    {" line "},\n"
        }
        END {
            printf "enum { ROWS = %d };\n", count
            printf "__attribute__((unused)) static const double times[ROWS] = {%s};\n", times
            printf "__attribute__((unused)) static const REAL signals[ROWS][SIGNALS] = {\n%s};\n", samples
        }' "$1/$2.c" "$5" >"$1/case.h"
}

figure() { awk -v name="$2" '$1 == name { print $2 }' "$1"; }

# One estimator on one machine: measure FOLDER NAME MACHINE FLAGS
measure() {
    local dir=$1 name=$2 machine=$3 flags=$4 image=$1/$3
    # shellcheck disable=SC2086
    $cross $common $flags -Wdouble-promotion -c "$dir/$name.c" -o "$image.o"
    # shellcheck disable=SC2086
    for program in bench minimal; do
        $cross $common $flags -I"$dir" "$here/$program.c" "$here/device.c" "$image.o" -o "$image-$program.elf" \
            -nostartfiles -T "$here/mps2.ld" -Wl,--gc-sections -lm
    done
    qemu-system-arm -M "$machine" -nographic -monitor none -serial none -icount shift=7 \
        -semihosting-config enable=on,target=native -kernel "$image-bench.elf" >"$image.txt" 2>&1
    if [ "$(figure "$image.txt" expected)" -gt "$(figure "$image.txt" counted)" ] ||
        [ "$(($(figure "$image.txt" counted) - $(figure "$image.txt" expected)))" -gt 20 ]; then
        echo "$image.txt: the counter of instructions is wrong" >&2
        exit 1
    fi
    [ "$(figure "$image.txt" code)" = 0 ] || { echo "$image.txt: a sample was refused" >&2; exit 1; }
}

# Bytes of code and constants of an object, its lists of names included.
own_size() { arm-none-eabi-size -A "$1" | awk '/^\.(text|rodata)/ { sum += $2 } END { print sum }'; }

# The row of a table: row WORDS FOLDER MACHINE MOST. MOST is the largest difference from the host that passes.
row() {
    local dir=$2 image=$2/$3
    local own whole differs
    differs=$("$out/compare" "$image.txt" "$dir/host.txt")
    awk -v d="$differs" -v most="$4" 'BEGIN { exit !(d <= most) }' || { echo "$1: $differs from the host" >&2; exit 1; }
    own=$(own_size "$image.o")
    whole=$(arm-none-eabi-size "$image-minimal.elf" | awk 'NR == 2 { print $1 + $2 }')
    echo "| $1 | $(figure "$image.txt" push) | $(figure "$image.txt" step) | $own | $whole | $(figure "$image.txt" state) | $(figure "$image.txt" stack) | $differs |"
}

mkdir -p "$out"
cc -std=c99 -O2 "$here/compare.c" -o "$out/compare" -lm
$cross --version | head -1
qemu-system-arm --version | head -1
echo "options: $common; M4F: $m4; M7: $m7"
echo
echo "| | instructions a sample | a step | flash, bytes | with libraries | state, bytes | stack, bytes | from the host |"
echo "|---|---|---|---|---|---|---|---|"

# estimator NAME STUDY STEP LOG ("-": simulated)
estimator() {
    local name=$1 study=$2 step=$3 log=$4 precision real most dir
    if [ "$log" = - ]; then
        log=$out/$name.csv
        "$lynkeus" simulate -q "$study" --log "$log" -o "$out/$name-run.csv" >"$out/$name-run.txt" 2>&1
    fi
    for precision in f32 f64; do
        real=$([ $precision = f32 ] && echo float || echo double)
        most=$([ $precision = f32 ] && echo 1e-5 || echo 1e-12)
        dir=$out/$name-$precision
        "$lynkeus" export -q "$study" --to c --force --step "$step" --precision "$precision" -o "$dir" >"$dir.txt" 2>&1
        case_header "$dir" "$name" "$real" "$step" "$log"
        # shellcheck disable=SC2086
        cc $common -I"$dir" "$here/bench.c" "$here/host.c" "$dir/$name.c" -o "$dir/host" -lm
        "$dir/host" >"$dir/host.txt"
        measure "$dir" "$name" mps2-an386 "$m4"
        measure "$dir" "$name" mps2-an500 "$m7"
        row "$name, M4F, $precision" "$dir" mps2-an386 "$most"
        row "$name, M7, $precision" "$dir" mps2-an500 "$most"
    done
}

estimator twotanks "$root/examples/two-tanks/study.toml" 0.25 "$root/examples/two-tanks/log.csv"
estimator lee "$root/examples/lee/study.toml" 0.01 -
estimator column "$root/examples/column/study.toml" 0.01 -
estimator drive "$here/studies/drive.toml" 0.01 -

# One as large as what is often written by hand: 8 states.
"$here/chain.sh" 8 triangular "$out/chain8"
estimator chain "$out/chain8/chain.toml" 0.02 -

echo
echo "| states of a chain | triangular: flash, bytes | for each state more | ekf: flash, bytes | for each state more |"
echo "|---|---|---|---|---|"

# Flash of a chain's estimator on the M7 in f64: size N FAMILY
size() {
    local dir=$out/chain$1-$2
    "$here/chain.sh" "$1" "$2" "$dir"
    "$lynkeus" export -q "$dir/chain.toml" --to c --force --step 0.02 -o "$dir/c" >"$dir.txt" 2>&1
    # shellcheck disable=SC2086
    $cross $common $m7 -c "$dir/c/chain.c" -o "$dir/chain.o"
    own_size "$dir/chain.o"
}

before=
for n in 10 20 40; do
    line="| $n |"
    now="$n"
    for family in triangular ekf; do
        bytes=$(size "$n" "$family")
        now="$now $bytes"
        line="$line $bytes | $(echo "$before $n $bytes $family" | awk 'NF < 6 { print "" } NF == 6 { k = $NF == "ekf" ? 3 : 2; printf "%d", ($5 - $k) / ($4 - $1) }') |"
    done
    before=$now
    echo "$line"
done
