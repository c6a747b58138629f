//! Any text is a plant or a diagnostic within the text.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lynkeus_model::{LoadOptions, Plant};

fuzz_target!(|text: &str| {
    for symbolic_parameters in [false, true] {
        let options = LoadOptions { symbolic_parameters, ..LoadOptions::default() };
        match Plant::from_modelica(text, "fuzz.mo", &options) {
            Ok(plant) => assert_eq!(plant.states.len(), plant.derivatives.len()),
            Err(refused) => {
                assert!(refused.span.end as usize <= text.len());
                assert!(!refused.to_string().is_empty());
            }
        }
    }
});
