//! Numbers side by side in registers of the processor, for the functions in lanes. All methods are inlined
//! into functions that are only called from code that was compiled for a processor with these instructions.

use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

use lynkeus_expr::lanes::Vector;

/// Four, with AVX2 and FMA.
#[derive(Clone, Copy)]
pub(crate) struct Four(pub __m256d);

/// Eight, with AVX-512 F and DQ.
#[derive(Clone, Copy)]
pub(crate) struct Eight(pub __m512d);

/// Methods of two vectors that are one instruction.
macro_rules! instructions {
    ($($name:ident $instruction:ident),*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> Self {
            // SAFETY: as the file says
            Self(unsafe { $instruction(self.0, other.0) })
        })*
    };
}

macro_rules! arithmetic {
    ($type:ident: $($trait:ident $name:ident $instruction:ident),*) => {
        $(impl $trait for $type {
            type Output = Self;
            instructions!($name $instruction);
        })*
    };
}

arithmetic!(Four: Add add _mm256_add_pd, Sub sub _mm256_sub_pd, Mul mul _mm256_mul_pd, Div div _mm256_div_pd);
arithmetic!(Eight: Add add _mm512_add_pd, Sub sub _mm512_sub_pd, Mul mul _mm512_mul_pd, Div div _mm512_div_pd);

impl Vector for Four {
    instructions!(and _mm256_and_pd, or _mm256_or_pd, xor _mm256_xor_pd, smaller _mm256_min_pd);

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        // SAFETY: as the file says
        Self(unsafe { _mm256_fmadd_pd(self.0, factor.0, term.0) })
    }

    #[inline(always)]
    fn splat(x: f64) -> Self {
        // SAFETY: as the file says
        Self(unsafe { _mm256_set1_pd(x) })
    }

    #[inline(always)]
    fn below(self, other: Self) -> Self {
        // SAFETY: as the file says
        Self(unsafe { _mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> Self {
        // SAFETY: as the file says
        Self(unsafe { _mm256_cmp_pd::<_CMP_LE_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn choose(mask: Self, yes: Self, no: Self) -> Self {
        // SAFETY: as the file says
        Self(unsafe { _mm256_blendv_pd(no.0, yes.0, mask.0) })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: as the file says
        Self(unsafe { _mm256_sqrt_pd(self.0) })
    }

    #[inline(always)]
    fn plus_bits(self, other: Self) -> Self {
        // SAFETY: as the file says
        Self(unsafe {
            let [x, y] = [self.0, other.0].map(|x| _mm256_castpd_si256(x));
            _mm256_castsi256_pd(_mm256_add_epi64(x, y))
        })
    }

    #[inline(always)]
    fn up<const N: i32>(self) -> Self {
        // SAFETY: as the file says
        Self(unsafe { _mm256_castsi256_pd(_mm256_slli_epi64::<N>(_mm256_castpd_si256(self.0))) })
    }

    #[inline(always)]
    fn down<const N: i32>(self) -> Self {
        // SAFETY: as the file says
        Self(unsafe { _mm256_castsi256_pd(_mm256_srli_epi64::<N>(_mm256_castpd_si256(self.0))) })
    }

    #[inline(always)]
    fn all(self) -> bool {
        self.set() == 15
    }

    #[inline(always)]
    fn rescued(self, inside: Self, arguments: [Self; 2], f: fn(f64, f64) -> f64) -> Self {
        if inside.all() {
            return self;
        }
        let [mut values, x, y] = [self, arguments[0], arguments[1]].map(Self::numbers);
        rescue(&mut values, inside.set(), &x, &y, f);
        // SAFETY: as the file says, and the array holds so many numbers
        Self(unsafe { _mm256_loadu_pd(values.as_ptr()) })
    }
}

impl Four {
    /// A bit for each lane whose sign is set.
    #[inline(always)]
    fn set(self) -> u8 {
        // SAFETY: as the file says
        unsafe { _mm256_movemask_pd(self.0) as u8 }
    }

    #[inline(always)]
    fn numbers(self) -> [f64; 4] {
        let mut numbers = [0.0; 4];
        // SAFETY: as the file says, and the array holds so many numbers
        unsafe { _mm256_storeu_pd(numbers.as_mut_ptr(), self.0) };
        numbers
    }
}

impl Vector for Eight {
    instructions!(and _mm512_and_pd, or _mm512_or_pd, xor _mm512_xor_pd, smaller _mm512_min_pd);

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        // SAFETY: as the file says
        Self(unsafe { _mm512_fmadd_pd(self.0, factor.0, term.0) })
    }

    #[inline(always)]
    fn splat(x: f64) -> Self {
        // SAFETY: as the file says
        Self(unsafe { _mm512_set1_pd(x) })
    }

    #[inline(always)]
    fn below(self, other: Self) -> Self {
        // SAFETY: as the file says
        Self(unsafe { spread(_mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, other.0)) })
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> Self {
        // SAFETY: as the file says
        Self(unsafe { spread(_mm512_cmp_pd_mask::<_CMP_LE_OQ>(self.0, other.0)) })
    }

    #[inline(always)]
    fn choose(mask: Self, yes: Self, no: Self) -> Self {
        // SAFETY: as the file says
        Self(unsafe { _mm512_mask_blend_pd(signs(mask.0), no.0, yes.0) })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: as the file says
        Self(unsafe { _mm512_sqrt_pd(self.0) })
    }

    #[inline(always)]
    fn plus_bits(self, other: Self) -> Self {
        // SAFETY: as the file says
        Self(unsafe {
            let [x, y] = [self.0, other.0].map(|x| _mm512_castpd_si512(x));
            _mm512_castsi512_pd(_mm512_add_epi64(x, y))
        })
    }

    #[inline(always)]
    fn up<const N: i32>(self) -> Self {
        // SAFETY: as the file says
        Self(unsafe {
            let by = _mm512_set1_epi64(i64::from(N));
            _mm512_castsi512_pd(_mm512_sllv_epi64(_mm512_castpd_si512(self.0), by))
        })
    }

    #[inline(always)]
    fn down<const N: i32>(self) -> Self {
        // SAFETY: as the file says
        Self(unsafe {
            let by = _mm512_set1_epi64(i64::from(N));
            _mm512_castsi512_pd(_mm512_srlv_epi64(_mm512_castpd_si512(self.0), by))
        })
    }

    #[inline(always)]
    fn all(self) -> bool {
        self.set() == 255
    }

    #[inline(always)]
    fn rescued(self, inside: Self, arguments: [Self; 2], f: fn(f64, f64) -> f64) -> Self {
        if inside.all() {
            return self;
        }
        let [mut values, x, y] = [self, arguments[0], arguments[1]].map(Self::numbers);
        rescue(&mut values, inside.set(), &x, &y, f);
        // SAFETY: as the file says, and the array holds so many numbers
        Self(unsafe { _mm512_loadu_pd(values.as_ptr()) })
    }
}

impl Eight {
    /// A bit for each lane whose sign is set.
    #[inline(always)]
    fn set(self) -> u8 {
        // SAFETY: as the file says
        unsafe { signs(self.0) }
    }

    #[inline(always)]
    fn numbers(self) -> [f64; 8] {
        let mut numbers = [0.0; 8];
        // SAFETY: as the file says, and the array holds so many numbers
        unsafe { _mm512_storeu_pd(numbers.as_mut_ptr(), self.0) };
        numbers
    }
}

/// A mask of eight lanes from its bits.
///
/// # Safety
/// The processor has AVX-512 F and DQ.
#[inline(always)]
unsafe fn spread(mask: __mmask8) -> __m512d {
    // SAFETY: by the caller's promise
    unsafe { _mm512_castsi512_pd(_mm512_movm_epi64(mask)) }
}

/// The signs of eight lanes.
///
/// # Safety
/// The processor has AVX-512 F and DQ.
#[inline(always)]
unsafe fn signs(mask: __m512d) -> __mmask8 {
    // SAFETY: by the caller's promise
    unsafe { _mm512_movepi64_mask(_mm512_castpd_si512(mask)) }
}

/// f(x, y) in the lanes whose bit of `inside` is not set.
#[cold]
#[inline(never)]
fn rescue<const N: usize>(
    values: &mut [f64; N],
    inside: u8,
    x: &[f64; N],
    y: &[f64; N],
    f: fn(f64, f64) -> f64,
) {
    for (lane, value) in values.iter_mut().enumerate() {
        if inside >> lane & 1 == 0 {
            *value = f(x[lane], y[lane]);
        }
    }
}
