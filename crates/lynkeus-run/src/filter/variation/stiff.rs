//! Stiff flows.

use super::{Piece, Variation};
use crate::filter::doubling::Dense;
use crate::filter::taylor::Moments;
use crate::method::resolution;
use crate::system::Driven;
use crate::{Dynamics, Error};

/// What the covariance of a stiff flow may be wrong by at least.
const STIFF: f64 = 1e-5;

/// Most halvings of a piece of a stiff flow.
const MOST_HALVINGS: usize = 16;

/// A piece of a stiff interval with a constant F.
struct Leaf {
    result: Dense,
    /// F changes on it
    varies: bool,
    end: Vec<f64>,
}

impl Variation {
    /// The rest of a stiff segment.
    pub(super) fn stiff(
        &mut self,
        driven: &mut Driven,
        piece: Piece,
        x: &mut Vec<f64>,
        moments: &mut Moments,
    ) -> Result<(), Error> {
        let n = x.len();
        let whole = self.leaf(driven, piece, x)?;
        let result = self.refined(driven, piece, x, whole, MOST_HALVINGS)?;
        *moments = Dense::of(moments, n).then(&result.result).into_moments(n);
        *x = result.end;
        Ok(())
    }

    /// A piece in halves until halving it changes nothing.
    fn refined(
        &mut self,
        driven: &mut Driven,
        piece: Piece,
        x: &[f64],
        coarse: Leaf,
        halvings: usize,
    ) -> Result<Leaf, Error> {
        if !coarse.varies || halvings == 0 || piece.length() <= 512.0 * resolution(piece.to) {
            return Ok(coarse);
        }
        let half = piece.at(0.5);
        let (left, right) = (
            Piece { to: half, ..piece },
            Piece {
                from: half,
                ..piece
            },
        );
        let first = self.leaf(driven, left, x)?;
        let second = self.leaf(driven, right, &first.end)?;
        let both = first.result.then(&second.result);
        // of a method of order 2, what is better is a quarter as wrong
        let error = both.distance(&coarse.result) / 3.0;
        let (first, second) = if error <= self.tolerance.max(STIFF) {
            (first, second)
        } else {
            let first = self.refined(driven, left, x, first, halvings - 1)?;
            let second = self.leaf(driven, right, &first.end)?;
            let middle = first.end.clone();
            (
                first,
                self.refined(driven, right, &middle, second, halvings - 1)?,
            )
        };
        Ok(Leaf {
            result: first.result.then(&second.result),
            varies: true,
            end: second.end,
        })
    }

    /// A piece with F as it is there on average (Simpson's rule).
    fn leaf(&mut self, driven: &mut Driven, piece: Piece, x: &[f64]) -> Result<Leaf, Error> {
        let h = piece.length();
        let half = piece.at(0.5);
        let first = self.scaled(driven, piece.from, x, h)?;
        let mut middle = x.to_vec();
        self.integrator
            .advance(driven, piece.from, half, &mut middle)?;
        let between = self.scaled(driven, half, &middle, h)?;
        let mut end = middle.clone();
        self.integrator.advance(driven, half, piece.to, &mut end)?;
        let last = self.scaled(driven, piece.to, &end, h)?;
        let three = first.iter().zip(&between).zip(&last);
        let mean = three.map(|((a, b), c)| (a + 4.0 * b + c) / 6.0);
        let mean = self.sparse(&mean.collect::<Vec<f64>>());
        let ends = first.iter().zip(&between).zip(&last);
        let varies = ends
            .map(|((a, b), c)| (a - b).abs().max((a - c).abs()) / a.abs().max(1.0))
            .any(|change| change > STIFF);
        let drive = self.drive(h);
        let result = Dense::constant(x.len(), &mean, &drive, &mut self.series);
        let result = result.ok_or_else(|| driven.not_finite(piece.from, x))?;
        Ok(Leaf {
            result,
            varies,
            end,
        })
    }
}
