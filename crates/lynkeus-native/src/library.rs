//! What compiled code calls: the functions that the interpreter calls, too, over `Reals` for one
//! lane and over `Lanes` for more.

use std::arch::x86_64::{__m256d, __m512d};

use lynkeus_expr::{Algebra, Binary, Reals, Unary, lanes};

use crate::vectors::{Eight, Four};

/// The address of the library's function for one lane, of that of lanes for more; by a macro because
/// each has to be a function of its own. Arguments and result go by vector registers.
macro_rules! address {
    ($method:ident($op:expr), $function:ident($($x:ident),+)) => {{
        extern "sysv64" fn scalar($($x: f64),+) -> f64 {
            Reals.$method($op, $(&$x),+)
        }
        // with AVX the System V ABI passes it in a register
        #[allow(improper_ctypes_definitions)]
        #[target_feature(enable = "avx2,fma")]
        extern "sysv64" fn four($($x: __m256d),+) -> __m256d {
            lanes::$function($(Four($x)),+).0
        }
        #[allow(improper_ctypes_definitions)]
        #[target_feature(enable = "avx512f,avx512dq")]
        extern "sysv64" fn eight($($x: __m512d),+) -> __m512d {
            lanes::$function($(Eight($x)),+).0
        }
        Some(match LANES {
            1 => scalar as *const () as usize,
            8 => eight as *const () as usize,
            _ => four as *const () as usize,
        })
    }};
}

/// The address of a function of one value; none where code is emitted for it.
pub(crate) fn unary<const LANES: usize>(op: Unary) -> Option<usize> {
    match op {
        Unary::Exp => address!(unary(Unary::Exp), exp(x)),
        Unary::Ln => address!(unary(Unary::Ln), ln(x)),
        Unary::Sin => address!(unary(Unary::Sin), sin(x)),
        Unary::Cos => address!(unary(Unary::Cos), cos(x)),
        Unary::Tan => address!(unary(Unary::Tan), tan(x)),
        Unary::Asin => address!(unary(Unary::Asin), asin(x)),
        Unary::Acos => address!(unary(Unary::Acos), acos(x)),
        Unary::Atan => address!(unary(Unary::Atan), atan(x)),
        Unary::Sinh => address!(unary(Unary::Sinh), sinh(x)),
        Unary::Cosh => address!(unary(Unary::Cosh), cosh(x)),
        Unary::Tanh => address!(unary(Unary::Tanh), tanh(x)),
        Unary::Neg | Unary::Abs | Unary::Sign | Unary::Floor | Unary::Sqrt | Unary::Not => None,
    }
}

/// The address of a function of two values; none where code is emitted for it.
pub(crate) fn binary<const LANES: usize>(op: Binary) -> Option<usize> {
    match op {
        Binary::Pow => address!(binary(Binary::Pow), pow(x, y)),
        Binary::Atan2 => address!(binary(Binary::Atan2), atan2(x, y)),
        _ => None,
    }
}

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
