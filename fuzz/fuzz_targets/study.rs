//! Any text is a study or a refusal that names the file.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lynkeus::Study;

fuzz_target!(|text: &str| {
    if let Err(refused) = Study::parse(text, "fuzz.toml") {
        assert!(refused.to_string().contains("fuzz.toml"), "{refused}");
    }
});
