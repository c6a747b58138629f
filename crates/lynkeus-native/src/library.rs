//! What compiled code calls: the functions that the interpreter calls, too, over `Reals` for one
//! lane and over `Lanes` for four.

use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

use lynkeus_expr::lanes::Vector;
use lynkeus_expr::{Algebra, Binary, Reals, Unary, lanes};

/// The address of the library's function for one lane, of that of lanes for four; by a macro because
/// each has to be a function of its own. Arguments and result go by vector registers, one number or
/// four in each.
macro_rules! address {
    ($method:ident($op:expr), $function:ident($($x:ident),+)) => {{
        extern "sysv64" fn scalar($($x: f64),+) -> f64 {
            Reals.$method($op, $(&$x),+)
        }
        // with AVX the System V ABI passes it in a register
        #[allow(improper_ctypes_definitions)]
        #[target_feature(enable = "avx2,fma")]
        extern "sysv64" fn side_by_side($($x: __m256d),+) -> __m256d {
            lanes::$function($(Avx($x)),+).0
        }
        Some(match LANES {
            1 => scalar as *const () as usize,
            _ => side_by_side as *const () as usize,
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

/// To be used where the processor has AVX2 and FMA: by functions that are only called from code that was
/// compiled for it. Everything is inlined there.
#[derive(Clone, Copy)]
struct Avx(__m256d);

macro_rules! arithmetic {
    ($($trait:ident $name:ident $instruction:ident),*) => {
        $(impl $trait for Avx {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                // SAFETY: the processor has AVX2
                Self(unsafe { $instruction(self.0, other.0) })
            }
        })*
    };
}

arithmetic!(Add add _mm256_add_pd, Sub sub _mm256_sub_pd, Mul mul _mm256_mul_pd, Div div _mm256_div_pd);

macro_rules! bitwise {
    ($($name:ident $instruction:ident),*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> Self {
            // SAFETY: the processor has AVX2
            Self(unsafe { $instruction(self.0, other.0) })
        })*
    };
}

impl Vector for Avx {
    bitwise!(and _mm256_and_pd, or _mm256_or_pd, xor _mm256_xor_pd);

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        // SAFETY: the processor has FMA
        Self(unsafe { _mm256_fmadd_pd(self.0, factor.0, term.0) })
    }

    #[inline(always)]
    fn splat(x: f64) -> Self {
        // SAFETY: the processor has AVX2
        Self(unsafe { _mm256_set1_pd(x) })
    }

    #[inline(always)]
    fn below(self, other: Self) -> Self {
        // SAFETY: the processor has AVX2
        Self(unsafe { _mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> Self {
        // SAFETY: the processor has AVX2
        Self(unsafe { _mm256_cmp_pd::<_CMP_LE_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn choose(mask: Self, yes: Self, no: Self) -> Self {
        // SAFETY: the processor has AVX2
        Self(unsafe { _mm256_blendv_pd(no.0, yes.0, mask.0) })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: the processor has AVX2
        Self(unsafe { _mm256_sqrt_pd(self.0) })
    }

    #[inline(always)]
    fn plus_bits(self, other: Self) -> Self {
        // SAFETY: the processor has AVX2
        Self(unsafe {
            let [x, y] = [self.0, other.0].map(|x| _mm256_castpd_si256(x));
            _mm256_castsi256_pd(_mm256_add_epi64(x, y))
        })
    }

    #[inline(always)]
    fn up<const N: i32>(self) -> Self {
        // SAFETY: the processor has AVX2
        Self(unsafe { _mm256_castsi256_pd(_mm256_slli_epi64::<N>(_mm256_castpd_si256(self.0))) })
    }

    #[inline(always)]
    fn down<const N: i32>(self) -> Self {
        // SAFETY: the processor has AVX2
        Self(unsafe { _mm256_castsi256_pd(_mm256_srli_epi64::<N>(_mm256_castpd_si256(self.0))) })
    }

    #[inline(always)]
    fn all(self) -> bool {
        // SAFETY: the processor has AVX2
        unsafe { _mm256_movemask_pd(self.0) == 15 }
    }

    #[inline(always)]
    fn rescued(self, inside: Self, arguments: [Self; 2], f: fn(f64, f64) -> f64) -> Self {
        if inside.all() {
            return self;
        }
        let [mut values, x, y] = [self, arguments[0], arguments[1]].map(Self::numbers);
        // SAFETY: the processor has AVX2
        let inside = unsafe { _mm256_movemask_pd(inside.0) };
        rescue(&mut values, inside, &x, &y, f);
        // SAFETY: the processor has AVX2, and the array holds four numbers
        Self(unsafe { _mm256_loadu_pd(values.as_ptr()) })
    }
}

impl Avx {
    #[inline(always)]
    fn numbers(self) -> [f64; 4] {
        let mut numbers = [0.0; 4];
        // SAFETY: the processor has AVX2, and the array holds four numbers
        unsafe { _mm256_storeu_pd(numbers.as_mut_ptr(), self.0) };
        numbers
    }
}

/// f(x, y) in the lanes whose bit of `inside` is not set.
#[cold]
#[inline(never)]
fn rescue(values: &mut [f64; 4], inside: i32, x: &[f64; 4], y: &[f64; 4], f: fn(f64, f64) -> f64) {
    for (lane, value) in values.iter_mut().enumerate() {
        if inside >> lane & 1 == 0 {
            *value = f(x[lane], y[lane]);
        }
    }
}
