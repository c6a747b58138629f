//! Any bytes are a log of columns that are equally long, or a refusal.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lynkeus::Table;

fuzz_target!(|bytes: &[u8]| {
    match Table::read(bytes, "fuzz.csv") {
        Ok(table) => {
            for series in table.names().filter_map(|name| table.readings(name).ok()) {
                assert_eq!(series.len(), table.rows());
            }
        }
        Err(refused) => assert!(!refused.to_string().is_empty()),
    }
});
