//! What compiled code calls: the functions that the interpreter calls, too.

use lynkeus_expr::{Algebra, Binary, Reals, Unary};

/// A function of one number, and of four side by side, which go by address.
struct Pair {
    scalar: usize,
    lanes: usize,
}

impl Pair {
    fn address<const LANES: usize>(&self) -> usize {
        if LANES == 1 { self.scalar } else { self.lanes }
    }
}

/// The library's functions, by a macro because each has to be a function of its own.
macro_rules! unary {
    ($($op:ident),*) => {
        /// The address of a function of one value; none where code is emitted for it.
        pub(crate) fn unary<const LANES: usize>(op: Unary) -> Option<usize> {
            let pair = match op {
                $(Unary::$op => {
                    extern "sysv64" fn scalar(x: f64) -> f64 {
                        Reals.unary(Unary::$op, &x)
                    }
                    /// # Safety
                    /// Both must point at four numbers.
                    unsafe extern "sysv64" fn lanes(x: *const [f64; 4], to: *mut [f64; 4]) {
                        // SAFETY: by the caller's promise
                        unsafe { *to = (*x).map(scalar_value) }
                    }
                    fn scalar_value(x: f64) -> f64 {
                        Reals.unary(Unary::$op, &x)
                    }
                    Pair {
                        scalar: scalar as extern "sysv64" fn(f64) -> f64 as usize,
                        lanes: lanes as unsafe extern "sysv64" fn(*const [f64; 4], *mut [f64; 4])
                            as usize,
                    }
                })*
                _ => return None,
            };
            Some(pair.address::<LANES>())
        }
    };
}

macro_rules! binary {
    ($($op:ident),*) => {
        /// The address of a function of two values; none where code is emitted for it.
        pub(crate) fn binary<const LANES: usize>(op: Binary) -> Option<usize> {
            let pair = match op {
                $(Binary::$op => {
                    extern "sysv64" fn scalar(x: f64, y: f64) -> f64 {
                        Reals.binary(Binary::$op, &x, &y)
                    }
                    /// # Safety
                    /// All must point at four numbers.
                    unsafe extern "sysv64" fn lanes(
                        x: *const [f64; 4],
                        y: *const [f64; 4],
                        to: *mut [f64; 4],
                    ) {
                        // SAFETY: by the caller's promise
                        let (x, y) = unsafe { (*x, *y) };
                        let values =
                            std::array::from_fn(|i| Reals.binary(Binary::$op, &x[i], &y[i]));
                        // SAFETY: by the caller's promise
                        unsafe { *to = values }
                    }
                    Pair {
                        scalar: scalar as extern "sysv64" fn(f64, f64) -> f64 as usize,
                        lanes: lanes
                            as unsafe extern "sysv64" fn(
                                *const [f64; 4],
                                *const [f64; 4],
                                *mut [f64; 4],
                            ) as usize,
                    }
                })*
                _ => return None,
            };
            Some(pair.address::<LANES>())
        }
    };
}

unary!(Exp, Ln, Sin, Cos, Tan, Asin, Acos, Atan, Sinh, Cosh, Tanh);
binary!(Pow, Atan2);

/// Solves a system of `n` equations whose values have `LANES` lanes. At `system` stand A row by
/// row and b, with one more place behind; b becomes x, the last place the condition.
///
/// # Safety
/// `system` must point at n² + n + 1 values.
unsafe extern "sysv64" fn solve<const LANES: usize>(system: *mut [f64; LANES], n: u32) {
    let n = n as usize;
    // SAFETY: by the caller's promise
    let values = unsafe { std::slice::from_raw_parts_mut(system, n * n + n + 1) };
    let mut own = [0.0; 32];
    let mut heap = vec![];
    let place = if n * n + n <= own.len() {
        &mut own[..n * n + n]
    } else {
        heap.resize(n * n + n, 0.0);
        &mut heap[..]
    };
    for lane in 0..LANES {
        for (own, value) in place.iter_mut().zip(values.iter()) {
            *own = value[lane];
        }
        let (a, x) = place.split_at_mut(n * n);
        let rcond = Reals.solve_in_place(a, x);
        for (value, x) in values[n * n..].iter_mut().zip(x) {
            value[lane] = *x;
        }
        values[n * n + n][lane] = rcond;
    }
}

/// The address of the solver of linear systems.
pub(crate) fn solver<const LANES: usize>() -> usize {
    solve::<LANES> as unsafe extern "sysv64" fn(*mut [f64; LANES], u32) as usize
}
