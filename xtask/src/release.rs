//! What a release is made of, made and tried as users have it: packages, a wheel, a static program, licences and known
//! holes, a bill of materials, the workflow, what shells and manuals are given.

use std::env::{consts, join_paths, split_paths, var_os};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use xtask::process::{begins, cargo, root, run, target};
use xtask::python;

use crate::{audit, bill, tutorial, workflow};

/// What makes and judges wheels, pinned.
const REQUIREMENTS: &str = include_str!("../release-requirements.txt");

/// The page that somebody types who has just installed it.
const TUTORIAL: &str = include_str!("../../docs/tutorials/own-tank.md");

/// How long it may take from the wheel, or the program, to the tutorial's picture.
const A_MINUTE: Duration = Duration::from_secs(60);

/// The oldest C library for which the wheel is made.
const MANYLINUX: &str = "manylinux_2_28";

/// A part of a release, made and tried.
type Part = fn() -> Result<(), String>;

/// The parts by their words.
const PARTS: [(&str, Part); 7] = [
    ("packages", packages),
    ("audit", audit),
    ("bill", bill),
    ("workflow", workflow),
    ("wheel", wheel),
    ("binary", binary),
    ("shells", shells),
];

/// Makes and tries the parts that are named, without a name all.
///
/// # Errors
/// What is no part, or what failed.
pub fn check(asked: &[String]) -> Result<(), String> {
    let is_part = |word: &&String| PARTS.iter().any(|(name, _)| name == word);
    if let Some(other) = asked.iter().find(|word| !is_part(word)) {
        let parts = PARTS.map(|(name, _)| name).join(", ");
        return Err(format!("a release has no part {other}; it has {parts}"));
    }
    let is_asked = |name: &str| asked.is_empty() || asked.iter().any(|word| word == name);
    let mut parts = PARTS.iter().filter(|(name, _)| is_asked(name));
    parts.try_for_each(|(name, part)| {
        begins(&format!("release: {name}"));
        part()
    })
}

/// Packs every crate in the order of dependencies, from what is committed, and compiles each from its package.
fn packages() -> Result<(), String> {
    let mut package = cargo(&["package", "--workspace", "--locked", "--quiet"]);
    for outside in ["chores", "xtask", "lynkeus-py"] {
        package.args(["--exclude", outside]);
    }
    run(&mut package)
}

/// Licences, sources and known holes of what is used.
fn audit() -> Result<(), String> {
    audit::check(&environment()?, &emptied("audit")?)
}

/// A bill of materials of the command.
fn bill() -> Result<(), String> {
    bill::check(&emptied("bill")?)
}

/// The workflow of the forge.
fn workflow() -> Result<(), String> {
    workflow::check(&environment()?, &emptied("workflow")?)
}

/// Builds the wheel as it is published, has it judged, and types the tutorial where there is no Rust.
fn wheel() -> Result<(), String> {
    let python = environment()?;
    let folder = emptied("wheel")?;
    let mut build = Command::new(&python);
    build
        .args(["-m", "maturin", "build", "--release", "--locked"])
        .args(["--zig", "--compatibility", MANYLINUX, "--out"])
        .arg(&folder)
        // zig comes with this Python's packages
        .env("CARGO_ZIGBUILD_PYTHON_PATH", &python);
    run(build.current_dir(root()))?;
    let wheel = crate::package::built(&folder)?;
    run(Command::new(&python)
        .args(["-m", "auditwheel", "show"])
        .arg(&wheel))?;
    let fresh = folder.join("environment");
    python::create(&fresh)?;
    let since = Instant::now();
    let scripts = fresh.join("bin");
    run(Command::new(scripts.join("python"))
        .args([
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
        ])
        .arg(&wheel))?;
    tried(&folder, &scripts, since)
}

/// Builds a program that needs no library of the system, and types the tutorial with it alone.
fn binary() -> Result<(), String> {
    let folder = emptied("binary")?;
    let musl = format!("{}-unknown-linux-musl", consts::ARCH);
    let mut build = cargo(&["build", "--release", "--locked", "--package", "lynkeus-cli"]);
    let name = match has_target(&musl) {
        true => musl,
        false => {
            build.env("RUSTFLAGS", "-C target-feature=+crt-static");
            format!("{}-unknown-linux-gnu", consts::ARCH)
        }
    };
    run(build.args(["--target", &name]))?;
    let program = target().join(&name).join("release").join("lynkeus");
    let since = Instant::now();
    let there = folder.join("lynkeus");
    let copied = fs::copy(&program, &there);
    copied.map_err(|error| format!("cannot copy {}: {error}", program.display()))?;
    let bytes = fs::read(&there).map_err(|error| error.to_string())?;
    match interpreter(&bytes) {
        Some(loader) => Err(format!("the program for {name} is not static: {loader}")),
        None => tried(&folder, &folder, since),
    }
}

/// The loader that a program for Linux asks for; none where it is static.
fn interpreter(elf: &[u8]) -> Option<String> {
    let found = elf.windows(8).position(|bytes| bytes == b"/ld-linu")?;
    let text = &elf[found..];
    let end = text.iter().position(|byte| *byte == 0)?;
    Some(String::from_utf8_lossy(&text[..end]).into_owned())
}

/// Whether the compiler has the standard library of a target.
fn has_target(name: &str) -> bool {
    let asked = Command::new("rustc")
        .args(["--print", "target-libdir", "--target", name])
        .output();
    asked.is_ok_and(|found| {
        let folder = String::from_utf8_lossy(&found.stdout).trim().to_owned();
        found.status.success() && Path::new(&folder).is_dir()
    })
}

/// Types the tutorial in an empty folder, with the command in `programs`, and looks at the clock.
fn tried(folder: &Path, programs: &Path, since: Instant) -> Result<(), String> {
    let work = folder.join("work");
    fs::create_dir(&work).map_err(|error| format!("cannot make {}: {error}", work.display()))?;
    tutorial::type_in(TUTORIAL, &work, &without_rust(programs)?)?;
    let picture = fs::read_to_string(work.join("estimates.svg"));
    let picture = picture.map_err(|error| format!("the tutorial drew no picture: {error}"))?;
    if !picture.starts_with("<svg") {
        return Err("the tutorial's picture is no picture".to_owned());
    }
    let took = since.elapsed();
    begins(&format!(
        "release: installed, and the tutorial typed, in {:.1} s",
        took.as_secs_f64()
    ));
    match took < A_MINUTE {
        true => Ok(()),
        false => Err("the tutorial took more than a minute".to_owned()),
    }
}

/// The `PATH` of somebody who has these programs, and no Rust.
fn without_rust(programs: &Path) -> Result<OsString, String> {
    let path = var_os("PATH").unwrap_or_default();
    let others = split_paths(&path).filter(|folder| {
        ["cargo", "rustc", "lynkeus"]
            .iter()
            .all(|name| !folder.join(name).exists())
    });
    let folders: Vec<PathBuf> = std::iter::once(programs.to_owned()).chain(others).collect();
    join_paths(folders).map_err(|error| error.to_string())
}

/// Scripts and pages that the program writes, read by the shells and formatters that are there.
fn shells() -> Result<(), String> {
    let folder = emptied("shells")?;
    let made = |arguments: &[&str]| {
        let mut lynkeus = cargo(&["run", "--quiet", "--package", "lynkeus-cli", "--"]);
        let output = lynkeus.args(arguments).output();
        let output = output.map_err(|error| format!("cannot run lynkeus: {error}"))?;
        let file = folder.join(arguments.join("."));
        fs::write(&file, &output.stdout)
            .map_err(|error| format!("cannot write {}: {error}", file.display()))?;
        Ok::<PathBuf, String>(file)
    };
    for shell in ["bash", "zsh", "fish"] {
        let script = made(&["completions", shell])?;
        judged(Command::new(shell).arg("-n").arg(script))?;
    }
    for page in ["", "check", "estimate", "serve"] {
        let words: Vec<&str> = ["man", page]
            .into_iter()
            .filter(|word| !word.is_empty())
            .collect();
        let page = made(&words)?;
        judged(
            Command::new("man")
                .args(["--warnings", "--local-file"])
                .arg(page),
        )?;
    }
    Ok(())
}

/// Runs a judge that says something where it finds fault; one that is not there is left out with a word.
fn judged(judge: &mut Command) -> Result<(), String> {
    let name = judge.get_program().to_string_lossy().into_owned();
    let Ok(found) = judge.stdin(Stdio::null()).output() else {
        eprintln!("skipped: there is no {name} here");
        return Ok(());
    };
    match found.status.success() && found.stderr.is_empty() {
        true => Ok(()),
        false => Err(format!(
            "{name} refuses it: {}",
            String::from_utf8_lossy(&found.stderr)
        )),
    }
}

fn environment() -> Result<PathBuf, String> {
    python::environment(".venv-release", REQUIREMENTS)
}

/// A folder that is empty, for a part.
fn emptied(part: &str) -> Result<PathBuf, String> {
    let folder = target().join("release-check").join(part);
    let cannot = |error: std::io::Error| format!("cannot make {}: {error}", folder.display());
    if folder.exists() {
        fs::remove_dir_all(&folder).map_err(cannot)?;
    }
    fs::create_dir_all(&folder).map_err(cannot)?;
    Ok(folder)
}
