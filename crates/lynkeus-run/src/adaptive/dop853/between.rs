//! What the explicit method has between the ends of a step: the interpolant of order 7 of the same
//! book, with three further stages.

use super::{Dop853, Row, STAGES, finite};
use crate::Dynamics;
use crate::relays::{COEFFICIENTS, Poly};

/// The derivative at the end of the step, and those of the further stages.
pub(super) const FURTHER: usize = 4;

/// Nodes of the further stages.
const C: [f64; FURTHER - 1] = [0.1, 0.2, 7.0 / 9.0];

/// What they take of the stages before them, the derivative at the end among them.
const A: [Row; FURTHER - 1] = [
    &[
        (0, 0.056_167_502_283_047_954),
        (6, 0.253_500_210_216_624_83),
        (7, -0.246_239_037_470_802_5),
        (8, -0.124_191_423_263_816_37),
        (9, 0.153_291_798_278_765_68),
        (10, 0.008_201_052_295_634_69),
        (11, 0.007_567_897_660_545_699),
        (12, -0.008_298),
    ],
    &[
        (0, 0.031_834_648_163_502_14),
        (5, 0.028_300_909_672_366_776),
        (6, 0.053_541_988_307_438_566),
        (7, -0.054_923_748_571_390_99),
        (10, -0.000_108_347_328_697_249_32),
        (11, 0.000_382_571_090_835_658_4),
        (12, -0.000_340_465_008_687_404_56),
        (13, 0.141_312_443_674_632_5),
    ],
    &[
        (0, -0.428_896_301_583_791_94),
        (5, -4.697_621_415_361_164),
        (6, 7.683_421_196_062_599),
        (7, 4.068_989_818_397_11),
        (8, 0.356_727_187_455_281_1),
        (12, -0.001_399_024_165_159_014_5),
        (13, 2.947_514_789_152_772_4),
        (14, -9.150_958_472_179_87),
    ],
];

/// The highest four terms.
const D: [Row; 4] = [
    &[
        (0, -8.428_938_276_109_013),
        (5, 0.566_714_953_519_377_7),
        (6, -3.068_949_945_949_891_7),
        (7, 2.384_667_656_512_07),
        (8, 2.117_034_582_445_028),
        (9, -0.871_391_583_777_973),
        (10, 2.240_437_430_260_788_3),
        (11, 0.631_578_778_769_468_8),
        (12, -0.088_990_336_451_333_31),
        (13, 18.148_505_520_854_727),
        (14, -9.194_632_392_478_356),
        (15, -4.436_036_387_594_894),
    ],
    &[
        (0, 10.427_508_642_579_134),
        (5, 242.283_491_775_258_17),
        (6, 165.200_451_717_270_28),
        (7, -374.546_754_722_690_2),
        (8, -22.113_666_853_125_306),
        (9, 7.733_432_668_472_264),
        (10, -30.674_084_731_089_398),
        (11, -9.332_130_526_430_229),
        (12, 15.697_238_121_770_845),
        (13, -31.139_403_219_565_178),
        (14, -9.352_924_358_844_48),
        (15, 35.816_841_486_394_08),
    ],
    &[
        (0, 19.985_053_242_002_433),
        (5, -387.037_308_749_351_8),
        (6, -189.178_138_195_167_58),
        (7, 527.808_159_205_423_6),
        (8, -11.573_902_539_959_63),
        (9, 6.881_232_694_696_3),
        (10, -1.000_605_096_691_083_8),
        (11, 0.777_713_779_805_344_3),
        (12, -2.778_205_752_353_508),
        (13, -60.196_695_231_264_12),
        (14, 84.320_405_506_677_16),
        (15, 11.992_291_136_182_79),
    ],
    &[
        (0, -25.693_933_462_703_75),
        (5, -154.189_748_690_236_43),
        (6, -231.529_379_176_045_5),
        (7, 357.639_117_910_614_1),
        (8, 93.405_324_183_624_32),
        (9, -37.458_323_136_451_63),
        (10, 104.099_649_508_962_3),
        (11, 29.840_293_426_660_5),
        (12, -43.533_456_590_011_14),
        (13, 96.324_553_959_188_28),
        (14, -39.177_261_675_615_44),
        (15, -149.726_836_257_985_64),
    ],
];

impl Dop853 {
    /// The largest derivative of a state at any stage of the step tried last.
    pub fn fastest(&self, state: usize) -> f64 {
        let slopes = self.slopes.iter().map(|slope| slope[state].abs());
        slopes.fold(0.0, f64::max)
    }

    /// Finds what is between the ends of the step tried last; false where a derivative is not finite.
    pub fn look_inside(&mut self, f: &mut impl Dynamics, (t, x): (f64, &[f64]), h: f64) -> bool {
        for slope in &mut self.further {
            slope.resize(x.len(), 0.0);
        }
        let [end, ..] = &mut self.further;
        f.derivatives(t + h, &self.reached, end);
        for (i, (c, row)) in C.iter().zip(A).enumerate() {
            self.stage.copy_from_slice(x);
            for &(j, a) in row {
                let slope = self
                    .slopes
                    .get(j)
                    .unwrap_or_else(|| &self.further[j - STAGES]);
                super::add(&mut self.stage, a * h, slope);
            }
            f.derivatives(t + c * h, &self.stage, &mut self.further[i + 1]);
        }
        self.further.iter().all(|slope| finite(slope))
    }

    /// What a state is between the ends of a step, after [`Dop853::look_inside`].
    pub fn between(&self, state: usize, from: f64, h: f64) -> Poly {
        let slope = |j: usize| match self.slopes.get(j) {
            Some(slope) => slope[state],
            None => self.further[j - STAGES][state],
        };
        let rise = self.reached[state] - from;
        let (begins, ends) = (h * slope(0), h * slope(STAGES));
        let mut terms = [
            rise,
            begins - rise,
            2.0 * rise - begins - ends,
            0.0,
            0.0,
            0.0,
            0.0,
        ];
        for (term, row) in terms[3..].iter_mut().zip(D) {
            *term = h * row.iter().map(|&(j, d)| d * slope(j)).sum::<f64>();
        }
        // terms[0]·s + terms[1]·s(1 − s) + terms[2]·s²(1 − s) + …, from the last to the first
        let mut c = [0.0; COEFFICIENTS];
        for (k, term) in terms.iter().enumerate().rev() {
            c[0] += term;
            let before = c;
            for i in (0..COEFFICIENTS).rev() {
                let lower = if i == 0 { 0.0 } else { before[i - 1] };
                c[i] = if k % 2 == 0 { lower } else { before[i] - lower };
            }
        }
        c[0] += from;
        Poly(c)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Dop853, Tried};
    use crate::{Dynamics, Function, Tolerances};

    /// The largest error between the ends of a step of x' = x·cos t, against exp(sin t).
    fn error_between(h: f64) -> f64 {
        let mut f = Function::new(1, |t: f64, x: &[f64], dx: &mut [f64]| {
            dx[0] = x[0] * t.cos()
        });
        assert_eq!(f.dimension(), 1);
        let loose = Tolerances {
            relative: 1.0,
            absolute: 1.0,
            ..Tolerances::default()
        };
        let mut method = Dop853::new(1);
        assert!(method.begin(&mut f, 0.0, &[1.0]));
        let tried = method.attempt(&mut f, (0.0, &[1.0]), h, &loose, &mut None);
        assert!(matches!(tried, Tried::Accepted(_)));
        assert!(method.look_inside(&mut f, (0.0, &[1.0]), h));
        let between = method.between(0, 1.0, h);
        let error = |k: i32| {
            let s = f64::from(k) / 50.0;
            (between.at(s) - (s * h).sin().exp()).abs()
        };
        (0..=50).map(error).fold(0.0, f64::max)
    }

    #[test]
    fn what_is_between_the_ends_is_of_order_eight() {
        let order = (error_between(0.8) / error_between(0.4)).log2();
        assert!((7.2..9.5).contains(&order), "{order}");
        assert!(error_between(0.2) < 1e-8);
    }
}
