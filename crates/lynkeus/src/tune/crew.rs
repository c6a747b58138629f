//! Many runs side by side on all processors.

use std::num::NonZero;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;

use crate::Error;

/// Fractions of a run that are told.
const STEP: f64 = 0.02;

/// What a run is told its progress by.
pub(super) type Watch<'a> = dyn FnMut(f64) -> ControlFlow<()> + 'a;

/// Tells `watch` of the k-th of `parts` equal parts of a run.
pub(super) fn part<'w, 'a>(
    watch: &'w mut Watch<'a>,
    k: u32,
    parts: u32,
) -> impl FnMut(f64) -> ControlFlow<()> + use<'w, 'a> {
    move |fraction| watch((f64::from(k) + fraction) / f64::from(parts))
}

/// A message of a worker.
enum News<T> {
    Fraction(usize, f64),
    Done(usize, Result<T, Error>),
}

/// Does the runs 0 … `count` − 1 on as many threads as there are processors; `watch` is told
/// the fraction done of them all, on the caller's thread, and may stop them. The runs of a
/// thread have one clone of `shared`.
///
/// # Errors
/// The error of the first run that has one, or that `watch` stopped them.
pub(super) fn every<S: Clone + Send, T: Send>(
    count: usize,
    shared: &S,
    run: &(impl Fn(&S, usize, &mut Watch<'_>) -> Result<T, Error> + Sync),
    watch: &mut Watch<'_>,
) -> Result<Vec<T>, Error> {
    let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    let (sender, receiver) = channel();
    let threads = thread::available_parallelism().map_or(1, NonZero::get);
    let results = thread::scope(|scope| {
        for _ in 0..threads.min(count) {
            let (sender, next, stop) = (sender.clone(), &next, &stop);
            let own = shared.clone();
            scope.spawn(move || work(count, &|i, watch| run(&own, i, watch), next, stop, &sender));
        }
        drop(sender);
        collect(count, &receiver, &stop, watch)
    });
    let cancelled = || Error::input("the sweep was stopped");
    let is_error = |r: &Option<Result<T, Error>>| matches!(r, Some(Err(_)));
    if stop.load(Ordering::Relaxed) && !results.iter().any(is_error) {
        return Err(cancelled());
    }
    results
        .into_iter()
        .map(|result| result.unwrap_or_else(|| Err(cancelled())))
        .collect()
}

/// One thread: takes the next run as long as there is one.
fn work<T>(
    count: usize,
    run: &impl Fn(usize, &mut Watch<'_>) -> Result<T, Error>,
    next: &AtomicUsize,
    stop: &AtomicBool,
    news: &Sender<News<T>>,
) {
    while !stop.load(Ordering::Relaxed) {
        let index = next.fetch_add(1, Ordering::Relaxed);
        if index >= count {
            return;
        }
        let mut told = 0.0;
        let mut watch = |fraction: f64| {
            if fraction - told >= STEP {
                told = fraction;
                // the receiver only goes away with the scope
                let _ = news.send(News::Fraction(index, fraction));
            }
            match stop.load(Ordering::Relaxed) {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        };
        let result = run(index, &mut watch);
        let _ = news.send(News::Done(index, result));
    }
}

fn collect<T>(
    count: usize,
    news: &Receiver<News<T>>,
    stop: &AtomicBool,
    watch: &mut Watch<'_>,
) -> Vec<Option<Result<T, Error>>> {
    let mut results: Vec<Option<Result<T, Error>>> = (0..count).map(|_| None).collect();
    let mut fractions = vec![0.0; count];
    for message in news {
        let (index, fraction) = match message {
            News::Fraction(index, fraction) => (index, fraction),
            News::Done(index, result) => {
                if result.is_err() {
                    stop.store(true, Ordering::Relaxed);
                }
                if let Some(slot) = results.get_mut(index) {
                    *slot = Some(result);
                }
                (index, 1.0)
            }
        };
        if let Some(slot) = fractions.get_mut(index) {
            *slot = fraction;
        }
        if watch(fractions.iter().sum::<f64>() / count as f64).is_break() {
            stop.store(true, Ordering::Relaxed);
        }
    }
    // what a failed run stopped is told by its error, which may come after gaps
    let failed = results.iter().position(|r| matches!(r, Some(Err(_))));
    match failed {
        Some(index) => results.into_iter().skip(index).take(1).collect(),
        None => results,
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
        assert!(every(1000, &(), &slow, &mut |_| ControlFlow::Break(())).is_err());
    }
}
