//! The family `drift-observable`, after Germani and Manes.

use crate::short;
use lynkeus_observers::drift_observable::{Known, Said};
use lynkeus_observers::{Germani, fit_word};
use lynkeus_structure::Standing;
use lynkeus_structure::output_map::Degree;

use crate::Words;

/// Index vectors that are told.
const TOLD: usize = 4;

impl Words for Germani {
    fn words(&self) -> String {
        let words = match self {
            Self::Degree => "the observation relative degree r is known (Definition 2.2)",
            Self::Regular => "Q(x) is regular on the box (drift-observable)",
            Self::OneToOne => {
                "the map to the outputs' derivatives is one-to-one on the box (Definition 2.1)"
            }
            Self::Continuous => {
                "the map to the outputs' derivatives has values on the box and does not jump"
            }
            Self::SmallInput => "r = n, or the input is small (Theorem 3.3)",
            Self::UniformlyObservable => {
                "Q̄(x, U) is regular on the box for every U (uniformly observable)"
            }
            Self::RegularWithin => "Q̄(x, U) is regular on the box for U within its bounds",
            Self::ContinuousRows => "the last rows have values on the box and do not jump",
            Self::InputDerivatives => "the derivatives of the inputs are bounded",
            Self::Inverse => {
                "the map from x to the output's derivatives has a Lipschitz inverse on the box"
            }
            Self::LastRows => "the last rows are Lipschitz in these coordinates",
            Self::Gains => "K and P solve the Riccati inequality",
            Self::Riccati => "γ ≤ γ*: K and some P > 0 solve the Riccati inequality",
            Self::Input => "|u| ≤ u_M",
            Self::Filter => "K2 and P_a solve (4.27)",
            Self::OneFunction => {
                "one Lyapunov function e_zᵀP⁻¹e_z of the outputs' derivatives for the whole box"
            }
        };
        words.to_owned()
    }
}

impl Words for Said {
    fn words(&self) -> String {
        match self {
            Self::Form {
                variant,
                map,
                inputs,
                indices,
                others,
            } => form(variant, map, inputs) + &told(indices, others),
            Self::Blind { rank, of, hidden } => {
                let advice = match hidden.is_empty() {
                    true => "the rest shows only where the inputs are not zero; write the model around an operating point, u = u0 + du with the input du".to_owned(),
                    false => format!("no measured output feels {}; measure more", hidden.join(", ")),
                };
                format!(
                    "with u = 0 the outputs and their derivatives determine {rank} of {of} combinations of states: {advice}"
                )
            }
            Self::Degrees { found, are_proved } => {
                let one = |(y, degree): &(String, _)| degree_of(y, degree);
                let mut found: Vec<String> = found.iter().map(one).collect();
                if found.is_empty() {
                    found.push("no known input".to_owned());
                }
                if !are_proved {
                    found.push("zeros before r are found at points, not proved".to_owned());
                }
                found.join("; ")
            }
            Self::InputsNotCounted => "the input appears before the n-th derivative of the output and (3.1) takes no account of it: it converges for u_M ≤ β λ_min(P) only; variant = \"theoretical\" or \"practical\" does not need that".to_owned(),
            Self::Inputs {
                reason,
                bounds,
                is_proved,
            } => {
                let mut text = reason.words();
                if !bounds.is_empty() {
                    let one = |(name, bound): &(String, f64)| format!("|{name}| ≤ {}", short(*bound));
                    let bounds: Vec<String> = bounds.iter().map(one).collect();
                    text += &format!("; for {}, as `input_derivatives` bounds them", bounds.join(", "));
                }
                if !is_proved {
                    text += "; small and slow inputs keep it regular (Theorem 2.4), the column rcond and its flag tell";
                }
                text
            }
            Self::InputDerivatives(open) => match open.is_empty() {
                true => "assumed, as the study gives them".to_owned(),
                false => format!(
                    "no bound of the derivatives of {}: give the key 'input_derivatives', in [observer] or in [certify]",
                    open.join(", ")
                ),
            },
            Self::OnlyOfTheProof(found) => format!("{} ({})", found.reason.words(), found.verdict.words()),
            Self::Map { map, inverse } => {
                format!("γ_Φ = {}, γ_Φ⁻¹ = {}", short(*map), short(*inverse))
            }
            Self::NoInverse(open) => format!(
                "the means of its Jacobian over lines in the box are not known to be regular: {}",
                open_or(open, "take a smaller box")
            ),
            Self::LastRows(γ) => format!("γ = {}", short(*γ)),
            Self::NoLastRows(open) => open_or(open, "the inverse has no bound"),
            Self::NoLipschitzConstant => "γ has no bound".to_owned(),
            Self::NoPoles => "the study gives neither poles nor alpha and gamma".to_owned(),
            Self::Falls { rate, parts } => format!(
                "V' ≤ −2·{}·V for Q and the slopes of the last rows as they are together at each point of the box, in {parts} parts of it",
                short(*rate)
            ),
            Self::NoP => "no P was found for these poles".to_owned(),
            Self::NoFilterP => "no P_a was found for the filter's poles".to_owned(),
            Self::Indices(outputs) => {
                let outputs: Vec<String> = outputs.iter().map(|(y, μ)| format!("{y} {μ}")).collect();
                format!(
                    "derivatives used of each output: {}; the key 'indices' decides otherwise",
                    outputs.join(", ")
                )
            }
            Self::ExactDerivatives(names) => format!(
                "the theoretical observer needs {} exactly, which a simulation has; a log needs columns of them (`input_derivatives` of [estimate]) or the `generator` of the input, or variant = \"practical\"",
                names.join(", ")
            ),
            Self::SmallInputsOnly => {
                "the bounded variant converges for small inputs only (Theorem 3.3)".to_owned()
            }
            Self::Box { with_filter } => {
                let text = "taken for granted, not proved: plant and estimate stay in the box";
                match with_filter {
                    true => format!("{text}, and so do the filter's estimates of the inputs and of their derivatives; the bound holds once the filter has settled, at the same rate"),
                    false => text.to_owned(),
                }
            }
            Self::TakenAsConstant(names) => format!(
                "taken as constant: {}; bounds of rates of change go under `slew` in [certify]",
                names.join(", ")
            ),
            Self::Withdrawn => "where the column rcond is below 6·10⁻⁴ the tool withdraws a part of the correction, and the theorem says nothing".to_owned(),
        }
    }
}

fn form(variant: &str, map: &[String], inputs: &[String]) -> String {
    let inputs = match inputs.is_empty() {
        true => "free of the inputs (r = n)".to_owned(),
        false => format!("which read {}", inputs.join(", ")),
    };
    format!(
        "the state from {}, {inputs}; variant {variant}",
        map.join(", ")
    )
}

/// The chosen indices and the others; nothing where there is no choice.
fn told(chosen: &[usize], others: &[(Vec<usize>, Known)]) -> String {
    if others.is_empty() {
        return String::new();
    }
    let one = |(indices, known): &(Vec<usize>, Known)| {
        let known = match *known {
            Known::Examined(Standing::Proved) => "fits, too",
            Known::Examined(fit) => fit_word(fit),
            Known::Singular => "det Q changes its sign",
            Known::Open => "not examined",
        };
        format!("{indices:?} {known}")
    };
    let mut shown: Vec<String> = others.iter().take(TOLD).map(one).collect();
    if others.len() > TOLD {
        shown.push(format!("{} more", others.len() - TOLD));
    }
    format!("; indices {chosen:?} (others: {})", shown.join(", "))
}

fn degree_of(output: &str, degree: &Degree) -> String {
    let Degree {
        r, input, witness, ..
    } = degree;
    let found = match witness {
        Some(witness) => format!(
            "{input} appears in y^({r}): ∂y^({r})/∂{input} is {}",
            witness.words()
        ),
        None => format!("{input} does not appear before y^({r})"),
    };
    format!("{output}: r = {r}, {found}")
}

/// What has no bound, or what else there is to say.
fn open_or(open: &[String], otherwise: &str) -> String {
    match open.is_empty() {
        true => otherwise.to_owned(),
        false => {
            let shown: Vec<&str> = open.iter().map(String::as_str).take(4).collect();
            format!("no bound of {}: declare min and max", shown.join(", "))
        }
    }
}
