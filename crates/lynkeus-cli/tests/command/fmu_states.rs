//! Steps and states of a functional mock-up unit that no good tool asks for, and those that one does.

use crate::export::has;
use crate::fmu_calls::{compiled, ran, sources};
use crate::{Folder, skipped};

const TANK: &str = "model Vat
  Real x(start = 0);
  output Real y = x;
equation
  der(x) = 1;
end Vat;
";

const HEAD: &str = r#"
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
void *fmi3InstantiateCoSimulation(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *, size_t, void *, void *, void (*)(void));
int fmi3EnterInitializationMode(void *, bool, double, double, bool, double);
int fmi3ExitInitializationMode(void *);
int fmi3Reset(void *);
int fmi3GetFMUState(void *, void **);
int fmi3SetFMUState(void *, void *);
int fmi3FreeFMUState(void *, void **);
int fmi3SerializedFMUStateSize(void *, void *, size_t *);
int fmi3SerializeFMUState(void *, void *, uint8_t *, size_t);
int fmi3DeserializeFMUState(void *, const uint8_t *, size_t, void **);
int fmi3DoStep(void *, double, double, bool, bool *, bool *, bool *, double *);
int fmi3GetFloat64(void *, const uint32_t *, size_t, double *, size_t);
static bool a, b, c;
static double reached;
static void *at(double start)
{
    void *m = fmi3InstantiateCoSimulation("x", "TOKEN", 0, 0, 0, 0, 0, 0, 0, 0, 0, 0);
    fmi3EnterInitializationMode(m, 0, 0, start, 0, 0);
    fmi3ExitInitializationMode(m);
    return m;
}
static int step(void *m, double from, double length)
{
    return fmi3DoStep(m, from, length, 1, &a, &b, &c, &reached);
}
static double x(void *m)
{
    const uint32_t place = 1;
    double value = 0;
    fmi3GetFloat64(m, &place, 1, &value, 1);
    return value;
}
"#;

fn bench(main: &str) -> Option<String> {
    if !has("cc") {
        skipped("there is no C compiler");
        return None;
    }
    let folder = Folder::empty();
    let to = sources(&folder, "Vat", TANK, "3");
    let wrapper = folder.read(&format!("{to}/fmi3.c"));
    let token = wrapper.split("token[] = \"").nth(1).unwrap();
    let token = token.split('"').next().unwrap();
    folder.write("bench.c", &(HEAD.replace("TOKEN", token) + main));
    let files = [format!("{to}/vat_plant.c"), format!("{to}/fmi3.c")];
    let arguments = ["bench.c", &files[0], &files[1], "-lm", "-o", "bench"];
    compiled(folder.path.path(), &arguments);
    Some(ran(folder.path.path()))
}

/// At seconds since 1970 as at 0: what is left out, or done twice, is refused; tools that add up their
/// steps, or multiply them, go on.
#[test]
fn a_step_begins_where_the_last_one_ended() {
    let Some(told) = bench(
        r#"
int main(void)
{
    const double starts[] = {0, 1.7e9, -4e9};
    for (int i = 0; i < 3; i++) {
        const double start = starts[i];
        void *m = at(start);
        printf("%d", step(m, start, 1));
        printf(" %d", step(m, start + 3, 1));
        printf(" %d", step(m, start, 1));
        printf(" %d", step(m, start + 1.01, 0.1));
        printf(" %d", step(m, start + 1, 1));
        printf(" %.6f;", x(m));
        m = at(start);
        double t = start;
        int bad = 0;
        for (int k = 0; k < 20000; k++) {
            bad += step(m, t, 0.1) != 0;
            t += 0.1;
        }
        printf(" %d %.3f", bad, x(m));
        m = at(start);
        for (int k = 0; k < 20000; k++) {
            bad += step(m, start + 0.1 * k, 0.1) != 0;
        }
        printf(" %d %.3f\n", bad, x(m));
    }
    return 0;
}
"#,
    ) else {
        return;
    };
    for line in told.lines() {
        let (steps, tools) = line.split_once(';').unwrap();
        assert_eq!(steps, "0 3 3 3 0 2.000000", "{told}");
        let tools: Vec<f64> = tools
            .split_whitespace()
            .map(|n| n.parse().unwrap())
            .collect();
        assert_eq!((tools[0], tools[2]), (0.0, 0.0), "{told}");
        assert!(
            (tools[1] - 2000.0).abs() < 0.05 && (tools[3] - 2000.0).abs() < 0.05,
            "{told}"
        );
    }
    assert_eq!(told.lines().count(), 3);
}

/// Bytes that are no state, and no place for one.
#[test]
fn bytes_that_are_no_state_are_refused() {
    let Some(told) = bench(
        r#"
int main(void)
{
    void *m = at(0), *kept = 0, *other = 0;
    size_t n = 0;
    step(m, 0, 1);
    printf("%d %d", fmi3GetFMUState(m, NULL), fmi3SetFMUState(m, NULL));
    printf(" %d", fmi3GetFMUState(m, &kept));
    printf(" %d", fmi3SerializedFMUStateSize(m, kept, NULL));
    fmi3SerializedFMUStateSize(m, kept, &n);
    uint8_t *bytes = malloc(n);
    printf(" %d %d", fmi3SerializeFMUState(m, NULL, bytes, n), fmi3SerializeFMUState(m, kept, NULL, n));
    printf(" %d", fmi3SerializeFMUState(m, kept, bytes, n));
    printf(" %d %d", fmi3DeserializeFMUState(m, NULL, n, &other), fmi3DeserializeFMUState(m, bytes, n, NULL));
    printf(" %d;", fmi3FreeFMUState(m, NULL));
    int taken = 0;
    for (size_t i = 0; i < n; i++) {
        bytes[i] ^= 4;
        taken += fmi3DeserializeFMUState(m, bytes, n, &other) == 0;
        bytes[i] ^= 4;
    }
    uint8_t *zeros = malloc(n);
    memcpy(zeros, bytes, 36);
    memset(zeros + 36, 0, n - 36);
    printf(" %d %d", taken, fmi3DeserializeFMUState(m, zeros, n, &other));
    step(m, 1, 1);
    printf(" %.1f", x(m));
    printf(" %d", fmi3DeserializeFMUState(m, bytes, n, &other));
    printf(" %d", fmi3SetFMUState(m, other));
    printf(" %.1f", x(m));
    printf(" %d", step(m, 1, 1));
    printf(" %.1f", x(m));
    printf(" %d\n", fmi3Reset(m));
    return 0;
}
"#,
    ) else {
        return;
    };
    assert_eq!(told, "3 3 0 3 3 3 0 3 3 0; 0 3 2.0 0 0 1.0 0 2.0 0\n");
}
