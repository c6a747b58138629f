//! The papers' prolongation of f outside of the box (Remark 2 of Hammouri, Targui and
//! Armanet; Remark 1 of Lee, Yee and Park).
//!
//! With P the projection on the box of the declared ranges and, for each row j of a chain, a
//! number ā_j within the bounds [α₁, α₂] of its partial, sign included,
//!
//! f̃_j(x) = f_j(Px) + ā_j (x_{j+1} − Px_{j+1}).
//!
//! In x_{j+1} the slope of f̃_j is that of f_j at Px inside of the range and ā_j outside of
//! it, hence in [α₁, α₂] everywhere; in every other variable it is that of f_j at Px or zero.
//! So all bounds that hold on the box hold everywhere, and f̃ = f on the box. A slope that
//! follows Px would not do: times a distance without bound, its own change has none.

use lynkeus_expr::Node;
use lynkeus_model::Variable;
use lynkeus_structure::{Extended, Region};

use crate::conditions::Partial;
use crate::estimate::{Common, Copy, limited};
use crate::peaking::nominal;
use crate::proof::words::box_note;
use crate::{KeySpec, Shape, TuningError};

/// The study's key.
pub(crate) const PROLONG: KeySpec = KeySpec {
    name: "prolong",
    kind: "true, false",
    shape: Shape::Flag,
    default: "false",
    meaning: "outside of the declared ranges the plant's functions are [prolonged](triangular.md#options) as the papers ask, so that the theorem holds for every start of the estimate",
};

/// One equation of a chain.
pub(crate) struct Continued {
    /// j
    pub row: usize,
    /// j + 1
    pub next: usize,
    /// of the partial ∂f_row/∂x_next
    pub sign: f64,
    /// (α₁, α₂) of its size
    pub bounds: (f64, f64),
}

impl Continued {
    /// The equations of a chain.
    pub fn along(states: &[usize], partials: &[Partial]) -> impl Iterator<Item = Self> {
        let rows = states.windows(2).zip(partials);
        rows.map(|(pair, partial)| Self {
            row: pair[0],
            next: pair[1],
            sign: partial.sign,
            bounds: partial.bounds,
        })
    }
}

/// Adds ā (x̂_next − Px̂_next) to the equations of the chains, if the study asks for it; `copy`
/// then evaluates everything else at Px̂.
///
/// # Errors
/// A partial without bounds.
pub(crate) fn prolong(
    copy: &Copy<'_, '_>,
    rows: impl IntoIterator<Item = Continued>,
    derivatives: &mut [Node],
) -> Result<(), TuningError> {
    if !copy.common.prolong {
        return Ok(());
    }
    let graph = copy.extended.graph();
    for Continued {
        row,
        next,
        sign,
        bounds,
    } in rows
    {
        let variable = &copy.extended.states[next];
        let Some(slope) = nominal(sign, bounds) else {
            let expected = format!(
                "∂f({})/∂{} with known bounds away from zero, to continue with; declare min and max",
                copy.extended.states[row].name, variable.name
            );
            let found = format!("bounds {} and {}", bounds.0, bounds.1);
            return Err(TuningError::new(PROLONG.name, expected, found));
        };
        let hat = copy.hats[next].symbol;
        let outside = graph.expr(hat) - graph.expr(limited(graph, hat, variable));
        derivatives[row] = (graph.expr(derivatives[row]) + slope * outside).node();
    }
    Ok(())
}

/// Refuses the key where an observer has no such form.
pub(crate) fn refuse(common: &Common, observer: &str) -> Result<(), TuningError> {
    match common.prolong {
        true => Err(TuningError::new(
            PROLONG.name,
            format!("no prolongation with {observer}"),
            "true",
        )),
        false => Ok(()),
    }
}

/// Where the estimate may be for the guarantee to hold.
///
/// Everywhere only where the box of the proof is the one that the observer projects on and
/// takes its slopes from: a smaller one of states (`tube`) or of inputs has other bounds.
pub(crate) fn note(common: &Common, extended: &Extended<'_>, region: &Region) -> String {
    let whole = |variable: &Variable| {
        let mut sides = region.dimensions.iter();
        let side = sides.find(|d| d.symbol == variable.node);
        side.is_none_or(|d| d.min <= variable.min && d.max >= variable.max)
    };
    let declared = extended.plant.states.iter().chain(&extended.plant.inputs);
    match (common.prolong, declared.into_iter().all(whole)) {
        (true, true) => "The guarantee holds for every start of the estimate, while the plant stays in the box: outside of it the functions are prolonged with the same bounds of their slopes ('prolong').".into(),
        (true, false) => "The guarantee holds while plant and estimate stay in the box, which is smaller than the declared one that the functions are prolonged from ('prolong'): on the declared box it would hold for every start of the estimate.".into(),
        (false, _) => box_note(common.clamp),
    }
}
