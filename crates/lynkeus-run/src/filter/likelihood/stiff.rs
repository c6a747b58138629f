//! A step of the plant alone where its equations are stiff.

use lynkeus_expr::{Expr, Graph, Node, jacobian};

use crate::classical::{Term, sum};

/// Most entries of the matrix that elimination may come to.
const MOST_ENTRIES: usize = 4000;

/// The method RODAS (E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, section IV.7, and its
/// program `rodas.f`): of Rosenbrock's kind, order 4, L-stable and stiffly accurate, six stages with one matrix. No
/// step of it iterates, so that it is straight-line code with exact derivatives.
const GAMMA: f64 = 0.25;
/// Of each stage: its time, the factor of ∂f/∂t, those of the stages before it in x, and in the right side.
const STAGES: [(f64, f64, &[f64], &[f64]); 6] = [
    (0.0, 0.25, &[], &[]),
    (0.386, -0.1043, &[1.544], &[-5.6688]),
    (
        0.21,
        0.1035,
        &[0.946_678_528_081_582_6, 0.255_701_169_898_328_4],
        &[-2.430_093_356_833_875, -0.206_359_915_709_191_5],
    ),
    (
        0.63,
        -0.036_200_000_000_000_23,
        &[
            3.314_825_187_068_521,
            2.896_124_015_972_201,
            0.998_641_913_997_781_7,
        ],
        &[
            -0.107_352_905_815_137_5,
            -9.594_562_251_023_355,
            -20.470_286_148_096_16,
        ],
    ),
    (
        1.0,
        0.0,
        &[
            1.221_224_509_226_641,
            6.019_134_481_288_629,
            12.537_083_329_320_87,
            -0.687_886_036_105_895,
        ],
        &[
            7.496_443_313_967_647,
            -10.246_804_314_643_52,
            -33.999_903_528_199_05,
            11.708_908_932_061_6,
        ],
    ),
    (
        1.0,
        0.0,
        // as the fifth, and with all of that
        &[
            1.221_224_509_226_641,
            6.019_134_481_288_629,
            12.537_083_329_320_87,
            -0.687_886_036_105_895,
            1.0,
        ],
        &[
            8.083_246_795_921_522,
            -7.981_132_988_064_893,
            -31.521_594_328_743_71,
            16.319_305_431_231_36,
            -6.058_818_238_834_054,
        ],
    ),
];

/// x' = f(t, x) by its symbols.
pub(super) struct Alone<'a, 'g> {
    pub graph: &'g Graph,
    pub time: Node,
    pub states: &'a [Node],
    pub derivatives: &'a [Node],
}

impl<'g> Alone<'_, 'g> {
    /// x after a step of length h, above 0; none where the matrix is too large to be eliminated by expressions.
    pub fn step(&self, h: Expr<'g>) -> Option<Vec<Expr<'g>>> {
        let g = self.graph;
        let factors = self.factors(h)?;
        let along_time: Vec<Term<'g>> = {
            let found = jacobian::forward(g, self.derivatives, &[self.time]).entries;
            let mut all = vec![None; self.derivatives.len()];
            found
                .iter()
                .for_each(|(row, _, node)| all[*row] = Some(g.expr(*node)));
            all
        };
        let start: Vec<Expr<'g>> = self.states.iter().map(|&x| g.expr(x)).collect();
        let mut stages: Vec<Vec<Term<'g>>> = vec![];
        for (time, along, moves, rights) in STAGES {
            let x = self.moved(&start, moves, &stages);
            let at = self.states.iter().copied().zip(x.iter().map(|x| x.node()));
            let t = g.expr(self.time) + h * time;
            let places = at.chain([(self.time, t.node())]).collect();
            let f = g.substitute(self.derivatives, &places);
            let right = f.iter().enumerate().map(|(i, &f)| {
                let mut all = (g.constant_value(f) != Some(0.0)).then(|| g.expr(f));
                if along != 0.0 {
                    all = sum(all, along_time[i].map(|slope| h * along * slope));
                }
                let before = rights.iter().zip(&stages);
                before.fold(all, |all, (factor, stage)| {
                    sum(all, stage[i].map(|u| u * *factor / h))
                })
            });
            stages.push(factors.solved(right.collect()));
        }
        let last = stages.pop()?;
        let x = self.moved(&start, STAGES[5].2, &stages);
        let ends = x.into_iter().zip(last);
        Some(ends.map(|(x, u)| u.map_or(x, |u| x + u)).collect())
    }

    fn moved(
        &self,
        start: &[Expr<'g>],
        factors: &[f64],
        stages: &[Vec<Term<'g>>],
    ) -> Vec<Expr<'g>> {
        let of = |(i, &x): (usize, &Expr<'g>)| {
            let terms = factors.iter().zip(stages);
            terms.fold(x, |x, (factor, stage)| match stage[i] {
                Some(u) if *factor == 1.0 => x + u,
                Some(u) => x + u * *factor,
                None => x,
            })
        };
        start.iter().enumerate().map(of).collect()
    }

    /// I/(γh) − ∂f/∂x, eliminated in the order that leaves few entries.
    fn factors(&self, h: Expr<'g>) -> Option<Factors<'g>> {
        let (g, n) = (self.graph, self.states.len());
        let mut entries: Vec<Term<'g>> = vec![None; n * n];
        for (i, j, slope) in jacobian::forward(g, self.derivatives, self.states).entries {
            if g.constant_value(slope) != Some(0.0) {
                entries[i * n + j] = Some(-g.expr(slope));
            }
        }
        for i in 0..n {
            entries[i * n + i] = sum(Some(1.0 / (h * GAMMA)), entries[i * n + i]);
        }
        let mut factors = Factors {
            n,
            entries,
            order: vec![],
        };
        while let Some(pivot) = factors.next() {
            factors.eliminate(pivot)?;
        }
        Some(factors)
    }
}

/// A matrix as L and U in its own places, by the order of its pivots.
struct Factors<'g> {
    n: usize,
    entries: Vec<Term<'g>>,
    order: Vec<usize>,
}

impl<'g> Factors<'g> {
    /// Rows, or columns, that are not done and have an entry beside this pivot's.
    fn beside(&self, pivot: usize, is_row: bool) -> Vec<usize> {
        let at = |k: usize| match is_row {
            true => pivot * self.n + k,
            false => k * self.n + pivot,
        };
        let rest = (0..self.n).filter(|k| *k != pivot && !self.order.contains(k));
        rest.filter(|k| self.entries[at(*k)].is_some()).collect()
    }

    /// Markowitz's choice: the pivot on the diagonal that can make the fewest entries.
    fn next(&self) -> Option<usize> {
        let rest = (0..self.n).filter(|k| !self.order.contains(k));
        rest.min_by_key(|&k| self.beside(k, true).len() * self.beside(k, false).len())
    }

    fn eliminate(&mut self, pivot: usize) -> Option<()> {
        let (n, diagonal) = (self.n, self.entries[pivot * self.n + pivot]?);
        let columns = self.beside(pivot, true);
        for row in self.beside(pivot, false) {
            let factor = self.entries[row * n + pivot].map(|entry| entry / diagonal);
            self.entries[row * n + pivot] = factor;
            for &column in &columns {
                let product = factor.zip(self.entries[pivot * n + column]);
                let less = product.map(|(a, b)| -(a * b));
                self.entries[row * n + column] = sum(self.entries[row * n + column], less);
            }
        }
        self.order.push(pivot);
        (self.entries.iter().flatten().count() <= MOST_ENTRIES).then_some(())
    }

    fn solved(&self, mut right: Vec<Term<'g>>) -> Vec<Term<'g>> {
        let n = self.n;
        let less = |right: &mut Vec<Term<'g>>, row: usize, from: usize| {
            let product = self.entries[row * n + from].zip(right[from]);
            right[row] = sum(right[row], product.map(|(a, b)| -(a * b)));
        };
        for (place, &pivot) in self.order.iter().enumerate() {
            for &row in &self.order[place + 1..] {
                less(&mut right, row, pivot);
            }
        }
        for (place, &pivot) in self.order.iter().enumerate().rev() {
            for &column in &self.order[place + 1..] {
                less(&mut right, pivot, column);
            }
            let diagonal = self.entries[pivot * n + pivot];
            right[pivot] = right[pivot].zip(diagonal).map(|(x, d)| x / d);
        }
        right
    }
}
