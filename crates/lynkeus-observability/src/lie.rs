//! Symmetries that fix the known starts, found and verified as vector fields.
//!
//! An affine field v(z) that commutes with the flow, moves no output and leaves the known
//! starts alone carries solutions to solutions with the same outputs: its value at a start is a
//! direction that no derivative of the outputs sees. All three are linear equations in the
//! coefficients of v at every point; they are written down at random points of the invariant
//! set until they determine what is left. Unknown inputs may answer in any affine way.

use crate::expansion::{Affine, Columns, Expansion, Start};
use crate::hull;
use crate::model::{Model, Role};
use crate::series::Stop;
use lynkeus_expr::modular::{Echelon, Modular};

/// Seed of the points.
const FIRST: u64 = 70_001;
/// Coefficients of a field; beyond, only scalings and shifts of single coordinates are tried,
/// and beyond that number nothing.
const COEFFICIENTS: usize = 240;
/// Points that have to bring nothing new.
const CONFIRMED: usize = 3;

/// One coefficient: v_row += coefficient·z_column, or a constant without column.
#[derive(Clone, Copy, Debug)]
struct Term {
    row: usize,
    column: Option<usize>,
}

/// A point with the flow, the outputs and their Jacobians there. Coordinates are the named
/// quantities and, measured from their known starts, the other states.
struct Place {
    values: Vec<Modular>,
    /// derivatives of the coordinates
    flow: Vec<Modular>,
    /// per coordinate that is a state: gradient of its derivative
    gradients: Vec<Option<Vec<Modular>>>,
    outputs: Vec<Vec<Modular>>,
}

/// Directions of the named quantities at a start along which the fields found at points of the set move them.
pub(crate) fn directions(
    model: &Model,
    set: &Affine,
    start: &Start,
) -> Result<Vec<Vec<Modular>>, Stop> {
    let terms = terms(model);
    if terms.is_empty() {
        return Ok(vec![]);
    }
    let mut equations = Echelon::new(terms.len());
    let (mut confirmed, mut seed) = (0, FIRST);
    while confirmed < CONFIRMED && equations.rank() < terms.len() {
        seed += 1;
        let anywhere = Start::new(model, seed).at_zero(start.at_zero);
        let found = hull::find(model, anywhere.within(model, set));
        let place = match found.and_then(|start| Place::new(model, &start)) {
            Ok(place) => place,
            Err(Stop::Point(_)) => return Ok(vec![]),
            Err(stop) => return Err(stop),
        };
        let rank = equations.rank();
        place.equations(&terms, &mut equations);
        confirmed = if equations.rank() == rank {
            confirmed + 1
        } else {
            0
        };
    }
    let here = Place::new(model, start)?;
    let fields = equations.kernel();
    let fields = fields
        .iter()
        .map(|field| here.field(&terms, field, model.named.len()));
    Ok(fields.collect())
}

/// The coefficients of a field: known starts, each a coordinate of its own, move with their distance from the start
/// alone; what has no column is known.
fn terms(model: &Model) -> Vec<Term> {
    let named = model.named.len();
    let count = named + model.known_starts().count();
    let inputs = named - model.unknown_inputs..named;
    let affine = |row: usize| {
        let linear = (0..count).filter(|&column| {
            let held = row < named || column >= named;
            held && (inputs.contains(&row) || !inputs.contains(&column))
        });
        let constant = (row < named).then_some(Term { row, column: None });
        let linear = linear.map(move |column| Term {
            row,
            column: Some(column),
        });
        linear.chain(constant).collect::<Vec<Term>>()
    };
    let mut terms: Vec<Term> = (0..count).flat_map(affine).collect();
    if terms.len() > COEFFICIENTS {
        terms.retain(|term| term.column.is_none_or(|column| column == term.row));
    }
    match terms.len() > COEFFICIENTS {
        true => vec![],
        false => terms,
    }
}

impl Place {
    fn new(model: &Model, start: &Start) -> Result<Self, Stop> {
        let known: Vec<usize> = model.known_starts().collect();
        let columns = Columns::new(model, 0).moving(&hull::everywhere(model, &known));
        let mut expansion = Expansion::new(model, start, columns);
        expansion.advance()?;
        let mut values = expansion.point.clone();
        values.extend(known.iter().map(|&place| start.moved_by(model, place)));
        let mut flow = vec![Modular::ZERO; values.len()];
        let mut gradients = vec![None; values.len()];
        let places = model.symbols.iter().enumerate();
        for (place, symbol) in places {
            let Role::State(state) = symbol.role else {
                continue;
            };
            let unnamed = known.iter().position(|&k| k == place);
            let coordinate = symbol.column.or(unnamed.map(|i| model.named.len() + i));
            if let Some(coordinate) = coordinate {
                let (value, gradient) = expansion.root(state);
                flow[coordinate] = value;
                gradients[coordinate] = Some(gradient);
            }
        }
        // parameters do not move; unknown inputs move as they like
        let inputs = model.named.len() - model.unknown_inputs;
        for (coordinate, gradient) in gradients.iter_mut().enumerate() {
            let is_input = (inputs..model.named.len()).contains(&coordinate);
            if gradient.is_none() && !is_input {
                *gradient = Some(vec![]);
            }
        }
        let outputs = 0..model.outputs;
        Ok(Self {
            values,
            flow,
            gradients,
            outputs: outputs.map(|i| expansion.output(i)).collect(),
        })
    }

    fn at(&self, term: &Term) -> Modular {
        term.column
            .map_or(Modular::ONE, |column| self.values[column])
    }

    /// ∂v/∂z·f − ∂f/∂z·v = 0 and ∂h/∂z·v = 0.
    fn equations(&self, terms: &[Term], equations: &mut Echelon) {
        let entry = |row: &[Modular], column: usize| row.get(column).copied().unwrap_or_default();
        let against = |gradient: &[Modular]| -> Vec<Modular> {
            let along = terms.iter().map(|t| entry(gradient, t.row) * self.at(t));
            along.collect()
        };
        for output in &self.outputs {
            equations.add(&against(output));
        }
        for (coordinate, gradient) in self.gradients.iter().enumerate() {
            let Some(gradient) = gradient else { continue };
            let mut row = against(gradient);
            for (entry, term) in row.iter_mut().zip(terms) {
                if let (true, Some(column)) = (term.row == coordinate, term.column) {
                    *entry = *entry - self.flow[column];
                }
            }
            equations.add(&row);
        }
    }

    /// The named part of a field here.
    fn field(&self, terms: &[Term], coefficients: &[Modular], named: usize) -> Vec<Modular> {
        let mut field = vec![Modular::ZERO; named];
        for (term, coefficient) in terms.iter().zip(coefficients) {
            if let Some(value) = field.get_mut(term.row) {
                *value = *value + *coefficient * self.at(term);
            }
        }
        field
    }
}
