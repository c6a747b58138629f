//! Against SciPy, and against sums over all that a reading may be.

use super::*;

#[test]
fn tails_are_those_of_the_normal_distribution() {
    for (a, weight, mean) in [
        (-12.0, 1.0, 2.146_383_735_663_072_8e-32),
        (-5.0, 0.999_999_713_348_428_1, 1.486_719_940_904_906e-6),
        (-1.0, 0.841_344_746_068_542_9, 0.287_599_970_939_178_4),
        (0.0, 0.5, 0.797_884_560_802_865_4),
        (1.9, 0.028_716_559_816_001_803, 2.284_946_915_476_738_6),
        (2.1, 0.017_864_420_562_816_542, 2.462_077_951_298_109_5),
        (5.0, 2.866_515_718_791_933e-7, 5.186_503_967_125_851_5),
        (40.0, 0.0, 40.024_968_847_210_886),
    ] {
        let tail = Tail::beyond(a);
        assert!(
            (tail.weight - weight).abs() <= 1e-13 * weight,
            "{a}: {tail:?}"
        );
        assert!((tail.mean - mean).abs() <= 1e-12 * mean, "{a}: {tail:?}");
        assert!((tail.mean - tail.excess - a).abs() <= 1e-12 * a.abs().max(1.0));
        assert!(
            (0.0..=1.0).contains(&tail.told()) && tail.left() > 0.0,
            "{a}"
        );
    }
    // at both sides of where one formula gives way to the other
    let [near, far] = [2.25 - 1e-12, 2.25].map(|a| Tail::beyond(a).excess);
    assert!((near - far).abs() < 1e-11, "{near} {far}");
}

const ALL: Limits = Limits {
    low: 0.0,
    high: 1.0,
};

/// Fisher's information, from the derivative of the probabilities (SciPy).
#[test]
fn a_clipped_reading_tells_what_fisher_says() {
    for (value, deviation, expected) in [
        (0.5, 0.1, 0.999_999_981_255_031_1),
        (0.95, 0.1, 0.917_163_715_979_974_6),
        (1.0, 0.1, 0.818_309_886_183_790_7),
        (1.2, 0.1, 0.133_714_950_478_381_94),
        (1.5, 0.1, 7.720_251_355_886_231e-6),
        (-0.3, 0.1, 0.014_665_111_097_355_419),
        (1.0, 0.7, 0.806_394_038_099_359_1),
        (2.0, 0.7, 0.304_220_656_464_218_86),
    ] {
        let found = ALL.information(value, deviation);
        assert!(
            (found / expected - 1.0).abs() < 1e-9,
            "{value}: {found} for {expected}"
        );
    }
    assert_eq!(
        (ALL.information(0.5, 0.0), ALL.information(2.0, 0.0)),
        (1.0, 0.0)
    );
    assert_eq!(ALL.information(0.5, 0.01), 1.0);
}

/// x of N(0.8, 0.02) is read with noise of variance 0.03 as 1, or more: mean and variance of x by
/// quadrature over x.
#[test]
fn a_reading_at_an_end_leaves_what_bayes_says() {
    for (mean, low) in [(0.8, false), (1.4, false), (0.3, true), (-0.2, true)] {
        let (spread, noise) = (0.02, 0.03);
        let end = if low { End::Low } else { End::High };
        let (innovation, own) = end.weighed(end.value(ALL) - mean, spread, noise).unwrap();
        let gain = spread / (spread + own);
        let found = (mean + gain * innovation, spread * (1.0 - gain));
        let (mut weight, mut first, mut second) = (0.0, 0.0, 0.0);
        for k in -4000..=4000 {
            let x = mean + f64::from(k) * 0.002 * spread.sqrt();
            let away = (end.value(ALL) - x) / noise.sqrt() * end.sign();
            let density = (-0.5 * (x - mean).powi(2) / spread).exp() * Tail::beyond(away).weight;
            weight += density;
            first += density * x;
            second += density * x * x;
        }
        let expected = first / weight;
        assert!(
            (found.0 - expected).abs() < 1e-9,
            "{found:?} for {expected}"
        );
        let variance = second / weight - expected * expected;
        assert!(
            (found.1 - variance).abs() < 1e-9,
            "{found:?} for {variance}"
        );
    }
}

/// Over all that a reading may be, by their probabilities, an innovation has mean 0 and the deviation
/// that is said; where the model expects the output beyond, over all that are not at that end.
#[test]
fn innovations_near_an_end_have_the_size_that_is_said() {
    let deviation = 0.1;
    for predicted in [0.5, 0.85, 1.0, 1.05, 1.3, -0.1, 0.02] {
        let (mut weight, mut first, mut second) = (0.0, 0.0, 0.0);
        for k in -90_000..=90_000 {
            let u = f64::from(k) * 1e-4;
            let reading = ALL.shown(predicted + deviation * u);
            let mut innovation = Innovation {
                value: reading - predicted,
                deviation,
                predicted,
                reading: Reading::Taken,
                ..Innovation::default()
            };
            judge_near_an_end(ALL, End::of(ALL, reading), &mut innovation);
            if innovation.reading == Reading::Taken {
                let density = (-0.5 * u * u).exp();
                let z = innovation.value / innovation.deviation;
                weight += density;
                first += density * z;
                second += density * z * z;
            }
        }
        let (first, second) = (first / weight, second / weight);
        assert!(
            first.abs() < 2e-3 && (second - 1.0).abs() < 5e-3,
            "{predicted}: {first} {second}"
        );
    }
}

/// Far from both ends nothing changes, not in the last digit.
#[test]
fn limits_out_of_reach_change_nothing() {
    let plain = Innovation {
        value: 0.03,
        deviation: 0.05,
        predicted: 0.47,
        reading: Reading::Taken,
        ..Innovation::default()
    };
    let mut innovation = plain;
    judge_near_an_end(ALL, End::of(ALL, 0.5), &mut innovation);
    assert_eq!(innovation, plain);
    assert_eq!(End::of(ALL, f64::NAN), None);
}

#[test]
fn what_is_expected_far_beyond_says_nothing() {
    assert_eq!(End::High.weighed(-1.0, 0.005, 0.005), None);
    assert_eq!(End::High.weighed(-1.0, 0.0, 0.0), None);
    assert_eq!(End::Low.weighed(-1.0, 0.0, 0.0), Some((-1.0, 0.0)));
    let (innovation, noise) = End::High.weighed(100.0, 0.5, 0.5).unwrap();
    assert!((innovation - 100.0).abs() < 0.02 && (noise - 0.5).abs() < 1e-3);
}
