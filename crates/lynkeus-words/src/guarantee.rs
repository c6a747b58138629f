//! The certificate by linear matrix inequalities.

use crate::{counted, declare, short};
use lynkeus_observers::Inequality;
use lynkeus_observers::guarantee::{Obstacle, Said};

use crate::Words;

impl Words for Inequality {
    fn words(&self) -> String {
        let words = match self {
            Self::StatesAreTheEstimate => "the observer's states are the estimate",
            Self::SlopesAreBounded => "every slope of a nonlinear term is bounded on the box",
            Self::OneLyapunovFunction => "one Lyapunov function eᵀPe for the whole box",
            Self::SmallErrorsDecay => "small errors decay wherever the plant stays in the box",
        };
        words.to_owned()
    }
}

impl Words for Said {
    fn words(&self) -> String {
        match self {
            Self::OtherStates { states, estimated } => format!(
                "the observer has {} for {estimated} to be estimated: its gain is a state, or its coordinates are not the plant's; see what its theorem says",
                counted(*states, "state")
            ),
            Self::SlopesEnclosed(count) => format!("{} enclosed", counted(*count, "slope")),
            Self::Unbounded { term, undeclared } => {
                let cure = declare(undeclared, "it jumps or its derivative is infinite at the edge of the box: tighten min and max");
                format!("the slope of {term} has no bound; {cure}")
            }
            Self::Holds { rate, slopes } => format!(
                "He(P J) + 2·{}·P < 0{}, by interval Cholesky factorisation",
                short(*rate),
                for_slopes(*slopes)
            ),
            Self::HoldsTogether { rate, parts } => format!(
                "He(P J) + 2·{}·P < 0 with the slopes as they are together at each point of the box, in {} of it, by interval Cholesky factorisation",
                short(*rate),
                counted(*parts, "part")
            ),
            Self::Unstable(point) => format!(
                "there is none in these coordinates: the largest real part of an eigenvalue of the error's Jacobian is {}. This refutes no convergence: the plant is not seen to rest at such a point, and while it moves the Jacobian changes",
                point.words()
            ),
            Self::NotFound { slopes } => format!("none was found{}", for_slopes(*slopes)),
            Self::StableEverywhere { slowest } => format!(
                "at every point examined the error's Jacobian is stable, the slowest mode decaying at {}",
                short(*slowest)
            ),
            Self::HoldsForShare(share) => format!(
                "the inequality holds once every slope's range is cut to {:.0} % about its middle: a smaller box would do",
                100.0 * share
            ),
            Self::FasterSought(spent) => format!("a faster rate was sought: {spent}"),
            Self::NoUltimateBound => "no ultimate bound: what acts on the plant unknown to the observer, or a measurement error, has no bound".to_owned(),
            Self::StaysNear => "holds while plant and estimate stay in the box; an estimate that starts near the plant stays near it".to_owned(),
            Self::ShowsNoState(output) => format!(
                "the output {output} is not one state times a number: a measurement that follows the model between samples is proved for such outputs only"
            ),
            Self::NoInterval => "no interval was found for which one Lyapunov function holds between samples".to_owned(),
            Self::LongerSought(spent) => format!("a longer interval was sought: {spent}"),
            Self::GrowsEverywhere => "whatever the plant does, the error obeys e' = A e with the same A everywhere, which has an eigenvalue with a positive real part, by interval arithmetic".to_owned(),
            Self::Repelling => "the plant can rest at this point, with these inputs, and there the error's Jacobian has an eigenvalue with a positive real part, both by interval arithmetic: the estimate leaves the plant, however close it starts".to_owned(),
            Self::NoGainUnbounded { term, undeclared } => {
                let cure = declare(undeclared, "tighten its range");
                format!("the slope of {term} has no bound on the box; {cure}")
            }
            Self::BeyondLimit { rate, limit, least } => format!(
                "the rate {rate} needs larger gains than {limit}: the smallest largest entry found is {least:.4}; raise gain_limit or lower rate"
            ),
            Self::NotReached { rate, obstacle } => format!(
                "no gain is proved to reach {rate} on the box: {}",
                obstacle.words()
            ),
        }
    }
}

fn for_slopes(count: usize) -> String {
    match count {
        0 => String::new(),
        1 => " for the one slope within its range".to_owned(),
        count => format!(" for all {count} slopes within their ranges"),
    }
}

impl Words for Obstacle {
    fn words(&self) -> String {
        let (share, alone) = match self {
            Self::TakesLonger => {
                return "which range stands in the way takes longer to find out: narrow the box or lower the rate".to_owned();
            }
            Self::Middle => {
                return "not even the linearisation in the middle of the box reaches it: a state leaves too weak a trace in the outputs, or the rate is beyond what they allow".to_owned();
            }
            Self::Ranges { share, alone } => (100.0 * share, alone),
        };
        let blocked = alone.as_ref().map(|slope| {
            let over = match slope.variables.is_empty() {
                true => String::new(),
                false => format!(" (over the range of {})", slope.variables.join(", ")),
            };
            format!(
                "the slope of {} in [{}, {}]{over} alone blocks it; ",
                slope.term,
                short(slope.range.lo()),
                short(slope.range.hi())
            )
        });
        format!(
            "{}with every slope's range cut to {share:.0} % about its middle there is a gain: narrow the box",
            blocked.unwrap_or_default()
        )
    }
}
