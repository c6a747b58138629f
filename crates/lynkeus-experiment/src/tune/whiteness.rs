//! How much of a series can be foretold from its past.

/// Most lags that are looked at.
const MOST_LAGS: usize = 20;

/// The half-width of the band that 95 % of a white series' autocorrelations lie in, times √n.
const BAND: f64 = 1.959_964;

/// What the autocorrelations of a series say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Whiteness {
    /// the statistic of Ljung and Box over its number of lags: about 1 for a white series
    pub ljung_box: f64,
    /// share of the lags whose autocorrelation is outside the 95 % band: about 0.05 for a white series
    pub outside: f64,
}

/// The whiteness of a series around zero (a mean that is not zero can be foretold as well), over
/// lags 1 to 20, or a fifth of its length if that is less. None for a series too short or all zero.
pub fn whiteness(series: &[f64]) -> Option<Whiteness> {
    let n = series.len();
    let correlations = autocorrelations(series, MOST_LAGS)?;
    let lags = correlations.len();
    let band = band(n);
    let outside = correlations.iter().filter(|r| r.abs() > band).count();
    let terms = correlations.iter().zip(1..);
    let sum: f64 = terms.map(|(r, lag)| r * r / (n - lag) as f64).sum();
    Some(Whiteness {
        ljung_box: (n * (n + 2)) as f64 * sum / lags as f64,
        outside: outside as f64 / lags as f64,
    })
}

/// Autocorrelations of a series around zero at lags from 1 to this one, or to a fifth of its length if that is less.
/// None for a series too short or all zero.
pub fn autocorrelations(series: &[f64], most: usize) -> Option<Vec<f64>> {
    let lags = most.min(series.len() / 5);
    let power: f64 = series.iter().map(|x| x * x).sum();
    if lags == 0 || power.is_nan() || power <= 0.0 {
        return None;
    }
    let correlation = |lag: usize| {
        let pairs = series.iter().zip(series.iter().skip(lag));
        pairs.map(|(a, b)| a * b).sum::<f64>() / power
    };
    Some((1..=lags).map(correlation).collect())
}

/// 95 % of the autocorrelations of a white series of this length are no further from zero.
pub fn band(length: usize) -> f64 {
    BAND / (length as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers that look random: a linear congruential generator.
    fn noise(n: usize) -> Vec<f64> {
        let mut state = 42_u64;
        let mut draw = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        (0..n).map(|_| draw()).collect()
    }

    #[test]
    fn noise_is_white_and_its_running_mean_is_not() {
        let white = noise(5000);
        let found = whiteness(&white).unwrap();
        assert!((0.4..1.9).contains(&found.ljung_box), "{found:?}");
        assert!(found.outside <= 0.2, "{found:?}");
        let smooth: Vec<f64> = white.windows(5).map(|w| w.iter().sum()).collect();
        let found = whiteness(&smooth).unwrap();
        assert!(found.ljung_box > 100.0 && found.outside >= 0.2, "{found:?}");
    }

    #[test]
    fn a_first_order_process_has_its_autocorrelation() {
        let mut x = 0.0;
        let series: Vec<f64> = noise(20_000)
            .into_iter()
            .map(|w| {
                x = 0.5 * x + w;
                x
            })
            .collect();
        // Σ 0.25^k over n/20 lags: n/20 · 1/3
        let expected = 20_000.0 / 20.0 / 3.0;
        let found = whiteness(&series).unwrap().ljung_box;
        assert!((found / expected - 1.0).abs() < 0.1, "{found}");
    }

    #[test]
    fn a_bias_is_not_white_and_nothing_is_nothing() {
        let biased: Vec<f64> = noise(500).into_iter().map(|x| x + 0.3).collect();
        assert!(whiteness(&biased).unwrap().ljung_box > 20.0);
        assert_eq!(whiteness(&[0.0; 100]), None);
        assert_eq!(whiteness(&[1.0, -1.0]), None);
    }
}
