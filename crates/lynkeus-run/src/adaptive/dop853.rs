//! The explicit method of Dormand and Prince of order 8 with its error estimate of orders 5
//! and 3 (DOP853 of Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I,
//! section II.10), with the interpolant of order 7 of the same book. Its three further stages are for
//! steps that may cross something: runs stop at every row.

use super::one_step::OneStep;
use crate::events::{Ahead, COEFFICIENTS, Filippov, Poly, Span};
use crate::method::{are_finite, resolution};
use crate::{Dynamics, Tolerances};

const STAGES: usize = 12;

/// Factors on a step after its error is known.
const SAFETY: f64 = 0.9;
const LEAST: f64 = 0.2;
const MOST: f64 = 10.0;
/// Factor on a step that leads beyond all numbers.
const FAR: f64 = 0.25;

/// Order of the local error of the step that is kept.
const ORDER: f64 = 8.0;

/// A coefficient with the stage it belongs to; zeros are left out.
type Row = &'static [(usize, f64)];

/// Nodes of the stages after the first.
const C: [f64; STAGES - 1] = [
    5.260_015_195_876_773E-2,
    7.890_022_793_815_16E-2,
    1.183_503_419_072_274E-1,
    2.816_496_580_927_726E-1,
    3.333_333_333_333_333E-1,
    0.25,
    3.076_923_076_923_077E-1,
    6.512_820_512_820_513E-1,
    0.6,
    8.571_428_571_428_571E-1,
    1.0,
];

/// What the stages after the first take of those before them.
const A: [Row; STAGES - 1] = [
    &[(0, 5.260_015_195_876_773E-2)],
    &[(0, 1.972_505_698_453_79E-2), (1, 5.917_517_095_361_37E-2)],
    &[(0, 2.958_758_547_680_685E-2), (2, 8.876_275_643_042_054E-2)],
    &[
        (0, 2.413_651_341_592_667E-1),
        (2, -8.845_494_793_282_861E-1),
        (3, 9.248_340_032_617_92E-1),
    ],
    &[
        (0, 3.703_703_703_703_703_5E-2),
        (3, 1.708_286_087_294_738_6E-1),
        (4, 1.254_676_875_668_224_2E-1),
    ],
    &[
        (0, 3.7109375E-2),
        (3, 1.702_522_110_195_440_5E-1),
        (4, 6.021_653_898_045_596E-2),
        (5, -1.7578125E-2),
    ],
    &[
        (0, 3.709_200_011_850_479E-2),
        (3, 1.703_839_257_122_399_8E-1),
        (4, 1.072_620_304_463_732_8E-1),
        (5, -1.531_943_774_862_440_2E-2),
        (6, 8.273_789_163_814_023E-3),
    ],
    &[
        (0, 6.241_109_587_160_757E-1),
        (3, -3.360_892_629_446_941_4),
        (4, -8.682_193_468_417_26E-1),
        (5, 2.759_209_969_944_671E1),
        (6, 2.015_406_755_047_789_4E1),
        (7, -4.348_988_418_106_996E1),
    ],
    &[
        (0, 4.776_625_364_382_643_4E-1),
        (3, -2.488_114_619_971_667_7),
        (4, -5.902_908_268_368_43E-1),
        (5, 2.123_005_144_818_119_3E1),
        (6, 1.527_923_363_288_242_3E1),
        (7, -3.328_821_096_898_486E1),
        (8, -2.033_120_170_850_862_7E-2),
    ],
    &[
        (0, -9.371_424_300_859_873E-1),
        (3, 5.186_372_428_844_064),
        (4, 1.091_437_348_996_729_5),
        (5, -8.149_787_010_746_927),
        (6, -1.852_006_565_999_696E1),
        (7, 2.273_948_709_935_050_5E1),
        (8, 2.493_605_552_679_652_3),
        (9, -3.046_764_471_898_219_6),
    ],
    &[
        (0, 2.273_310_147_516_538),
        (3, -1.053_449_546_673_725E1),
        (4, -2.000_872_058_224_862_5),
        (5, -1.795_893_186_311_88E1),
        (6, 2.794_888_452_941_996E1),
        (7, -2.858_998_277_135_023_5),
        (8, -8.872_856_933_530_63),
        (9, 1.236_056_717_579_430_3E1),
        (10, 6.433_927_460_157_636E-1),
    ],
];

/// The step that is kept.
const B: Row = &[
    (0, 5.429_373_411_656_876_5E-2),
    (5, 4.450_312_892_752_409),
    (6, 1.891_517_899_314_500_3),
    (7, -5.801_203_960_010_585),
    (8, 3.111_643_669_578_199E-1),
    (9, -1.521_609_496_625_161E-1),
    (10, 2.013_654_008_040_303_4E-1),
    (11, 4.471_061_572_777_259E-2),
];

/// Its difference from the embedded step of order 5.
const FIFTH: Row = &[
    (0, 1.312_004_499_419_488E-2),
    (5, -1.225_156_446_376_204_4),
    (6, -4.957_589_496_572_502E-1),
    (7, 1.664_377_182_454_986_4),
    (8, -3.503_288_487_499_736_6E-1),
    (9, 3.341_791_187_130_175E-1),
    (10, 8.192_320_648_511_571E-2),
    (11, -2.235_530_786_388_629_4E-2),
];

/// The embedded step of order 3.
const THIRD: Row = &[
    (0, 2.440_944_881_889_764E-1),
    (8, 7.338_466_882_816_118E-1),
    (11, 2.205_882_352_941_176_6E-2),
];

/// The derivative at the end of the step, and those of the further stages.
const FURTHER: usize = 4;

/// Nodes of the further stages.
const C_BETWEEN: [f64; FURTHER - 1] = [0.1, 0.2, 7.0 / 9.0];

/// What they take of the stages before them, the derivative at the end among them.
const A_BETWEEN: [Row; FURTHER - 1] = [
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

/// Working memory of the method; nothing is allocated from step to step.
#[derive(Clone, Debug)]
pub(super) struct Dop853 {
    /// the derivative at the start of the step, then those of the stages; those of the dense output,
    /// where they were needed
    slopes: [Vec<f64>; STAGES + FURTHER],
    stage: Vec<f64>,
    /// Σ bᵢ kᵢ
    segment: Vec<f64>,
    reached: Vec<f64>,
    /// a step before this one was rejected
    is_retry: bool,
    /// the last point at which a stage had no finite derivative
    bad: Option<(f64, Vec<f64>)>,
}

impl OneStep for Dop853 {
    fn new(dimension: usize) -> Self {
        Self {
            slopes: std::array::from_fn(|_| vec![0.0; dimension]),
            stage: vec![0.0; dimension],
            segment: vec![0.0; dimension],
            reached: vec![0.0; dimension],
            is_retry: false,
            bad: None,
        }
    }

    /// Every step begins with nothing but its state.
    fn restart(&mut self, _careful: bool) {}

    fn begin(&mut self, f: &mut dyn Dynamics, t: f64, x: &[f64]) -> bool {
        (self.is_retry, self.bad) = (false, None);
        f.derivatives(t, x, &mut self.slopes[0]);
        are_finite(&self.slopes[0])
    }

    fn reached(&self) -> &[f64] {
        &self.reached
    }

    fn bad(&self) -> Option<&(f64, Vec<f64>)> {
        self.bad.as_ref()
    }

    fn attempt(
        &mut self,
        f: &mut dyn Dynamics,
        (t, x): (f64, &[f64]),
        h: f64,
        tolerances: &Tolerances,
    ) -> Result<f64, f64> {
        for (i, (c, row)) in C.iter().zip(A).enumerate() {
            if !self.look(f, (t, x), h, (i + 1, *c, row)) {
                self.bad = Some((t + c * h, self.stage.clone()));
                return self.rejected(h * LEAST);
            }
        }
        combine(&mut self.segment, B, &self.slopes);
        self.reached.copy_from_slice(x);
        add(&mut self.reached, h, &self.segment);
        if !are_finite(&self.reached) {
            return self.rejected(h * FAR);
        }
        let error = self.error(x, h, tolerances);
        if error.is_nan() {
            return self.rejected(h * LEAST);
        }
        let factor = (SAFETY * error.powf(-1.0 / ORDER)).clamp(LEAST, MOST);
        if error > 1.0 {
            return self.rejected(h * factor);
        }
        // after a rejection the step does not grow at once
        let limit = if self.is_retry { 1.0 } else { MOST };
        Ok(h * factor.min(limit))
    }

    /// Section II.4 of the book.
    fn first_step(
        &mut self,
        f: &mut dyn Dynamics,
        (t, x): (f64, &[f64]),
        span: f64,
        tolerances: &Tolerances,
    ) -> f64 {
        let scale = |x: f64| tolerances.absolute + tolerances.relative * x.abs();
        let norm = |values: &[f64]| -> f64 {
            let parts = values.iter().zip(x).map(|(v, x)| (v / scale(*x)).powi(2));
            parts.fold(0.0, |sum, part| sum + part)
        };
        let (slope, size) = (norm(&self.slopes[0]), norm(x));
        let h = match slope <= 1e-10 || size <= 1e-10 {
            true => 1e-6,
            false => (size / slope).sqrt() * 0.01,
        };
        self.stage.copy_from_slice(x);
        add(&mut self.stage, h, &self.slopes[0]);
        let [first, second, ..] = &mut self.slopes;
        f.derivatives(t + h, &self.stage, second);
        add(second, -1.0, first);
        let curvature = norm(second).sqrt() / h;
        let fastest = slope.sqrt().max(curvature);
        let wanted = match fastest <= 1e-15 {
            true => h * 1e-3,
            false => (0.01 / fastest).powf(1.0 / ORDER),
        };
        // a guess that time does not resolve is too careful: it may be longer all the same
        let first = (h * 100.0).min(wanted).min(span);
        first.max(2.0 * resolution(t)).min(span)
    }

    fn ahead(&mut self, f: &mut Filippov<'_>, span: &Span<'_>) -> Option<Ahead> {
        if !f.is_near(span, |state| self.fastest(state)) {
            return None;
        }
        let ((t, x), h) = (span.from, span.step);
        Some(match self.look_inside(f, (t, x), h) {
            true => f.ahead(span, |state| self.between(state, x[state], h)),
            false => Ahead::Nothing,
        })
    }
}

impl Dop853 {
    fn rejected(&mut self, shorter: f64) -> Result<f64, f64> {
        self.is_retry = true;
        Err(shorter)
    }

    /// The estimate of the error over the step, in tolerances: 1 is just allowed.
    fn error(&mut self, x: &[f64], h: f64, tolerances: &Tolerances) -> f64 {
        let difference = &mut self.stage;
        combine(difference, FIFTH, &self.slopes);
        let fifth = squares(x, &self.reached, difference, tolerances);
        difference.copy_from_slice(&self.segment);
        for &(j, b) in THIRD {
            add(difference, -b, &self.slopes[j]);
        }
        let third = squares(x, &self.reached, difference, tolerances);
        let both = fifth + 0.01 * third;
        let both = if both <= 0.0 { 1.0 } else { both };
        h.abs() * fifth * (1.0 / (both * x.len() as f64)).sqrt()
    }

    /// The largest derivative of a state at any stage of the step tried last.
    fn fastest(&self, state: usize) -> f64 {
        let slopes = self.slopes[..STAGES].iter();
        let slopes = slopes.map(|slope| slope[state].abs());
        slopes.fold(0.0, f64::max)
    }

    /// Takes the derivative of a stage: its place, its node and what it takes of those before it. False
    /// where it is not finite.
    fn look(
        &mut self,
        f: &mut dyn Dynamics,
        (t, x): (f64, &[f64]),
        h: f64,
        (place, c, row): (usize, f64, Row),
    ) -> bool {
        self.stage.copy_from_slice(x);
        for &(j, a) in row {
            add(&mut self.stage, a * h, &self.slopes[j]);
        }
        f.derivatives(t + c * h, &self.stage, &mut self.slopes[place]);
        are_finite(&self.slopes[place])
    }

    /// Finds what is between the ends of the step tried last; false where a derivative is not finite.
    fn look_inside(&mut self, f: &mut dyn Dynamics, at: (f64, &[f64]), h: f64) -> bool {
        f.derivatives(at.0 + h, &self.reached, &mut self.slopes[STAGES]);
        let further = (STAGES + 1..).zip(C_BETWEEN.into_iter().zip(A_BETWEEN));
        let mut looks = further.map(|(place, (c, row))| self.look(f, at, h, (place, c, row)));
        looks.all(|is_finite| is_finite) && are_finite(&self.slopes[STAGES])
    }

    /// What a state is between the ends of a step, after [`Dop853::look_inside`].
    fn between(&self, state: usize, from: f64, h: f64) -> Poly {
        let slope = |j: usize| self.slopes[j][state];
        let rise = self.reached[state] - from;
        let (begins, ends) = (h * slope(0), h * slope(STAGES));
        let highest = D.map(|row| h * row.iter().map(|&(j, d)| d * slope(j)).sum::<f64>());
        let terms = [rise, begins - rise, 2.0 * rise - begins - ends];
        // terms[0]·s + terms[1]·s(1 − s) + terms[2]·s²(1 − s) + …, from the last to the first
        let mut c = [0.0; COEFFICIENTS];
        let backward = terms.iter().chain(&highest).rev();
        for (k, term) in (0..COEFFICIENTS - 1).rev().zip(backward) {
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

fn add(to: &mut [f64], factor: f64, values: &[f64]) {
    for (to, value) in to.iter_mut().zip(values) {
        *to += factor * value;
    }
}

fn combine(to: &mut [f64], row: Row, slopes: &[Vec<f64>]) {
    to.fill(0.0);
    for &(j, b) in row {
        add(to, b, &slopes[j]);
    }
}

/// Σ (error / tolerance)² over the states.
fn squares(from: &[f64], to: &[f64], errors: &[f64], tolerances: &Tolerances) -> f64 {
    let ends = from.iter().zip(to);
    let parts = ends.zip(errors).map(|((from, to), error)| {
        let scale = tolerances.absolute + tolerances.relative * from.abs().max(to.abs());
        (error / scale).powi(2)
    });
    parts.fold(0.0, |sum, part| sum + part)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Function;

    /// One step of x' = x·cos t against exp(sin t).
    fn error_of_a_step(h: f64) -> f64 {
        let mut f = Function::new(1, |t: f64, x: &[f64], dx: &mut [f64]| {
            dx[0] = x[0] * t.cos()
        });
        let loose = Tolerances {
            relative: 1.0,
            absolute: 1.0,
            ..Tolerances::default()
        };
        let mut method = Dop853::new(1);
        assert!(method.begin(&mut f, 0.0, &[1.0]));
        let tried = method.attempt(&mut f, (0.0, &[1.0]), h, &loose);
        assert!(tried.is_ok(), "{tried:?}");
        (method.reached()[0] - h.sin().exp()).abs()
    }

    #[test]
    fn the_local_error_is_of_order_nine() {
        let order = (error_of_a_step(0.8) / error_of_a_step(0.4)).log2();
        assert!((8.5..10.5).contains(&order), "{order}");
    }

    #[test]
    fn rows_sum_to_their_nodes() {
        for (row, c) in A.iter().zip(C) {
            let sum: f64 = row.iter().map(|(_, a)| a).sum();
            assert!((sum - c).abs() < 1e-13, "{sum} for {c}");
        }
        let total = |row: Row| row.iter().map(|(_, b)| b).sum::<f64>();
        assert!((total(B) - 1.0).abs() < 1e-14 && (total(THIRD) - 1.0).abs() < 1e-14);
        assert!(total(FIFTH).abs() < 1e-14);
    }

    #[test]
    fn a_stage_without_value_rejects_the_step() {
        let mut f = Function::new(1, |_, x: &[f64], dx: &mut [f64]| dx[0] = -x[0].sqrt());
        let mut method = Dop853::new(1);
        assert!(method.begin(&mut f, 0.0, &[1e-4]));
        let tried = method.attempt(&mut f, (0.0, &[1e-4]), 9.0, &Tolerances::default());
        assert_eq!(tried, Err(9.0 * LEAST));
        assert!(method.bad.take().is_some_and(|(_, x)| x[0] < 0.0));
        assert!(!method.begin(&mut f, 0.0, &[-1.0]));
    }

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
        assert!(method.attempt(&mut f, (0.0, &[1.0]), h, &loose).is_ok());
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
