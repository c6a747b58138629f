//! Many runs side by side on all processors.

use std::num::NonZero;
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::thread::{self, Builder};

use lynkeus_expr::Budget;

use crate::Error;

/// A watch that also ends a run whose budget is spent.
pub fn within<'a>(
    budget: &'a Budget,
    watch: &'a mut dyn FnMut(f64) -> ControlFlow<()>,
) -> impl FnMut(f64) -> ControlFlow<()> + 'a {
    move |fraction| match budget.spent() {
        Some(_) => ControlFlow::Break(()),
        None => watch(fraction),
    }
}

/// Fractions of a run that are told.
const STEP: f64 = 0.02;

/// What a run is told its progress by.
pub type Watch<'a> = dyn FnMut(f64) -> ControlFlow<()> + 'a;

/// Tells `watch` of the k-th of `parts` equal parts of a run.
pub(crate) fn part<'w, 'a>(
    watch: &'w mut Watch<'a>,
    k: u32,
    parts: u32,
) -> impl FnMut(f64) -> ControlFlow<()> + use<'w, 'a> {
    move |fraction| watch((f64::from(k) + fraction) / f64::from(parts))
}

/// A message of a worker.
enum News<T> {
    Fraction(usize, f64),
    /// What a run gave; none where it was told to stop.
    Done(usize, Option<Result<T, Error>>),
}

/// What the workers share: which run is next, and from which on they need not run any more.
struct Board {
    count: usize,
    next: AtomicUsize,
    /// The first run that is not wanted: all are from 0 where the caller stopped them, and
    /// those after the first that failed.
    end: AtomicUsize,
}

impl Board {
    fn new(count: usize) -> Self {
        Self {
            count,
            next: AtomicUsize::new(0),
            end: AtomicUsize::new(count),
        }
    }

    /// Takes the next run that is wanted.
    fn take(&self) -> Option<usize> {
        let index = self.next.fetch_add(1, Ordering::Relaxed);
        self.wants(index).then_some(index)
    }

    fn wants(&self, index: usize) -> bool {
        index < self.end.load(Ordering::Relaxed)
    }

    /// The runs from `index` on are not wanted.
    fn end_at(&self, index: usize) {
        self.end.fetch_min(index, Ordering::Relaxed);
    }
}

/// Does the runs 0 … `count` − 1 on as many threads as there are processors, or on the caller's where
/// none can be had; `watch` is told the fraction done of them all, on the caller's thread, and may stop them.
/// The runs of a thread have one clone of `shared`.
///
/// # Errors
/// The error of the first run in order that has one: the runs before it are done to their ends,
/// so that it is the same every time. Or that `watch` stopped them.
pub fn every<S: Clone + Send, T: Send>(
    count: usize,
    shared: &S,
    run: &(impl Fn(&S, usize, &mut Watch<'_>) -> Result<T, Error> + Sync),
    watch: &mut Watch<'_>,
) -> Result<Vec<T>, Error> {
    let board = Board::new(count);
    let (sender, receiver) = channel();
    let threads = threads();
    let mut desk = Desk::new(&board, watch);
    thread::scope(|scope| {
        let mut hired = 0;
        for _ in 0..threads.min(count) {
            let (sender, board) = (sender.clone(), &board);
            let own = shared.clone();
            let worker = move || {
                let mut tell = |news| {
                    // the receiver only goes away with the scope
                    let _ = sender.send(news);
                };
                work(board, &|i, watch| run(&own, i, watch), &mut tell);
            };
            // one processor, or a user's limit, may not have room for them all
            hired += usize::from(Builder::new().spawn_scoped(scope, worker).is_ok());
        }
        drop(sender);
        match hired {
            0 => work(&board, &|i, watch| run(shared, i, watch), &mut |news| {
                desk.note(news);
            }),
            _ => receiver.iter().for_each(|news| desk.note(news)),
        }
    });
    let stopped = || Error::input("the runs were stopped");
    let is_stopped = desk.is_stopped;
    let results = desk.results.into_iter();
    let results: Result<Vec<T>, Error> = results
        .map(|r| r.unwrap_or_else(|| Err(stopped())))
        .collect();
    match is_stopped {
        true => results.and(Err(stopped())),
        false => results,
    }
}

/// How many threads work at a time.
pub(crate) fn threads() -> usize {
    thread::available_parallelism().map_or(1, NonZero::get)
}

/// Does the work on every item, with its place, on so many threads.
pub(crate) fn each<T: Send>(
    items: &mut [T],
    threads: usize,
    work: &(impl Fn(usize, &mut T) + Sync),
) {
    let count = items.len();
    let queue = Mutex::new(items.iter_mut().enumerate());
    let next = || queue.lock().unwrap_or_else(|e| e.into_inner()).next();
    let hand = || {
        while let Some((place, item)) = next() {
            work(place, item);
        }
    };
    thread::scope(|scope| {
        for _ in 1..threads.min(count) {
            // where no thread can be had, the others do its work
            let _ = Builder::new().spawn_scoped(scope, hand);
        }
        hand();
    });
}

/// One thread: takes the next run as long as there is one.
fn work<T>(
    board: &Board,
    run: &impl Fn(usize, &mut Watch<'_>) -> Result<T, Error>,
    tell: &mut impl FnMut(News<T>),
) {
    while let Some(index) = board.take() {
        let (mut told, mut stopped) = (0.0, false);
        let mut watch = |fraction: f64| {
            if fraction - told >= STEP {
                told = fraction;
                tell(News::Fraction(index, fraction));
            }
            stopped = !board.wants(index);
            match stopped {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        };
        let result = run(index, &mut watch);
        // the error of a run that was told to stop says nothing of it
        tell(News::Done(index, (!stopped).then_some(result)));
    }
}

/// Where the news come together.
struct Desk<'d, 'w, T> {
    board: &'d Board,
    watch: &'d mut Watch<'w>,
    results: Vec<Option<Result<T, Error>>>,
    fractions: Vec<f64>,
    /// their sum
    done: f64,
    is_stopped: bool,
}

impl<'d, 'w, T> Desk<'d, 'w, T> {
    fn new(board: &'d Board, watch: &'d mut Watch<'w>) -> Self {
        Self {
            board,
            watch,
            results: (0..board.count).map(|_| None).collect(),
            fractions: vec![0.0; board.count],
            done: 0.0,
            is_stopped: false,
        }
    }

    fn note(&mut self, news: News<T>) {
        let (index, fraction) = match news {
            News::Fraction(index, fraction) => (index, fraction),
            News::Done(index, result) => {
                if let Some(Err(_)) = result {
                    self.board.end_at(index + 1);
                }
                if let Some(slot) = self.results.get_mut(index) {
                    *slot = result;
                }
                (index, 1.0)
            }
        };
        if let Some(slot) = self.fractions.get_mut(index) {
            self.done += fraction - *slot;
            *slot = fraction;
        }
        if (self.watch)(self.done / self.board.count as f64).is_break() {
            self.is_stopped = true;
            self.board.end_at(0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_keep_their_order_and_progress_ends_at_one() {
        let mut last = 0.0;
        let squares = every(
            50,
            &3,
            &|offset, i, watch| {
                let _ = watch(0.5);
                Ok(i * i + offset)
            },
            &mut |fraction| {
                last = fraction;
                ControlFlow::Continue(())
            },
        )
        .unwrap();
        assert_eq!(squares, (0..50).map(|i| i * i + 3).collect::<Vec<_>>());
        assert!((last - 1.0_f64).abs() < 1e-9);
    }

    #[test]
    fn an_error_and_a_stop_end_the_sweep() {
        let fail = |_: &(), i: usize, _: &mut Watch<'_>| match i {
            7 => Err(Error::input("seven")),
            _ => Ok(i),
        };
        let error = every(100, &(), &fail, &mut |_| ControlFlow::Continue(())).unwrap_err();
        assert_eq!(error.to_string(), "seven");
        let slow = |_: &(), i: usize, watch: &mut Watch<'_>| match watch(0.5) {
            ControlFlow::Break(()) => Err(Error::input("told to stop")),
            ControlFlow::Continue(()) => Ok(i),
        };
        let error = every(1000, &(), &slow, &mut |_| ControlFlow::Break(())).unwrap_err();
        assert_eq!(error.to_string(), "the runs were stopped");
    }

    /// Run 0 fails late, run 1 at once, and the others when they are told to stop.
    #[test]
    fn the_first_error_in_order_is_told_however_late_it_comes() {
        let run = |_: &(), i: usize, watch: &mut Watch<'_>| -> Result<usize, Error> {
            for step in 0..30 {
                if i == 1 {
                    break;
                }
                thread::sleep(std::time::Duration::from_millis(1));
                if watch(f64::from(step) / 30.0).is_break() {
                    return Err(Error::input(format!("run {i} was stopped")));
                }
            }
            Err(Error::input(format!("run {i}")))
        };
        for _ in 0..10 {
            let error = every(8, &(), &run, &mut |_| ControlFlow::Continue(())).unwrap_err();
            assert_eq!(error.to_string(), "run 0");
        }
    }

    #[test]
    fn the_callers_thread_does_it_alone() {
        let board = Board::new(5);
        let mut last = 0.0;
        let mut watch = |fraction| {
            last = fraction;
            ControlFlow::Continue(())
        };
        let mut desk = Desk::new(&board, &mut watch);
        let run = |i: usize, watch: &mut Watch<'_>| {
            let _ = watch(0.5);
            Ok(i)
        };
        work(&board, &run, &mut |news| desk.note(news));
        let results: Vec<usize> = desk.results.into_iter().flatten().flatten().collect();
        assert_eq!(results, [0, 1, 2, 3, 4]);
        assert_eq!(last, 1.0);
    }
}
