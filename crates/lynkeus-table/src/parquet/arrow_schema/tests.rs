use super::*;

/// What pyarrow writes of t: duration(ns), y: double, s: struct of d: duration(s) and m: duration(ms), u: duration(us), n: int64.
const PYARROW: &str = "/////4ABAAAQAAAAAAAKAAwABgAFAAgACgAAAAABBAAMAAAACAAIAAAABAAIAAAABAAAAAUAAAAkAQAA6AAAAGgAAAA8AAAABAAAAAD///8AAAECEAAAABwAAAAEAAAAAAAAAAEAAABuAAAACAAMAAgABwAIAAAAAAAAAUAAAAA0////AAABEhAAAAAUAAAABAAAAAAAAAABAAAAdQAAACb///8AAAIAXP///wAAAQ0YAAAAHAAAAAQAAAACAAAAPAAAABAAAAABAAAAcwAAANz///+I////AAABEhAAAAAYAAAABAAAAAAAAAABAAAAbQAAAAQABAAEAAAAsP///wAAARIQAAAAFAAAAAQAAAAAAAAAAQAAAGQAAACi////AAAAANj///8AAAEDEAAAABQAAAAEAAAAAAAAAAEAAAB5AAAAyv///wAAAgAQABQACAAGAAcADAAAABAAEAAAAAAAARIQAAAAGAAAAAQAAAAAAAAAAQAAAHQABgAIAAYABgAAAAAAAwA=";

/// What polars writes of t: duration(us), y: double, u: double.
const POLARS: &str = "/////8YAAAAEAAAA8v///xQAAAAEAAEAAAAKAAsACAAKAAQA+P///wwAAAAIAAgAAAAEAAMAAABcAAAAMAAAAAQAAACc////HAAAABAAAAAIAAAAAQMAAAAAAACa////AgAAAAEAAAB1AAAAxP///xwAAAAQAAAACAAAAAEDAAAAAAAAwv///wIAAAABAAAAeQAAAOz///8wAAAAIAAAABgAAAABEgAAEAASAAQAEAARAAgAAAAMAAAAAAD6////AgAGAAYABAABAAAAdAA=";

#[test]
fn durations_are_found_wherever_they_are_with_their_units() {
    let expected = [
        ("t", 1),
        ("s.d", 1_000_000_000),
        ("s.m", 1_000_000),
        ("u", 1000),
    ];
    let expected = expected.map(|(name, unit)| (name.to_owned(), unit));
    assert_eq!(durations(PYARROW), Some(HashMap::from(expected)));
    let polars = HashMap::from([("t".to_owned(), 1000)]);
    assert_eq!(durations(POLARS), Some(polars));
}

#[test]
fn what_is_no_schema_says_nothing() {
    for text in ["", "AAAA", "/////w==", "?", "/////4ABAAAQAAAA"] {
        assert_eq!(durations(text), None, "{text}");
    }
    // cut short or changed anywhere, it ends, with or without an answer
    let mut changed = PYARROW.as_bytes().to_vec();
    for place in 0..changed.len() {
        let _ = durations(&PYARROW[..place]);
        for digit in *b"Az/9" {
            let before = std::mem::replace(&mut changed[place], digit);
            let _ = durations(std::str::from_utf8(&changed).unwrap());
            changed[place] = before;
        }
    }
}
