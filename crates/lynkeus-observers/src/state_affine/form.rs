//! The blocks of the paper in a plant, with what is known of A2 and A4.

use lynkeus_structure::output_map::Rows;
use lynkeus_structure::{AugmentedPlant, Region, Standing, Superdiagonal, superdiagonal};

use super::said::{Ltaief, Said};
use super::settings::Settings;
use crate::conditions::{lipschitz, names};
use crate::design::Found;
use crate::paper::Settings as _;
use crate::statement::standing;
use crate::{DesignError, Examination, Reason, Statement};

/// A plant in blocks, with its states in their order.
pub struct Form {
    pub blocks: Superdiagonal,
    /// the states, block by block
    pub order: Vec<usize>,
    /// the block of each, from 0
    pub block: Vec<usize>,
    /// C(u), a row per output
    pub C: Rows,
    /// F(u, x)
    pub F: Rows,
}

impl Form {
    fn new(augmented: &AugmentedPlant<'_>, blocks: Superdiagonal) -> Self {
        let order: Vec<usize> = blocks.blocks().flatten().copied().collect();
        let n = order.len();
        let place = |state: usize| order.iter().position(|&i| i == state);
        let mut C = vec![vec![None; n]; augmented.outputs.len()];
        let mut F = vec![vec![None; n]; n];
        for (k, factor) in blocks.factors.iter().enumerate() {
            for &(i, j, node) in &factor.entries {
                let column = place(factor.columns[j]);
                let (table, row) = match k {
                    0 => (&mut C, Some(factor.rows[i])),
                    _ => (&mut F, place(factor.rows[i])),
                };
                if let (Some(row), Some(column)) = (row, column) {
                    table[row][column] = Some(node);
                }
            }
        }
        let sizes = blocks.blocks().map(<[usize]>::len).enumerate();
        Self {
            block: sizes.flat_map(|(k, size)| vec![k; size]).collect(),
            blocks,
            order,
            C,
            F,
        }
    }
}

/// The blocks with what is known of A2 and A4.
pub(super) fn form(
    augmented: &AugmentedPlant<'_>,
    _: &Settings,
    region: &Region,
) -> Result<Found<Form>, DesignError> {
    let form = match superdiagonal::find(augmented) {
        Ok(blocks) => Form::new(augmented, blocks),
        Err(why) => {
            return Err(Examination::unfit(Settings::FAMILY, Reason::from(why), vec![]).into());
        }
    };
    let mut checks = vec![];
    for (k, factor) in form.blocks.factors.iter().enumerate() {
        let mut declared = factor.columns.clone();
        declared.sort_unstable();
        let statement = Ltaief::BlockShows {
            factor: k,
            states: names(augmented, &declared),
        };
        let found = factor.column_rank(augmented, k, region)?;
        checks.push(Statement::from(statement).with(found));
    }
    let depends_on_inputs = standing(&checks) == Standing::Undecided;
    checks.push(lipschitz(augmented, region)?);
    let chains = form.blocks.declared().map(|block| names(augmented, &block));
    let chains: Vec<Vec<String>> = chains.collect();
    let blocks = chains.clone();
    let summary = Said::Form {
        blocks,
        depends_on_inputs,
    };
    let examination =
        Examination::new(augmented, region, Settings::FAMILY, summary, chains, checks)?;
    Ok(Found { form, examination })
}
