//! `export --to fmu`: what is in the archive, and that compilers take it. What it computes is looked at with
//! FMPy, in `python/tests/test_fmu.py`.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::{Ended, Folder, skipped};

const FILTER: &str = r#"
plant = "two_tanks.mo"
[sensors]
measured = ["level"]
noise = { level = 0.02 }
[process_noise]
upper = 1e-5
lower = 1e-5
[observer]
family = "ekf"
[estimate]
method = "rk4"
substeps = 4
sd = true
"#;

/// Files by name, read from the central directory on.
pub(super) fn unpacked(archive: &[u8]) -> BTreeMap<String, Vec<u8>> {
    let two = |at: usize| usize::from(u16::from_le_bytes(archive[at..at + 2].try_into().unwrap()));
    let four = |at: usize| u32::from_le_bytes(archive[at..at + 4].try_into().unwrap()) as usize;
    let end = archive.len() - 22;
    assert_eq!(&archive[end..end + 4], b"PK\x05\x06");
    let mut at = four(end + 16);
    let mut files = BTreeMap::new();
    for _ in 0..two(end + 10) {
        assert_eq!(&archive[at..at + 4], b"PK\x01\x02");
        assert_eq!((two(at + 10), four(at + 20)), (0, four(at + 24)), "stored");
        let name = &archive[at + 46..at + 46 + two(at + 28)];
        let local = four(at + 42);
        assert_eq!(&archive[local..local + 4], b"PK\x03\x04");
        let content = local + 30 + two(local + 26) + two(local + 28);
        files.insert(
            String::from_utf8(name.to_vec()).unwrap(),
            archive[content..content + four(at + 20)].to_vec(),
        );
        at += 46 + two(at + 28) + two(at + 30) + two(at + 32);
    }
    assert_eq!(at, end);
    files
}

fn export(folder: &Folder, study: &str, to: &str, more: &[&str]) -> BTreeMap<String, Vec<u8>> {
    let arguments = [&["export", study, "--to", "fmu", "-o", to], more].concat();
    let made = folder.run(&arguments);
    assert_eq!(made.code, 0, "{}", made.err);
    unpacked(&std::fs::read(folder.path.path().join(to).join("twotanks.fmu")).unwrap())
}

pub(super) fn text(files: &BTreeMap<String, Vec<u8>>, name: &str) -> String {
    String::from_utf8(files[name].clone()).unwrap()
}

/// The variables with what each says, in the order of their value references.
pub(super) fn variables(description: &str) -> Vec<(String, String)> {
    let lines = description.split("<ModelVariables>").nth(1).unwrap();
    let lines = lines.split("</ModelVariables>").next().unwrap();
    let named = lines.split(" name=\"").skip(1).enumerate();
    let each = named.map(|(place, rest)| {
        assert!(
            rest.contains(&format!("valueReference=\"{place}\"")),
            "{rest}"
        );
        let (name, rest) = rest.split_once('"').unwrap();
        (name.to_owned(), rest.to_owned())
    });
    each.collect()
}

#[test]
fn an_archive_says_what_is_in_it() {
    let folder = Folder::new();
    folder.write("filter.toml", FILTER);
    for (version, named) in [("3", "fmi3"), ("2", "fmi2")] {
        let files = export(&folder, "filter.toml", version, &["--fmi", version]);
        let description = text(&files, "modelDescription.xml");
        assert!(
            !description.contains("logStatusDiscard"),
            "nothing is tried"
        );
        assert!(description.contains(&format!("fmiVersion=\"{version}.0\"")));
        assert!(description.contains("<CoSimulation modelIdentifier=\"twotanks\""));
        let variables = variables(&description);
        let expected = [
            ("time", "independent", ""),
            ("level", "input", "start=\"NaN\""),
            ("pump", "input", "start=\"2.0\""),
            ("upper_hat", "output", "unit=\"V\""),
            ("lower_hat", "output", "unit=\"V\""),
            ("upper_sd", "output", "relativeQuantity=\"true\""),
            ("lower_sd", "output", "relativeQuantity=\"true\""),
            ("upper_start", "parameter", "start=\"3.99\""),
            ("lower_start", "parameter", "start=\"5.2\""),
            (
                "process_noise_scale",
                "parameter",
                "variability=\"tunable\"",
            ),
        ];
        assert_eq!(variables.len(), expected.len(), "{description}");
        for ((name, told), (wanted, causality, part)) in variables.iter().zip(expected) {
            assert_eq!(name, wanted);
            assert!(
                told.contains(&format!("causality=\"{causality}\"")),
                "{told}"
            );
            assert!(told.contains(part), "{name}: {told}");
        }
        let page = text(&files, "documentation/index.html");
        assert!(page.contains("4 steps from sample to sample"), "{page}");
        // volts in base units
        assert!(description.contains("<BaseUnit kg=\"1\" m=\"2\" s=\"-3\" A=\"-1\"/>"));
        let token = description.split("oken=\"").nth(1);
        let token = token
            .or_else(|| description.split("guid=\"").nth(1))
            .unwrap();
        let token = &token[..36];
        let wrapper = text(&files, &format!("sources/{named}.c"));
        assert!(wrapper.contains(token), "{token}");
        assert!(!wrapper.contains('@'), "every place is filled");
        assert_eq!(
            files.contains_key("sources/buildDescription.xml"),
            version == "3"
        );
        // the same study, the same archive, but for the library, which is the compiler's
        let again = export(
            &folder,
            "filter.toml",
            &format!("{version}b"),
            &["--fmi", version],
        );
        for (name, content) in &files {
            let is_same = again.get(name) == Some(content);
            assert!(is_same || name.starts_with("binaries/"), "{name}");
        }
    }
}

#[test]
fn compilers_take_the_sources_without_a_warning() {
    let compilers = ["gcc", "clang"].into_iter().filter(|compiler| {
        let mut asked = Command::new(compiler);
        let asked = asked.arg("--version").stdout(Stdio::null()).status();
        asked.is_ok_and(|status| status.success())
    });
    let compilers: Vec<&str> = compilers.collect();
    if compilers.is_empty() {
        return skipped("neither gcc nor clang is there");
    }
    let folder = Folder::new();
    folder.write("filter.toml", FILTER);
    for (study, version, precision) in [
        ("study.toml", "3", "f64"),
        ("filter.toml", "2", "f64"),
        ("filter.toml", "3", "f32"),
    ] {
        let to = format!("{version}{precision}");
        let files = export(
            &folder,
            study,
            &to,
            &["--fmi", version, "--precision", precision],
        );
        let sources = folder.path.path().join(&to);
        for (name, content) in &files {
            if let Some(file) = name.strip_prefix("sources/") {
                std::fs::write(sources.join(file), content).unwrap();
            }
        }
        for compiler in &compilers {
            compiled(compiler, &sources, version);
        }
        let mut names = files.keys();
        assert!(names.any(|name| name.starts_with("binaries/")));
    }
}

fn compiled(compiler: &str, folder: &Path, version: &str) {
    let mut command = Command::new(compiler);
    command.args([
        "-std=c99",
        "-O1",
        "-Wall",
        "-Wextra",
        "-Wpedantic",
        "-Wdouble-promotion",
        "-Werror",
    ]);
    command.args(["-shared", "-fPIC", "-o", "made.so", "twotanks.c"]);
    command.arg(format!("fmi{version}.c")).arg("-lm");
    let ended = command.current_dir(folder).output().unwrap();
    let told = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success(), "{compiler}: {told}");
}

#[test]
fn without_a_compiler_there_are_sources_and_a_word() {
    let folder = Folder::new();
    let output = Command::new(env!("CARGO_BIN_EXE_lynkeus"))
        .args(["export", "study.toml", "--to", "fmu", "-o", "out"])
        .current_dir(folder.path.path())
        .env("PATH", folder.path.path())
        .output()
        .unwrap();
    let made = Ended::new(&output);
    assert_eq!(made.code, 0, "{}", made.err);
    assert!(
        made.err
            .contains("no C compiler was found (cc, gcc, clang)"),
        "{}",
        made.err
    );
    let archive = std::fs::read(folder.path.path().join("out/twotanks.fmu")).unwrap();
    let files = unpacked(&archive);
    assert!(files.contains_key("sources/fmi3.c"));
    assert!(!files.keys().any(|name| name.starts_with("binaries/")));
}

/// A compiler that writes more than a pipe holds, and takes nothing.
#[cfg(unix)]
#[test]
fn a_compiler_that_refuses_is_named_with_its_errors() {
    use std::os::unix::fs::PermissionsExt;

    let folder = Folder::new();
    let path = folder.path.path();
    folder.write(
        "cc",
        "#!/bin/sh\nk=0\nwhile [ $k -lt 3000 ]; do echo \"fmi3.c:$k:1: warning: so it goes on and on\" >&2; k=$((k + 1)); done\nexit 1\n",
    );
    let executable = std::fs::Permissions::from_mode(0o755);
    std::fs::set_permissions(path.join("cc"), executable).unwrap();
    let exported = |to: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_lynkeus"))
            .args(["export", "study.toml", "--to", "fmu", "-o", to])
            .current_dir(path)
            .env("PATH", path)
            .output();
        let made = Ended::new(&output.unwrap());
        assert_eq!(made.code, 0, "{}", made.err);
        let archive = path.join(to).join("twotanks.fmu");
        let files = unpacked(&std::fs::read(archive).unwrap());
        assert!(files.contains_key("sources/fmi3.c"));
        assert!(!files.keys().any(|name| name.starts_with("binaries/")));
        made.err
    };
    let told = exported("first");
    assert!(told.contains("sources only"), "{told}");
    assert!(
        told.contains("cc (exit status: 1) does not compile them: fmi3.c:0:1"),
        "{told}"
    );
    folder.change("cc", "on and on", "error: no");
    let told = exported("second");
    assert!(
        told.contains("does not compile them: fmi3.c:0:1: warning: so it goes error: no; "),
        "{told}"
    );
    assert!(
        !told.contains("no C compiler") && !told.contains("export again"),
        "{told}"
    );
}

#[test]
fn what_cannot_be_exported_leaves_nothing() {
    let folder = Folder::new();
    folder.write("mhe.toml", &FILTER.replace("\"ekf\"", "\"mhe\""));
    let made = folder.run(&["export", "mhe.toml", "--to", "fmu", "-o", "out"]);
    assert_eq!(made.code, 1, "{}", made.err);
    assert!(made.err.contains("moving horizon"), "{}", made.err);
    assert!(!folder.path.path().join("out").exists());
}
