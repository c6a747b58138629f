//! What compiled code calls: the functions that the interpreter calls, too, over `Reals` for one
//! lane and over `Lanes` for four.

use std::arch::x86_64::__m256d;

use lynkeus_expr::lanes;
use lynkeus_expr::{Algebra, Binary, Reals, Unary};

use crate::avx::Avx;

/// A function of numbers, and of four of them side by side.
struct Pair {
    scalar: usize,
    lanes: usize,
}

impl Pair {
    fn address<const LANES: usize>(&self) -> usize {
        if LANES == 1 { self.scalar } else { self.lanes }
    }
}

/// The library's functions and those of lanes, by a macro because each has to be a function of
/// its own. Arguments and result go by vector registers, one number or four in each.
macro_rules! unary {
    ($($op:ident $function:ident),*) => {
        /// The address of a function of one value; none where code is emitted for it.
        pub(crate) fn unary<const LANES: usize>(op: Unary) -> Option<usize> {
            let pair = match op {
                $(Unary::$op => {
                    extern "sysv64" fn scalar(x: f64) -> f64 {
                        Reals.unary(Unary::$op, &x)
                    }
                    // with AVX the System V ABI passes it in a register
                    #[allow(improper_ctypes_definitions)]
                    #[target_feature(enable = "avx2,fma")]
                    extern "sysv64" fn side_by_side(x: __m256d) -> __m256d {
                        lanes::$function(Avx(x)).0
                    }
                    Pair {
                        scalar: scalar as extern "sysv64" fn(f64) -> f64 as usize,
                        lanes: side_by_side as unsafe extern "sysv64" fn(__m256d) -> __m256d
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
    ($($op:ident $function:ident),*) => {
        /// The address of a function of two values; none where code is emitted for it.
        pub(crate) fn binary<const LANES: usize>(op: Binary) -> Option<usize> {
            let pair = match op {
                $(Binary::$op => {
                    extern "sysv64" fn scalar(x: f64, y: f64) -> f64 {
                        Reals.binary(Binary::$op, &x, &y)
                    }
                    // with AVX the System V ABI passes it in a register
                    #[allow(improper_ctypes_definitions)]
                    #[target_feature(enable = "avx2,fma")]
                    extern "sysv64" fn side_by_side(x: __m256d, y: __m256d) -> __m256d {
                        lanes::$function(Avx(x), Avx(y)).0
                    }
                    Pair {
                        scalar: scalar as extern "sysv64" fn(f64, f64) -> f64 as usize,
                        lanes: side_by_side
                            as unsafe extern "sysv64" fn(__m256d, __m256d) -> __m256d
                            as usize,
                    }
                })*
                _ => return None,
            };
            Some(pair.address::<LANES>())
        }
    };
}

unary!(
    Exp exp, Ln ln, Sin sin, Cos cos, Tan tan, Asin asin, Acos acos, Atan atan, Sinh sinh,
    Cosh cosh, Tanh tanh
);
binary!(Pow pow, Atan2 atan2);

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
