//! Boxes of variables.

use std::hash::{Hash, Hasher};

use lynkeus_expr::{Interval, Node};

/// One side of the box.
#[derive(Clone, Debug, PartialEq)]
pub struct Dimension {
    /// name shown in witnesses
    pub name: String,
    /// the symbol
    pub symbol: Node,
    /// smallest value, −∞ if not declared
    pub min: f64,
    /// largest value, +∞ if not declared
    pub max: f64,
    /// only whole numbers count
    pub integer: bool,
}

impl Dimension {
    /// Of a real variable.
    pub fn new(name: impl Into<String>, symbol: Node, min: f64, max: f64) -> Self {
        Self {
            name: name.into(),
            symbol,
            min,
            max,
            integer: false,
        }
    }
}

/// Where a variable is.
#[derive(Clone, Debug, PartialEq)]
pub struct Coordinate {
    /// name of the variable
    pub name: String,
    /// its value
    pub value: f64,
}

impl From<(String, f64)> for Coordinate {
    fn from((name, value): (String, f64)) -> Self {
        Self { name, value }
    }
}

/// A point of the box and the value of the expression in question there.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// of every variable the expression depends on
    pub coordinates: Vec<Coordinate>,
    /// value of the expression at the point
    pub value: f64,
}

/// A part of the box; without sides where none says more than the whole box.
pub type Place = Vec<Dimension>;

/// The box on which conditions are decided: the product of its dimensions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Region {
    /// the sides
    pub dimensions: Vec<Dimension>,
}

/// How far points go where no end is declared: what only happens beyond says nothing about a
/// plant, but that its ranges are missing.
const REACH: f64 = 1e9;

/// One box of a subdivision: an interval per dimension.
pub(crate) type Cell = Vec<Interval>;

impl Region {
    /// The dimensions whose symbols are among `symbols`.
    pub fn restricted(&self, symbols: &[Node]) -> Region {
        let kept = self
            .dimensions
            .iter()
            .filter(|d| symbols.contains(&d.symbol));
        Region {
            dimensions: kept.cloned().collect(),
        }
    }

    /// The symbols, in order.
    pub fn symbols(&self) -> Vec<Node> {
        self.dimensions.iter().map(|d| d.symbol).collect()
    }

    /// The whole region as one cell.
    pub(crate) fn cell(&self) -> Cell {
        let side = |d: &Dimension| Interval::new(d.min, d.max).unwrap_or(Interval::ENTIRE);
        self.dimensions.iter().map(side).collect()
    }

    /// Names and ends of a cell; beyond what points reach, an end that is not declared
    /// stands for itself.
    pub(crate) fn named(&self, cell: &Cell) -> Place {
        let sides = self.dimensions.iter().zip(cell);
        let ends = |(d, side): (&Dimension, &Interval)| {
            let (mut low, mut high) = (side.lo(), side.hi());
            if d.min == f64::NEG_INFINITY && low < d.max.min(0.0) - REACH {
                (low, high) = (d.min, high.max(d.max.min(0.0) - REACH));
            }
            if d.max == f64::INFINITY && high > d.min.max(0.0) + REACH {
                (low, high) = (low.min(d.min.max(0.0) + REACH), d.max);
            }
            Dimension {
                min: low,
                max: high,
                ..d.clone()
            }
        };
        sides.map(ends).collect()
    }

    /// Names of the dimensions without a declared end.
    pub fn open(&self) -> Vec<String> {
        undeclared(&self.dimensions)
    }

    /// A point by the names of the sides.
    pub fn coordinates(&self, point: &[f64]) -> Vec<Coordinate> {
        let sides = self.dimensions.iter().zip(point);
        sides.map(|(d, &x)| (d.name.clone(), x).into()).collect()
    }

    /// The same with the value there.
    pub(crate) fn point(&self, at: &[f64], value: f64) -> Point {
        Point {
            coordinates: self.coordinates(at),
            value,
        }
    }

    /// Whether a point is not absurdly far where no end is declared.
    pub(crate) fn reaches(&self, point: &[f64]) -> bool {
        let near = |(d, &x): (&Dimension, &f64)| {
            let below = d.min.is_finite() || x >= d.max.min(0.0) - REACH;
            let above = d.max.is_finite() || x <= d.min.max(0.0) + REACH;
            below && above
        };
        self.dimensions.iter().zip(point).all(near)
    }

    /// Halves the relatively widest side; none if every side is a point.
    pub(crate) fn split(&self, cell: &Cell) -> Option<[Cell; 2]> {
        self.split_one_of(cell, 0..cell.len())
    }

    /// Halves the relatively widest of the sides of some symbols; none where these are all
    /// narrower than the share `finest` of the region's.
    pub(crate) fn split_among(
        &self,
        cell: &Cell,
        symbols: &[Node],
        finest: f64,
    ) -> Option<[Cell; 2]> {
        let meant = |&i: &usize| {
            let side = &self.dimensions[i];
            symbols.contains(&side.symbol) && self.relative_width(i, &cell[i]) > finest
        };
        self.split_one_of(cell, (0..cell.len()).filter(meant))
    }

    fn split_one_of(&self, cell: &Cell, sides: impl Iterator<Item = usize>) -> Option<[Cell; 2]> {
        let sides = sides.map(|i| (i, self.relative_width(i, &cell[i])));
        let widest = sides.max_by(|one, other| one.1.total_cmp(&other.1))?;
        self.halves(cell, widest.0)
    }

    /// The cell cut along one side; none where that has nothing between its ends.
    pub(crate) fn halves(&self, cell: &Cell, side: usize) -> Option<[Cell; 2]> {
        let (low, high) = (cell[side].lo(), cell[side].hi());
        let left = self.middle(side, &cell[side]);
        let (right, splits) = match self.dimensions[side].integer {
            true => ((left + 1.0).min(high), low < high),
            false => (left, low < left && left < high),
        };
        if !splits {
            return None;
        }
        let (mut first, mut second) = (cell.clone(), cell.clone());
        first[side] = Interval::new(low, left).ok()?;
        second[side] = Interval::new(right, high).ok()?;
        Some([first, second])
    }

    /// The width of a side as a share of the region's.
    pub(crate) fn relative_width(&self, i: usize, side: &Interval) -> f64 {
        let width = side.hi() - side.lo();
        let whole = self.dimensions[i].max - self.dimensions[i].min;
        match whole.is_finite() && whole > 0.0 {
            true => width / whole,
            // on a scale where the line has length one: an unbounded side, such as
            // that of time, must not keep the others from being halved
            false => (side.hi().atan() - side.lo().atan()) / std::f64::consts::PI,
        }
    }

    /// A value inside a side: whole where the dimension is.
    fn middle(&self, i: usize, side: &Interval) -> f64 {
        let middle = between(side.lo(), side.hi());
        if self.dimensions[i].integer {
            middle.floor().max(side.lo())
        } else {
            middle
        }
    }

    /// A point inside: the middle, or a number within reach where a side has no end.
    pub fn centre(&self) -> Vec<f64> {
        self.middle_point(&self.cell())
    }

    /// The middle of a cell.
    pub(crate) fn middle_point(&self, cell: &Cell) -> Vec<f64> {
        (0..cell.len()).map(|i| self.middle(i, &cell[i])).collect()
    }

    /// A few points of a cell: the middle, its ends one side at a time and the
    /// two extreme corners; only finite ones.
    pub(crate) fn samples(&self, cell: &Cell) -> Vec<Vec<f64>> {
        let mut points = vec![self.middle_point(cell)];
        points.extend([lowest_corner(cell), highest_corner(cell)]);
        points.extend(self.faces(cell));
        points.retain(|p| p.iter().all(|x| x.is_finite()));
        points
    }

    /// The middles of the faces of a cell: its middle with one side at its ends.
    pub(crate) fn faces(&self, cell: &Cell) -> Vec<Vec<f64>> {
        let middle = self.middle_point(cell);
        let face = |i: usize, end: f64| {
            let mut point = middle.clone();
            point[i] = end;
            point
        };
        let sides = cell.iter().enumerate();
        sides
            .flat_map(|(i, side)| [face(i, side.lo()), face(i, side.hi())])
            .collect()
    }

    /// Whether one can move straight between two points inside the region.
    pub(crate) fn connected(&self, p: &[f64], q: &[f64]) -> bool {
        let sides = self.dimensions.iter().zip(p.iter().zip(q));
        sides.into_iter().all(|(d, (p, q))| !d.integer || p == q)
    }
}

/// Names of the sides without a declared end.
pub(crate) fn undeclared(sides: &[Dimension]) -> Vec<String> {
    let open = |side: &&Dimension| side.min.is_infinite() || side.max.is_infinite();
    let open = sides.iter().filter(open);
    open.map(|side| side.name.clone()).collect()
}

/// Every side of a cell at its lower end.
pub(crate) fn lowest_corner(cell: &Cell) -> Vec<f64> {
    cell.iter().map(|side| side.lo()).collect()
}

/// Every side of a cell at its upper end.
pub(crate) fn highest_corner(cell: &Cell) -> Vec<f64> {
    cell.iter().map(|side| side.hi()).collect()
}

/// A number inside [low, high], also where an end is infinite.
fn between(low: f64, high: f64) -> f64 {
    match (low.is_finite(), high.is_finite()) {
        (true, true) => low + (high - low) / 2.0,
        (false, false) => 0.0,
        (true, false) => (2.0 * low).max(1.0),
        (false, true) => (2.0 * high).min(-1.0),
    }
}

/// A well-spread number in [0.1, 0.9] for each (point, variable).
pub(crate) fn spread(point: usize, variable: usize) -> f64 {
    let golden = 0.618_033_988_749_894_9;
    let x = (point as f64 + 1.0) * golden + variable as f64 * 0.754_877_666_246_692_7;
    0.1 + 0.8 * x.fract()
}

/// The place in a range, 0 … 1 from end to end; near zero or the end where one is open.
pub(crate) fn inside(min: f64, max: f64, share: f64) -> f64 {
    match (min.is_finite(), max.is_finite()) {
        (true, true) => min + share * (max - min),
        (true, false) => min + 2.0 * share,
        (false, true) => max - 2.0 * share,
        (false, false) => 2.0 * share,
    }
}

/// What a search on a region depends on; the graph keeps the answers.
#[derive(Clone, PartialEq)]
pub(crate) struct Question {
    pub node: Node,
    pub region: Region,
    pub budget: usize,
}

impl Question {
    /// The question whether there is a value everywhere: of no budget, as that of no search.
    pub fn whether_valued(&self) -> Self {
        Self {
            budget: 0,
            ..self.clone()
        }
    }
}

// no end of a side is NaN
impl Eq for Question {}

impl Hash for Question {
    fn hash<H: Hasher>(&self, state: &mut H) {
        (self.node, self.budget).hash(state);
        for side in &self.region.dimensions {
            // 0 and −0 are equal
            let ends = [side.min, side.max].map(|x| (x + 0.0).to_bits());
            (side.symbol, ends).hash(state);
        }
    }
}
