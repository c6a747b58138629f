//! How long work may take and how much memory it may use.
//!
//! Work that is ended by a limit has no result: what was computed since may be wrong, and is
//! given up whole ([`Graph::budgeted`](crate::Graph::budgeted)).

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::time::{Duration, Instant};

/// Time, memory and the wish to go on. Parts of it may end on their own: one that used too much
/// memory leaves the others theirs. A clone is the same budget; asking it from many
/// threads is cheap.
#[derive(Clone, Debug, Default)]
pub struct Budget {
    /// none where nothing limits the work
    shared: Option<Arc<Shared>>,
}

/// Memory that may be used, and who tells how much is.
#[derive(Clone, Copy, Debug)]
pub struct Memory {
    /// most bytes
    pub limit: usize,
    /// bytes in use now
    pub used: fn() -> usize,
    /// bytes that were in use before the work and do not count
    pub before: usize,
}

impl Memory {
    /// Bytes that the work uses now.
    fn own(&self) -> usize {
        (self.used)().saturating_sub(self.before)
    }
}

/// What ended work early.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Spent {
    /// the time that was allowed
    Time(Duration),
    /// the memory that was allowed, bytes
    Memory(usize),
    /// somebody asked to stop
    Cancelled,
    /// so many operations, more than what is allowed is enough for: it was not begun
    Size(u64),
    /// floating point has too few digits
    Digits,
}

impl Spent {
    /// Whether more time or memory could end it otherwise.
    pub fn is_limit(self) -> bool {
        !matches!(self, Self::Digits)
    }
}

/// The same budget, not an equal one.
impl PartialEq for Budget {
    fn eq(&self, other: &Self) -> bool {
        match (&self.shared, &other.shared) {
            (Some(one), Some(other)) => Arc::ptr_eq(one, other),
            (one, other) => one.is_none() && other.is_none(),
        }
    }
}

#[derive(Debug)]
struct Shared {
    /// a part of another budget ends with it
    whole: Budget,
    ends: Option<Instant>,
    /// the time as it was asked for, for words
    time: Duration,
    memory: Option<Memory>,
    /// raised by somebody who asks to stop
    flag: Option<Arc<AtomicBool>>,
    /// why the work ended, once it has: what is spent stays spent
    mark: AtomicU8,
}

const GOING: u8 = 0;
const TIME: u8 = 1;
const MEMORY: u8 = 2;
const CANCELLED: u8 = 3;
/// The budget that this is a part of is spent.
const WHOLE: u8 = 4;

impl Budget {
    /// A budget from now on, that can be [cancelled](Budget::cancel) as well.
    pub fn new(time: Option<Duration>, memory: Option<Memory>) -> Self {
        Self::default().part_of(time, time, memory, None)
    }

    /// The same budget, which also ends once the flag is raised.
    #[must_use]
    pub fn stopped_by(self, flag: Arc<AtomicBool>) -> Self {
        self.part_of(None, self.named(), self.memory(), Some(flag))
    }

    /// At most this time of what is left.
    #[must_use]
    pub fn within(&self, time: Duration) -> Self {
        self.part_of(Some(time), Some(time), self.memory(), None)
    }

    /// That share of the time that is left, in the words of the whole.
    #[must_use]
    pub fn part(&self, share: f64) -> Self {
        let left = self.left();
        let time = left.map(|left| left.mul_f64(share.clamp(0.0, 1.0)));
        self.part_of(time, self.named(), self.memory(), None)
    }

    fn part_of(
        &self,
        time: Option<Duration>,
        named: Option<Duration>,
        memory: Option<Memory>,
        flag: Option<Arc<AtomicBool>>,
    ) -> Self {
        let shared = Arc::new(Shared {
            whole: self.clone(),
            // a limit beyond what a clock can tell is none
            ends: time.and_then(|time| Instant::now().checked_add(time)),
            time: named.unwrap_or_default(),
            memory,
            flag,
            mark: AtomicU8::new(GOING),
        });
        Self {
            shared: Some(shared),
        }
    }

    fn memory(&self) -> Option<Memory> {
        self.shared.as_deref()?.memory
    }

    /// Time until the end; none where there is no such limit.
    pub fn left(&self) -> Option<Duration> {
        let shared = self.shared.as_deref()?;
        let own = shared.ends.map(|ends| {
            // zero after the end
            ends.saturating_duration_since(Instant::now())
        });
        match (own, shared.whole.left()) {
            (Some(own), Some(whole)) => Some(own.min(whole)),
            (own, whole) => own.or(whole),
        }
    }

    /// The time that was asked for of the budget that ends first.
    fn named(&self) -> Option<Duration> {
        let shared = self.shared.as_deref()?;
        match (shared.ends, shared.whole.left()) {
            (Some(ends), Some(whole)) if ends > Instant::now() + whole => shared.whole.named(),
            (Some(_), _) => Some(shared.time),
            (None, _) => shared.whole.named(),
        }
    }

    /// Ends all work under this budget soon. Nothing happens to a budget without limits.
    pub fn cancel(&self) {
        if let Some(shared) = self.shared.as_deref() {
            shared.set(CANCELLED);
        }
    }

    /// What ended the work, looking at the clock and the memory.
    pub fn spent(&self) -> Option<Spent> {
        let shared = self.shared.as_deref()?;
        if let Some(known) = self.marked() {
            return Some(known);
        }
        // memory comes back when a part that took too much of it has ended: the whole goes on
        if !self.is_over() && shared.memory.is_some_and(|m| m.own() > m.limit) {
            shared.set(MEMORY);
        }
        self.marked()
    }

    /// Whether the time is over, or somebody asked to stop.
    fn is_over(&self) -> bool {
        let Some(shared) = self.shared.as_deref() else {
            return false;
        };
        let is_raised = |flag: &Arc<AtomicBool>| flag.load(Ordering::Relaxed);
        if shared.flag.as_ref().is_some_and(is_raised) {
            shared.set(CANCELLED);
        } else if shared.whole.is_over() {
            shared.set(WHOLE);
        } else if shared.ends.is_some_and(|ends| Instant::now() >= ends) {
            shared.set(TIME);
        }
        shared.mark.load(Ordering::Relaxed) != GOING
    }

    /// What ended the work as far as anybody noticed.
    pub fn marked(&self) -> Option<Spent> {
        let shared = self.shared.as_deref()?;
        match shared.mark.load(Ordering::Relaxed) {
            GOING => None,
            TIME => Some(Spent::Time(shared.time)),
            MEMORY => Some(Spent::Memory(shared.memory.map_or(0, |m| m.limit))),
            WHOLE => shared.whole.marked(),
            _ => Some(Spent::Cancelled),
        }
    }

    /// Bytes that may still be asked for; none where memory has no limit.
    pub fn room(&self) -> Option<usize> {
        let memory = self.memory()?;
        Some(memory.limit.saturating_sub(memory.own()))
    }

    /// Whether there is room for so many more bytes; the budget is spent where there is not,
    /// before they are asked for.
    pub fn affords(&self, bytes: usize) -> bool {
        let Some(shared) = self.shared.as_deref() else {
            return true;
        };
        let over = |m: Memory| m.own().saturating_add(bytes) > m.limit;
        if shared.memory.is_some_and(over) {
            shared.set(MEMORY);
        }
        self.marked().is_none()
    }
}

impl Shared {
    /// The first reason stays.
    fn set(&self, mark: u8) {
        let order = Ordering::Relaxed;
        let _ = self.mark.compare_exchange(GOING, mark, order, order);
    }
}

impl fmt::Display for Spent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Time(time) => write!(f, "the limit of {} s ended it", time.as_secs_f64()),
            Self::Memory(bytes) => write!(f, "the limit of {} MiB ended it", bytes >> 20),
            Self::Cancelled => f.write_str("an interrupt ended it"),
            Self::Size(operations) => write!(
                f,
                "too large for the time and memory allowed: some {:.0e} operations",
                *operations as f64
            ),
            Self::Digits => f.write_str("rounding hides it: double precision has too few digits"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_ends_with_the_whole_and_in_its_words() {
        let whole = Budget::new(Some(Duration::from_secs(100)), None);
        let part = whole.part(0.5);
        let left = part.left().unwrap().as_secs_f64();
        assert!(left <= 50.0 && left > 49.0, "{left}");
        assert_eq!((part.spent(), whole.spent()), (None, None));
        whole.cancel();
        assert_eq!(part.spent(), Some(Spent::Cancelled));
        let none = Budget::new(Some(Duration::from_secs(7)), None).part(0.0);
        assert_eq!(none.spent(), Some(Spent::Time(Duration::from_secs(7))));
    }

    #[test]
    fn a_part_that_ends_leaves_the_whole() {
        let whole = Budget::new(Some(Duration::from_secs(100)), None);
        let part = whole.within(Duration::ZERO);
        let spent = part.spent().unwrap();
        assert_eq!(spent.to_string(), "the limit of 0 s ended it");
        assert_eq!(whole.spent(), None);
    }

    #[test]
    fn the_shorter_limit_gives_the_words() {
        let whole = Budget::new(Some(Duration::from_secs(5)), None);
        let long = whole.within(Duration::from_secs(60));
        assert_eq!(long.named(), Some(Duration::from_secs(5)));
        let short = whole.within(Duration::from_secs(1));
        assert_eq!(short.part(0.5).named(), Some(Duration::from_secs(1)));
    }

    #[test]
    fn memory_ends_before_it_is_asked_for() {
        let memory = Memory {
            limit: 100 << 20,
            used: || 60 << 20,
            before: 0,
        };
        let budget = Budget::new(None, Some(memory));
        let part = budget.part(0.3);
        assert_eq!(part.room(), Some(40 << 20));
        assert!(part.affords(30 << 20) && part.spent().is_none());
        assert!(!part.affords(50 << 20));
        let spent = part.spent().unwrap();
        assert_eq!(spent.to_string(), "the limit of 100 MiB ended it");
        // it may have come back
        assert_eq!(budget.marked(), None);
    }

    #[test]
    fn what_was_in_use_before_does_not_count() {
        let memory = |before| Memory {
            limit: 20 << 20,
            used: || 60 << 20,
            before,
        };
        let budget = Budget::new(None, Some(memory(50 << 20)));
        assert_eq!((budget.spent(), budget.room()), (None, Some(10 << 20)));
        assert!(budget.affords(10 << 20) && !budget.affords(11 << 20));
        let ended = Budget::new(None, Some(memory(30 << 20))).spent();
        assert_eq!(ended, Some(Spent::Memory(20 << 20)));
        // what was in use may be given back meanwhile
        let room = Budget::new(None, Some(memory(90 << 20))).room();
        assert_eq!(room, Some(20 << 20));
    }

    #[test]
    fn a_raised_flag_ends_every_part() {
        let flag = Arc::new(AtomicBool::new(false));
        let whole = Budget::new(Some(Duration::from_secs(100)), None).stopped_by(flag.clone());
        let part = whole.part(0.5).within(Duration::from_secs(1));
        assert_eq!((part.spent(), whole.spent()), (None, None));
        assert_eq!(whole.part(0.5).named(), Some(Duration::from_secs(100)));
        flag.store(true, Ordering::Relaxed);
        let cancelled = Some(Spent::Cancelled);
        assert_eq!((part.spent(), whole.spent()), (cancelled, cancelled));
    }

    #[test]
    fn no_limits_never_end() {
        let budget = Budget::default();
        budget.cancel();
        assert_eq!((budget.spent(), budget.left()), (None, None));
        assert!(budget.affords(usize::MAX));
    }
}
