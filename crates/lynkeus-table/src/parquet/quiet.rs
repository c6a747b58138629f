//! Panics of a library, kept from the terminal.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    /// whether a panic of this thread is expected
    static IS_EXPECTED: Cell<bool> = const { Cell::new(false) };
}

static HOOK: Once = Once::new();

/// What the work gives, or none where it panics; nothing is told of that.
pub(super) fn caught<T>(work: impl FnOnce() -> T) -> Option<T> {
    HOOK.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !IS_EXPECTED.get() {
                before(info);
            }
        }));
    });
    let before = IS_EXPECTED.replace(true);
    // what the work changed is dropped with it
    let done = panic::catch_unwind(AssertUnwindSafe(work));
    IS_EXPECTED.set(before);
    done.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_none_and_the_next_one_is_told() {
        assert_eq!(caught(|| 3), Some(3));
        let nothing: Vec<u8> = vec![];
        assert_eq!(caught(|| nothing[0]), None);
        assert!(!IS_EXPECTED.get());
    }
}
