//! Calls into a functional mock-up unit, as a tool makes them: which it takes when, and what it tells.

use std::path::Path;
use std::process::Command;

use crate::export::has;
use crate::fmu::unpacked;
use crate::{Folder, skipped};

const VAT: &str = "model Vat
  input Real q(start = 1);
  output Real h(start = 4, min = 0);
equation
  der(h) = q - sqrt(h);
end Vat;
";

/// The sources of a model's plant, in a folder of their own.
pub(super) fn sources(folder: &Folder, model: &str, text: &str, version: &str) -> String {
    let to = format!("{model}{version}");
    folder.write(&format!("{model}.mo"), &text.replace("Vat", model));
    let file = format!("{model}.mo");
    let made = folder.run(&["export", &file, "--to", "fmu", "--fmi", version, "-o", &to]);
    assert_eq!(made.code, 0, "{}", made.err);
    let name = model.to_lowercase();
    let archive = folder
        .path
        .path()
        .join(&to)
        .join(format!("{name}_plant.fmu"));
    for (file, content) in unpacked(&std::fs::read(archive).unwrap()) {
        if let Some(file) = file.strip_prefix("sources/") {
            std::fs::write(folder.path.path().join(&to).join(file), content).unwrap();
        }
    }
    to
}

pub(super) fn compiled(folder: &Path, arguments: &[&str]) {
    let mut command = Command::new("cc");
    command.args([
        "-std=c99",
        "-O1",
        "-Wall",
        "-Wextra",
        "-Wpedantic",
        "-Werror",
    ]);
    let ended = command
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success(), "{arguments:?}: {told}");
}

pub(super) fn ran(folder: &Path) -> String {
    let ran = Command::new(folder.join("bench"))
        .current_dir(folder)
        .output();
    let ran = ran.unwrap();
    assert!(ran.status.success());
    String::from_utf8(ran.stdout).unwrap()
}

/// Two of them in one program: their functions have the prefixes that the standard foresees.
#[test]
fn sources_can_be_linked_together() {
    if !has("cc") {
        return skipped("there is no C compiler");
    }
    let folder = Folder::empty();
    for version in ["2", "3"] {
        let mut objects = vec![];
        for model in ["Vat", "Tub"] {
            let to = sources(&folder, model, VAT, version);
            let name = format!("{}_plant", model.to_lowercase());
            let define = format!("-DFMI{version}_FUNCTION_PREFIX={name}_");
            for source in [format!("{name}.c"), format!("fmi{version}.c")] {
                let object = format!("{to}{source}.o");
                let source = format!("{to}/{source}");
                compiled(folder.path.path(), &[&define, "-c", &source, "-o", &object]);
                objects.push(object);
            }
        }
        folder.write(
            "bench.c",
            &format!(
                "#include <stdio.h>\nconst char *vat_plant_fmi{version}GetVersion(void);\nconst char *tub_plant_fmi{version}GetVersion(void);\nint main(void)\n{{\n    return puts(vat_plant_fmi{version}GetVersion()) < 0 || puts(tub_plant_fmi{version}GetVersion()) < 0;\n}}\n"
            ),
        );
        let objects: Vec<&str> = objects.iter().map(String::as_str).collect();
        let arguments = [&["bench.c"], &objects[..], &["-lm", "-o", "bench"]].concat();
        compiled(folder.path.path(), &arguments);
        assert_eq!(
            ran(folder.path.path()),
            format!("{version}.0\n{version}.0\n")
        );
        // a tool that makes a library of them overrides that
        let overridden = [
            format!("-DFMI{version}_FUNCTION_PREFIX="),
            format!("-DFMI{version}_OVERRIDE_FUNCTION_PREFIX"),
            format!("-DBENCH=fmi{version}GetVersion"),
        ];
        folder.write(
            "bench.c",
            "const char *BENCH(void);\nint main(void)\n{\n    return BENCH() == 0;\n}\n",
        );
        let [first, second, third] = overridden.each_ref().map(String::as_str);
        let files = [
            format!("Vat{version}/vat_plant.c"),
            format!("Vat{version}/fmi{version}.c"),
        ];
        let [equations, wrapper] = files.each_ref().map(String::as_str);
        compiled(
            folder.path.path(),
            &[
                first, second, third, "bench.c", equations, wrapper, "-lm", "-o", "bench",
            ],
        );
        assert_eq!(ran(folder.path.path()), "");
    }
}

/// What is the same in both versions: what is called, and the status that it has to give.
const CALLS: &str = r#"
static int failures;
static const double zero = 0.0;

static void expect(const char *what, int status, int wanted)
{
    if (status != wanted) {
        failures++;
        printf("%s: %d, not %d\n", what, status, wanted);
    }
}

enum { OK = 0, DISCARD = 2, ERROR = 3, H = 2, DER_H = 3, Q = 1 };

int main(void)
{
    double x[1] = {9.0};
    double seed = 1.0;
    double slope = 7.0;
    void *kept = NULL;
    void *none = NULL;
    void *m = make(0);
    void *tool = make(1);
    expect("no instance", step(NULL, 0.0), ERROR);
    expect("a step before", step(m, 0.0), ERROR);
    expect("states before", states(m, x), ERROR);
    expect("derivatives before", derivatives(m, x), ERROR);
    expect("along before", along(m, H, &seed, &slope), ERROR);
    expect("the end before", leave(m), ERROR);
    expect("a start", set(m, H, 1.0), OK);
    expect("an input", set(m, Q, 2.0), OK);
    expect("time", set(m, 0, 2.0), ERROR);
    expect("a derivative", set(m, DER_H, 2.0), ERROR);
    expect("initialization", begin(m), OK);
    expect("initialization again", begin(m), ERROR);
    expect("a step in between", step(m, 0.0), ERROR);
    expect("states in between", states(m, x), OK);
    expect("a start in between", set(m, H, 4.0), OK);
    expect("its end", leave(m), OK);
    expect("its end again", leave(m), ERROR);
    expect("a start too late", set(m, H, 1.0), ERROR);
    expect("derivatives", derivatives(m, x), OK);
    expect("the value", x[0] == 0.0, 1);
    expect("a step", step(m, 0.0), OK);
    expect("the state", keep(m, &kept), OK);
    expect("a step from elsewhere", step(m, 0.5), ERROR);
    expect("a step from nowhere", step(m, 0.0 / zero), ERROR);
    expect("a step from about there", step(m, 1.0 + 4e-16), OK);
    expect("the tool's states", put(m, x), ERROR);
    expect("the tool's time", put_time(m, 5.0), ERROR);
    expect("a list with what cannot be set", set_both(m, Q, DER_H, 7.0), ERROR);
    expect("the input as it was", get(m, Q) == 2.0, 1);
    expect("a state of nobody", release(m, NULL), OK);
    expect("no state", release(m, &none), OK);
    expect("model exchange", begin(tool), OK);
    expect("its initialization", leave(tool), OK);
    expect("a step of its own", step(tool, 0.0), ERROR);
    expect("its time", put_time(tool, 5.0), OK);
    puts("--");
    m = tool;
    /* an empty vat: the level's slope is infinite, but not that by the input */
    x[0] = 0.0;
    expect("an empty vat", put(m, x), OK);
    expect("along the level", along(m, H, &seed, &slope), DISCARD);
    expect("along the input", along(m, Q, &seed, &slope), OK);
    expect("the slope", slope == 1.0, 1);
    puts("--");
    expect("more words", talk(m, 1), OK);
    expect("along the level, told", along(m, H, &seed, &slope), DISCARD);
    expect("fewer words", talk(m, 0), OK);
    expect("along the level, not told", along(m, H, &seed, &slope), DISCARD);
    puts("--");
    expect("the end", finish(m), OK);
    expect("an input after that", set(m, Q, 1.0), ERROR);
    expect("states after that", states(m, x), OK);
    expect("anew as kept", restore(m, kept), OK);
    expect("the kept input", get(m, Q) == 2.0, 1);
    expect("anew", reset(m), OK);
    expect("anew from the start", begin(m), OK);
    return failures;
}
"#;

const TWO: &str = r#"
static void logged(void *e, fmi2String name, fmi2Status status, fmi2String category, fmi2String message, ...)
{
    (void)e, (void)message;
    printf("%s %d %s\n", name, (int)status, category);
}

static const callbacks calls = {logged, calloc, free, NULL, NULL};

static void *make(int is_exchange)
{
    const fmi2Type type = is_exchange ? fmi2ModelExchange : fmi2CoSimulation;
    return fmi2Instantiate("vat", type, token, "", &calls, 0, 0);
}
static int step(void *m, double t) { return fmi2DoStep(m, t, 1.0, 0); }
static int states(void *m, double *x) { return fmi2GetContinuousStates(m, x, 1); }
static int put(void *m, const double *x) { return fmi2SetContinuousStates(m, x, 1); }
static int derivatives(void *m, double *x) { return fmi2GetDerivatives(m, x, 1); }
static int set(void *m, unsigned k, double value) { return fmi2SetReal(m, &k, 1, &value); }
static int begin_(void *m)
{
    const fmi2Status status = fmi2SetupExperiment(m, 0, 0.0, 0.0, 0, 0.0);
    return (int)(status == fmi2OK ? fmi2EnterInitializationMode(m) : status);
}
static int leave(void *m) { return fmi2ExitInitializationMode(m); }
static int finish(void *m) { return fmi2Terminate(m); }
static int reset(void *m) { return fmi2Reset(m); }
static int keep_(void *m, void **kept) { return fmi2GetFMUstate(m, kept); }
static int restore(void *m, void *kept) { return fmi2SetFMUstate(m, kept); }
static int along(void *m, unsigned k, const double *seed, double *slope)
{
    const unsigned der_h = 3;
    return fmi2GetDirectionalDerivative(m, &der_h, 1, &k, 1, seed, slope);
}
static int put_time(void *m, double t) { return fmi2SetTime(m, t); }
static int set_both(void *m, unsigned a, unsigned b, double value)
{
    const unsigned references[] = {a, b};
    const double values[] = {value, value};
    return fmi2SetReal(m, references, 2, values);
}
static double get(void *m, unsigned k)
{
    double value = -1.0;
    fmi2GetReal(m, &k, 1, &value);
    return value;
}
static int release(void *m, void **kept) { return fmi2FreeFMUstate(m, kept); }
static int talk(void *m, int on) { return fmi2SetDebugLogging(m, on, 0, NULL); }
"#;

const THREE: &str = r#"
static void logged(void *e, fmi3Status status, fmi3String category, fmi3String message)
{
    (void)e, (void)message;
    printf("vat %d %s\n", (int)status, category);
}

static void *make(int is_exchange)
{
    if (is_exchange) {
        return fmi3InstantiateModelExchange("vat", token, "", 0, 0, NULL, logged);
    }
    return fmi3InstantiateCoSimulation("vat", token, "", 0, 0, 0, 0, NULL, 0, NULL, logged, NULL);
}
static int step(void *m, double t)
{
    bool flags[3];
    double reached;
    return fmi3DoStep(m, t, 1.0, 0, &flags[0], &flags[1], &flags[2], &reached);
}
static int states(void *m, double *x) { return fmi3GetContinuousStates(m, x, 1); }
static int put(void *m, const double *x) { return fmi3SetContinuousStates(m, x, 1); }
static int derivatives(void *m, double *x) { return fmi3GetContinuousStateDerivatives(m, x, 1); }
static int set(void *m, unsigned k, double value) { return fmi3SetFloat64(m, &k, 1, &value, 1); }
static int begin_(void *m) { return fmi3EnterInitializationMode(m, 0, 0.0, 0.0, 0, 0.0); }
static int leave(void *m) { return fmi3ExitInitializationMode(m); }
static int finish(void *m) { return fmi3Terminate(m); }
static int reset(void *m) { return fmi3Reset(m); }
static int keep_(void *m, void **kept) { return fmi3GetFMUState(m, kept); }
static int restore(void *m, void *kept) { return fmi3SetFMUState(m, kept); }
static int along(void *m, unsigned k, const double *seed, double *slope)
{
    const unsigned der_h = 3;
    return fmi3GetDirectionalDerivative(m, &der_h, 1, &k, 1, seed, 1, slope, 1);
}
static int put_time(void *m, double t) { return fmi3SetTime(m, t); }
static int set_both(void *m, unsigned a, unsigned b, double value)
{
    const unsigned references[] = {a, b};
    const double values[] = {value, value};
    return fmi3SetFloat64(m, references, 2, values, 2);
}
static double get(void *m, unsigned k)
{
    double value = -1.0;
    fmi3GetFloat64(m, &k, 1, &value, 1);
    return value;
}
static int release(void *m, void **kept) { return fmi3FreeFMUState(m, kept); }
static int talk(void *m, int on)
{
    const char *categories[] = {"logStatusDiscard"};
    return fmi3SetDebugLogging(m, on, 1, categories);
}
"#;

#[test]
fn calls_have_their_modes_and_what_is_no_error_is_told_on_demand() {
    if !has("cc") {
        return skipped("there is no C compiler");
    }
    let folder = Folder::empty();
    for (version, own) in [("2", TWO), ("3", THREE)] {
        let to = sources(&folder, "Vat", VAT, version);
        let path = folder.path.path().join(to);
        // its functions that are called like those of the wrapper stand behind it
        let calls = CALLS
            .replace(" begin(", " begin_(")
            .replace(" keep(", " keep_(")
            .replace(" step(", " step_(");
        let own = own.replace(" step(", " step_(");
        let bench = format!("#include <stdio.h>\n#include \"fmi{version}.c\"\n{own}{calls}");
        std::fs::write(path.join("bench.c"), bench).unwrap();
        compiled(&path, &["bench.c", "vat_plant.c", "-lm", "-o", "bench"]);
        let told = ran(&path);
        let parts: Vec<&str> = told.split("--\n").collect();
        // each refusal with its message, but for what has no instance
        assert_eq!(parts[0], "vat 3 logStatusError\n".repeat(17), "{told}");
        assert_eq!(parts[1], "", "{told}");
        assert_eq!(parts[2], "vat 2 logStatusDiscard\n", "{told}");
        assert_eq!(parts[3], "vat 3 logStatusError\n", "{told}");
    }
}
