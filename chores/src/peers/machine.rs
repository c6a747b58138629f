//! What the tables were measured on and with.

use std::fs;
use std::path::Path;
use std::process::Command;

use super::peer::text;
use super::programs::REQUIREMENTS;

/// The processor with its cores and widest vectors, how busy it is now, compilers and versions.
pub(super) fn described(python: &Path) -> String {
    let cpus = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let field = |name: &str| {
        let line = cpus.lines().find(|line| line.starts_with(name));
        line.and_then(|line| Some(line.split_once(':')?.1.trim()))
    };
    let model = field("model name").unwrap_or("unknown processor");
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let vectors = widest(field("flags").or(field("Features")).unwrap_or_default());
    let load = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let load = load.split(' ').next().unwrap_or("unknown");
    let versions: Vec<&str> = REQUIREMENTS
        .lines()
        .filter(|line| line.contains("=="))
        .collect();
    let versions = versions.join(", ").replace("==", " ");
    let [gcc, rust, python] = ["gcc", "rustc", &text(python)].map(version);
    format!(
        "{model}, {cores} cores, {vectors}, load {load} at the start; {gcc}; {rust}; {python}; {versions}.\n"
    )
}

/// The widest vectors that a processor with these flags has.
fn widest(flags: &str) -> &'static str {
    let kinds = [
        ("avx512f", "AVX-512"),
        ("avx2", "AVX2"),
        ("avx", "AVX"),
        ("sse2", "SSE2"),
        ("asimd", "Neon"),
    ];
    let has = |flag: &str| flags.split(' ').any(|found| found == flag);
    let kind = kinds.iter().find(|(flag, _)| has(flag));
    kind.map_or("no vectors known", |(_, name)| name)
}

fn version(program: &str) -> String {
    let output = Command::new(program).arg("--version").output();
    let told = output.map(|found| String::from_utf8_lossy(&found.stdout).into_owned());
    let told = told.unwrap_or_default();
    told.lines().next().unwrap_or(program).to_owned()
}

#[cfg(test)]
mod tests {
    use super::widest;

    #[test]
    fn the_widest_vectors_count() {
        assert_eq!(widest("sse2 avx avx2 avx512f avx512dq"), "AVX-512");
        assert_eq!(widest("sse2 avx avx2"), "AVX2");
        assert_eq!(widest("fpu sse2"), "SSE2");
        assert_eq!(widest(""), "no vectors known");
    }
}
