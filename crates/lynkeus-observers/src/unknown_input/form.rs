//! The partition of the measured outputs with the matrices of the paper, every condition on the
//! box, and the shape of the blocks of Λ₂ with what of the proof it leaves.
//!
//! Where a block is square Λ₂Λ₂⁺ = I, and the gain is constant in the coordinates of the
//! proof. Else Π_k = Λ₂_kΛ₂_k⁺ is the projection on the range R_k of the block k, R_1 ⊃ R_2 ⊃ …
//! If Λ₂ does not read X², ζ_k = Λ₂_k η_k lies in R_k and obeys
//!
//! ζ_k' = ζ_{k+1} − θ₂^k C^k_q Π_k (ζ_1 + γ₁e₁) + terms bounded by the ranges of Jacobians:
//!
//! in the part of R_k that is not in R_{k+1} a chain of k integrators with the first k of
//! the gains of q. For k = 1 it has the pole −qθ₂ alone; for k = q it is the chain of the
//! proof. So with n₂ = … = n_q, where no other k occurs, V₂ with the S₂ of the paper decays
//! as in (24). Between 1 and q the S₂ of the paper need not decrease (it does not for k = 2 of
//! q = 3), and for k ≥ 5 the chain itself may be unstable.

use lynkeus_expr::{Graph, MissingInput, Node, jacobian};
use lynkeus_gain::integrators::shortened_stability;
use lynkeus_structure::{
    AugmentedPlant, Layers, Matrix, Point, Region, Standing, Verdict, layers, rank,
};

use super::said::{Said, Shape};
use super::settings::{Settings, wrong_size};
use crate::conditions::{lipschitz, names, output_slope};
use crate::design::Found;
use crate::paper::Settings as _;
use crate::statement::{proved, standing, sufficient};
use crate::{Check, DesignError, Examination, Farza, Reason, Statement, TuningError};

/// More partitions are not tried.
const MAX_PARTITIONS: usize = 500;

/// Nor more only to advise one.
const MAX_ADVISED: usize = 20;

/// A plant in layers with its measured states split as (H4) asks.
#[derive(Clone, Debug)]
pub struct Form<'e, 'p> {
    pub augmented: &'e AugmentedPlant<'p>,
    pub layers: Layers<'p>,
    /// measured outputs of x₁¹
    pub first: Vec<usize>,
    /// measured outputs of x₂¹
    pub second: Vec<usize>,
}

impl<'p> Form<'_, 'p> {
    /// The same with G at other signals.
    pub fn with_factors(&self, factors: Matrix<'p>) -> Self {
        let layers = self.layers.clone();
        Self {
            layers: Layers { factors, ..layers },
            ..self.clone()
        }
    }

    /// Number q of layers.
    pub fn q(&self) -> usize {
        self.layers.layers.len()
    }

    /// States of x₁¹.
    pub fn x11(&self) -> Vec<usize> {
        self.first
            .iter()
            .map(|&i| self.layers.layers[0][i])
            .collect()
    }

    /// States of the block k = 1 … q of X²: x₂¹, x², …, x^q.
    pub fn block(&self, k: usize) -> Vec<usize> {
        match k {
            1 => self
                .second
                .iter()
                .map(|&i| self.layers.layers[0][i])
                .collect(),
            _ => self.layers.layers[k - 1].clone(),
        }
    }

    /// f̃ of some states.
    pub fn drift(&self, states: &[usize]) -> Vec<Node> {
        states.iter().map(|&i| self.layers.drift[i]).collect()
    }

    /// ∂f̃_rows/∂x_columns
    pub fn jacobian(&self, rows: &[usize], columns: &[usize]) -> Matrix<'p> {
        let x = self.symbols(columns);
        Matrix::jacobian(self.augmented.graph(), &self.drift(rows), &x)
    }

    /// The symbols of some states.
    pub fn symbols(&self, states: &[usize]) -> Vec<Node> {
        let states = states.iter();
        states.map(|&i| self.augmented.states[i].node).collect()
    }

    /// G of some states.
    pub fn factors(&self, states: &[usize]) -> Matrix<'p> {
        self.layers.factors.select_rows(states)
    }

    /// G₁¹
    pub fn G11(&self) -> Matrix<'p> {
        self.factors(&self.x11())
    }

    /// γ_k B with γ_k = G^k (G₁¹)⁺, the block k of D (9).
    pub fn γ_times(&self, k: usize, B: &Matrix<'p>) -> Matrix<'p> {
        self.factors(&self.block(k))
            .times(&self.G11().left_divide(B))
    }

    /// ∂f̃^k/∂x^{k+1} for k = 2 … q−1.
    pub fn link(&self, k: usize) -> Matrix<'p> {
        self.jacobian(&self.block(k), &self.block(k + 1))
    }

    /// ∂f̄₁²/∂x², from (10).
    pub fn bent(&self) -> Matrix<'p> {
        let (own, first) = (self.block(1), self.x11());
        let x2 = self.block(2);
        let through = self.γ_times(1, &self.jacobian(&first, &x2));
        self.jacobian(&own, &x2).minus(&through)
    }

    /// The blocks k = 1 … q of Λ₂ (13).
    pub fn Λ2(&self) -> Vec<Matrix<'p>> {
        let mut Λ2 = vec![Matrix::identity(self.augmented.graph(), self.second.len())];
        for k in 1..self.q() {
            let link = match k {
                1 => self.bent(),
                _ => self.link(k),
            };
            Λ2.push(Λ2[k - 1].times(&link));
        }
        Λ2
    }

    /// A matrix with the rank of ∂f̄₁²/∂x² plus m, free of divisions: where (i) holds
    /// the Schur complement of GᵀG in
    /// ( GᵀG  Gᵀ ∂f̃₁¹/∂x² ;  G₂¹  ∂f̃₂¹/∂x² ), G = G₁¹, is ∂f̄₁²/∂x².
    pub fn eleven(&self) -> Matrix<'p> {
        let (own, first) = (self.block(1), self.x11());
        let x2 = self.block(2);
        let G = self.G11();
        // a square G₁¹ needs no least squares
        let left = match G.rows == G.columns {
            true => Matrix::identity(self.augmented.graph(), G.rows),
            false => G.transposed(),
        };
        let upper = left
            .times(&G)
            .beside(&left.times(&self.jacobian(&first, &x2)));
        let lower = self.factors(&own).beside(&self.jacobian(&own, &x2));
        upper.above(&lower)
    }

    /// The matrix of condition (ii).
    pub fn ii(&self) -> Matrix<'p> {
        let rows = [self.x11(), self.block(1)].concat();
        self.jacobian(&rows, &self.block(2))
            .beside(&self.factors(&rows))
    }
}

/// The first partition whose conditions are proved, else the first that nothing
/// refutes; else the examination that says why there is none.
pub(super) fn search<'e, 'p>(
    augmented: &'e AugmentedPlant<'p>,
    settings: &Settings,
    region: &Region,
) -> Result<Found<Form<'e, 'p>>, DesignError> {
    let layers = match layers::find(augmented) {
        Ok(layers) => layers,
        Err(why) => {
            return Err(Examination::unfit(Settings::FAMILY, Reason::from(why), vec![]).into());
        }
    };
    let candidates = candidates(augmented, &layers, settings)?;
    let shared = shared(augmented, &layers, region)?;
    let (mut undecided, mut refuted) = (None, vec![]);
    for first in candidates {
        let form = form(augmented, &layers, first);
        let own = conditions(&form, region)?;
        match standing(&own) {
            Standing::Proved => return Ok(finish(form, region, shared, own)?),
            Standing::Undecided => {
                undecided.get_or_insert((form, own));
            }
            Standing::Refuted => refuted.push((form, own)),
        }
    }
    if let Some((form, own)) = undecided {
        return Ok(finish(form, region, shared, own)?);
    }
    Err(none(augmented, &layers, shared, refuted).into())
}

fn form<'e, 'p>(
    augmented: &'e AugmentedPlant<'p>,
    layers: &Layers<'p>,
    first: Vec<usize>,
) -> Form<'e, 'p> {
    let second = (0..augmented.outputs.len()).filter(|i| !first.contains(i));
    Form {
        augmented,
        layers: layers.clone(),
        second: second.collect(),
        first,
    }
}

/// Sizes m ≤ m₁ < p that leave p − m₁ ≥ n₂, as (11) needs; the smallest first.
fn sizes(augmented: &AugmentedPlant<'_>, layers: &Layers<'_>) -> std::ops::RangeInclusive<usize> {
    let (p, n2) = (
        augmented.outputs.len(),
        layers.layers.get(1).map_or(0, Vec::len),
    );
    layers.factors.columns..=p.saturating_sub(n2.max(1))
}

/// The outputs of x₁¹ that the study asks for, else every choice of them.
fn candidates(
    augmented: &AugmentedPlant<'_>,
    layers: &Layers<'_>,
    settings: &Settings,
) -> Result<Vec<Vec<usize>>, TuningError> {
    let (p, sizes) = (augmented.outputs.len(), sizes(augmented, layers));
    if let Some(first) = &settings.partition {
        return match sizes.contains(&first.len()) {
            true => Ok(vec![first.clone()]),
            false => Err(wrong_size(&sizes, p, first.len())),
        };
    }
    let of_size = |size| rank::subsets(p, size, MAX_PARTITIONS).unwrap_or_default();
    let mut all: Vec<Vec<usize>> = sizes.flat_map(of_size).collect();
    all.truncate(MAX_PARTITIONS);
    Ok(all)
}

/// A partition that meets (H4) and makes every block of Λ₂ square: its outputs.
fn square(form: &Form<'_, '_>, region: &Region) -> Result<Option<Vec<String>>, DesignError> {
    let augmented = form.augmented;
    let own = form.block(form.q().min(2)).len();
    let size = augmented.outputs.len() - own;
    if form.q() < 2 || size < form.layers.factors.columns || form.shape() == Shape::Narrowing {
        return Ok(None);
    }
    let all = rank::subsets(augmented.outputs.len(), size, MAX_PARTITIONS).unwrap_or_default();
    for first in all.into_iter().take(MAX_ADVISED) {
        let candidate = self::form(augmented, &form.layers, first);
        if standing(&conditions(&candidate, region)?) == Standing::Proved {
            let name = |&i: &usize| augmented.outputs[i].variable.name.clone();
            return Ok(Some(candidate.first.iter().map(name).collect()));
        }
    }
    Ok(None)
}

/// (H1), (H2) and what belongs to no partition.
fn shared(
    augmented: &AugmentedPlant<'_>,
    layers: &Layers<'_>,
    region: &Region,
) -> Result<Vec<Check>, DesignError> {
    let graph = augmented.graph();
    let mut checks = vec![];
    for i in 0..augmented.outputs.len() {
        checks.extend(output_slope(augmented, i, region)?);
    }
    for (k, pair) in layers.layers.windows(2).enumerate() {
        let f: Vec<Node> = pair[0].iter().map(|&i| layers.drift[i]).collect();
        let x: Vec<Node> = pair[1].iter().map(|&i| augmented.states[i].node).collect();
        let jacobian = Matrix::jacobian(graph, &f, &x);
        let (layer, rank) = (k + 1, x.len());
        let h1 = Statement::from(Farza::H1 { layer, rank });
        checks.push(h1.with(rank::full_column_rank(&jacobian, region)?));
        let h2 = Statement::from(Farza::H2 { layer });
        checks.push(h2.with(rank::one_to_one(graph, &f, &x, region)?));
    }
    checks.push(lipschitz(augmented, region)?);
    Ok(checks)
}

/// (H4) for one partition. The first refuted condition ends it.
fn conditions(form: &Form<'_, '_>, region: &Region) -> Result<Vec<Check>, DesignError> {
    let m = form.layers.factors.columns;
    let found = rank::full_column_rank(&form.G11(), region)?;
    let i = Statement::from(Farza::H4i { rank: m }).with(found);
    if form.q() == 1 || i.standing() == Standing::Refuted {
        return Ok(vec![i]);
    }
    let n2 = form.block(2).len();
    let found = rank::full_column_rank(&form.eleven(), region)?;
    let eleven = Statement::from(Farza::Eleven { rank: n2 }).with(found);
    if eleven.standing() == Standing::Refuted {
        return Ok(vec![i, eleven]);
    }
    let ii = Statement::from(Farza::H4ii { rank: n2 + m });
    let ii = match standing([&i, &eleven]) {
        Standing::Proved => proved(ii, Said::FollowsFromIAndEleven),
        _ => ii.with(rank::full_column_rank(&form.ii(), region)?),
    };
    let mut checks = vec![i, eleven, ii];
    checks.extend(shortened(form));
    Ok(checks)
}

fn finish<'e, 'p>(
    form: Form<'e, 'p>,
    region: &Region,
    shared: Vec<Check>,
    own: Vec<Check>,
) -> Result<Found<Form<'e, 'p>>, MissingInput> {
    let augmented = form.augmented;
    let checks = [shared, own].concat();
    let mut chains = vec![names(augmented, &form.x11())];
    chains.extend((1..=form.q()).map(|k| names(augmented, &form.block(k))));
    let unknown: Vec<usize> = (augmented.plant_states()..augmented.states.len()).collect();
    let summary = Said::Form {
        layers: layer_names(augmented, &form.layers),
        unknown: names(augmented, &unknown),
        first: chains[0].clone(),
        second: chains[1].clone(),
    };
    let examination =
        Examination::new(augmented, region, Settings::FAMILY, summary, chains, checks)?;
    Ok(Found { form, examination })
}

/// No partition: the conditions of the one that went furthest.
fn none(
    augmented: &AugmentedPlant<'_>,
    layers: &Layers<'_>,
    shared: Vec<Check>,
    refuted: Vec<(Form<'_, '_>, Vec<Check>)>,
) -> Examination {
    let tried = refuted.len();
    let fails = |check: &&Check| check.standing() == Standing::Refuted;
    let met = |own: &[Check]| own.iter().take_while(|check| !fails(check)).count();
    let furthest = refuted.into_iter().rev().max_by_key(|(_, own)| met(own));
    let closest =
        furthest
            .as_ref()
            .and_then(|(form, own)| match &own.iter().find(fails)?.statement {
                Statement::Farza(failed) => Some((names(augmented, &form.x11()), failed.clone())),
                _ => None,
            });
    let summary = Said::NoPartition {
        layers: layer_names(augmented, layers),
        tried,
        closest,
    };
    let own = furthest.map_or(vec![], |(_, own)| own);
    Examination::unfit(Settings::FAMILY, summary, [shared, own].concat())
}

fn layer_names(augmented: &AugmentedPlant<'_>, layers: &Layers<'_>) -> Vec<Vec<String>> {
    let layers = layers.layers.iter();
    layers.map(|layer| names(augmented, layer)).collect()
}

impl Form<'_, '_> {
    pub fn sizes(&self) -> Vec<usize> {
        (1..=self.q()).map(|k| self.block(k).len()).collect()
    }

    pub(super) fn shape(&self) -> Shape {
        let sizes = self.sizes();
        match sizes[1..].windows(2).all(|pair| pair[0] == pair[1]) {
            false => Shape::Narrowing,
            true if sizes.iter().all(|&size| size == sizes[0]) => Shape::Square,
            true => Shape::Tall,
        }
    }

    /// Whether Λ₂ changes with X².
    pub fn bends(&self) -> bool {
        let graph = self.augmented.graph();
        let nodes: Vec<_> = self.Λ2().iter().flat_map(|P| P.nonzero()).collect();
        let used = graph.symbols_of(&nodes);
        let mut states = (1..=self.q()).flat_map(|k| self.block(k));
        states.any(|i| used.contains(&self.augmented.states[i].node))
    }
}

/// The layers after which the next one has fewer states: their chains end there.
fn ends(sizes: &[usize]) -> Vec<usize> {
    let narrower = |&k: &usize| sizes[k - 1] > sizes[k];
    (1..sizes.len()).filter(narrower).collect()
}

/// The chains that end before the last layer are stable with the gains of q; nothing to
/// check where none ends.
fn shortened(form: &Form<'_, '_>) -> Option<Check> {
    let q = form.q();
    let found = |k: usize| (k, shortened_stability(q, k));
    let ends = ends(&form.sizes()).into_iter().map(found);
    let (k, least) = ends.min_by(|a, b| a.1.lo().total_cmp(&b.1.lo()))?;
    let verdict = if least.is_positive() {
        Verdict::Proved
    } else if least.is_negative() {
        let (coordinates, value) = (vec![], least.midpoint());
        Verdict::Refuted(Point { coordinates, value }.into())
    } else {
        Verdict::open()
    };
    let said = Said::Shortened(verdict.standing());
    let statement = Farza::ShortenedChain { layer: k, gains: q };
    Some(Statement::from(statement).found(verdict, said))
}

/// Whether the proof covers the blocks; `form` with the signals apart from the states.
pub(super) fn covered(form: &Form<'_, '_>, region: &Region) -> Result<Check, DesignError> {
    let (shape, bends) = (form.shape(), form.bends());
    let covered = shape == Shape::Square || shape == Shape::Tall && !bends;
    let said = Said::Blocks {
        shape,
        sizes: form.sizes(),
        bends,
        partition: if covered { None } else { square(form, region)? },
    };
    Ok(sufficient(Farza::LeftInverse, covered, said))
}

/// A matrix of one column.
pub(super) fn column<'g>(graph: &'g Graph, entries: &[Node]) -> Matrix<'g> {
    Matrix::from_fn(graph, (entries.len(), 1), |i, _| Some(entries[i]))
}

/// The derivative of each entry while symbols move with their slopes.
pub(super) fn along<'g>(A: &Matrix<'g>, moving: &[(Node, Node)]) -> Matrix<'g> {
    let graph = A.graph();
    let symbols: Vec<Node> = moving.iter().map(|pair| pair.0).collect();
    A.map(|node| {
        let gradient = jacobian::forward(graph, &[node], &symbols);
        let terms = gradient
            .row(0)
            .map(|(i, d)| graph.expr(d) * graph.expr(moving[i].1));
        let sum = terms.reduce(|a, b| a + b);
        sum.unwrap_or_else(|| graph.constant(0.0)).node()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chains_end_where_layers_narrow() {
        assert_eq!(ends(&[3, 2, 2, 1]), [1, 3]);
        assert_eq!(ends(&[2, 2]), [0; 0]);
        assert_eq!(ends(&[1]), [0; 0]);
    }
}
