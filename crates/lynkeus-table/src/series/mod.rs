//! Columns of numbers that may be longer than memory is large.

mod sorted;
mod store;
mod tail;

pub use sorted::Sorted;
pub use store::Store;
pub use store::folder;
pub use tail::Lent;

use lynkeus_answer::Error;
use tail::Tail;

/// Numbers that go to the disk together.
const BLOCK: usize = 1 << 15;

/// Numbers that are read of a long series at a time, an equal share of a block: they stay in a cache, those of
/// other columns beside them.
const PART: usize = 1 << 12;

/// The numbers of one column, in the order of its rows. A long one is on disk, but for its end: it
/// is read from its front to its end, a block at a time.
///
/// A disk that is full, or fails, leaves NaN: whoever shows numbers or writes them asks
/// [`check`](Self::check) before they count.
#[derive(Clone, Debug, Default)]
pub struct Series {
    store: Store,
    /// where its blocks are in the store
    blocks: Vec<u64>,
    /// the numbers after them
    tail: Tail,
}

impl Series {
    /// An empty one, whose blocks this store will keep.
    pub fn within(store: &Store) -> Self {
        Self {
            store: store.clone(),
            ..Self::default()
        }
    }

    /// Of these numbers, its blocks kept by this store.
    pub fn gathered(store: &Store, values: impl IntoIterator<Item = f64>) -> Self {
        let mut series = Self::within(store);
        values.into_iter().for_each(|x| series.push(x));
        series
    }

    /// Of numbers that stay where they are.
    #[must_use]
    pub fn lent(values: Lent) -> Self {
        Self {
            tail: Tail::lent(values),
            ..Self::default()
        }
    }

    /// The number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.blocks.len() * BLOCK + self.tail.len()
    }

    /// Whether it has no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds a row.
    #[inline]
    pub fn push(&mut self, x: f64) {
        let tail = self.tail.own();
        if tail.len() < BLOCK {
            return tail.push(x);
        }
        self.keep();
        self.tail.own().push(x);
    }

    /// Takes whole blocks to the disk.
    #[cold]
    fn keep(&mut self) {
        let tail = self.tail.own();
        let (blocks, rest) = tail.as_chunks::<BLOCK>();
        self.blocks
            .extend(blocks.iter().map(|b| self.store.keep(b)));
        *tail = rest.to_vec();
        tail.reserve_exact(BLOCK - tail.len());
    }

    /// The number in a row; a long series is better [read on](Self::iter_from).
    #[must_use]
    pub fn get(&self, row: usize) -> Option<f64> {
        let Some(place) = self.blocks.get(row / BLOCK) else {
            return self.tail.get(row - self.blocks.len() * BLOCK).copied();
        };
        let mut value = [f64::NAN];
        self.store.read(*place, row % BLOCK, &mut value);
        Some(value[0])
    }

    /// The number in the first row.
    #[must_use]
    pub fn first(&self) -> Option<f64> {
        self.get(0)
    }

    /// The number in the last row.
    #[must_use]
    pub fn last(&self) -> Option<f64> {
        self.get(self.len().checked_sub(1)?)
    }

    /// The numbers from the first row on.
    #[must_use]
    pub fn iter(&self) -> Iter<'_> {
        self.iter_from(0)
    }

    /// The numbers from a row on.
    #[must_use]
    pub fn iter_from(&self, row: usize) -> Iter<'_> {
        let before = self.blocks.len() * BLOCK;
        let next = (row - row % PART).min(before);
        let mut iter = Iter {
            series: self,
            tail: &self.tail,
            next,
            part: vec![],
            at: row - next,
        };
        if next < before {
            let at = iter.at;
            iter.turn();
            iter.at = at;
        }
        iter
    }

    /// All numbers at once, however many.
    #[must_use]
    pub fn to_vec(&self) -> Vec<f64> {
        self.part(0, self.len())
    }

    /// At most so many numbers from a row on.
    #[must_use]
    pub fn part(&self, from: usize, count: usize) -> Vec<f64> {
        let to = self.len().min(from.saturating_add(count));
        let in_blocks = to.min(self.blocks.len() * BLOCK);
        let mut values = Vec::with_capacity(to.saturating_sub(from));
        let mut row = from;
        while row < in_blocks {
            let (block, at) = (row / BLOCK, row % BLOCK);
            let rows = (BLOCK - at).min(in_blocks - row);
            self.store.append(self.blocks[block], at, rows, &mut values);
            row += rows;
        }
        let before = self.blocks.len() * BLOCK;
        let tail = row.max(before) - before..to.max(before) - before;
        values.extend_from_slice(self.tail.get(tail).unwrap_or_default());
        values
    }

    /// All numbers at once, where they are needed in any order.
    ///
    /// # Errors
    /// They do not fit into memory.
    pub fn held(&self) -> Result<Vec<f64>, Error> {
        let mut values = vec![];
        values.try_reserve_exact(self.len()).map_err(|_| {
            Error::input(format!("{} rows do not fit into memory", self.len()))
                .hint("take fewer rows at a time, or allow more memory")
        })?;
        values.extend(self);
        Ok(values)
    }

    /// The first so many rows of it.
    pub fn shortened(&self, rows: usize) -> Self {
        let whole = rows / BLOCK;
        if whole < self.blocks.len() {
            let from = whole * BLOCK;
            return Self {
                store: self.store.clone(),
                blocks: self.blocks[..whole].to_vec(),
                tail: self.part(from, rows - from).into(),
            };
        }
        let mut series = self.clone();
        series.tail.truncate(rows - self.blocks.len() * BLOCK);
        series
    }

    /// Whether every number is what it was.
    ///
    /// # Errors
    /// The disk was full, or failed.
    pub fn check(&self) -> Result<(), Error> {
        self.store.check()
    }

    /// What keeps its blocks.
    pub fn store(&self) -> &Store {
        &self.store
    }
}

/// Of numbers that are in memory already, where they stay.
impl From<Vec<f64>> for Series {
    fn from(values: Vec<f64>) -> Self {
        Self {
            tail: values.into(),
            ..Self::default()
        }
    }
}

impl PartialEq for Series {
    fn eq(&self, other: &Self) -> bool {
        self.len() == other.len() && self.iter().eq(other.iter())
    }
}

impl<'s> IntoIterator for &'s Series {
    type Item = f64;
    type IntoIter = Iter<'s>;

    fn into_iter(self) -> Iter<'s> {
        self.iter()
    }
}

/// The numbers of a [`Series`], row by row.
#[derive(Clone, Debug)]
pub struct Iter<'s> {
    series: &'s Series,
    /// the numbers after all blocks
    tail: &'s [f64],
    /// the row from which on is read next
    next: usize,
    /// the part of a block that is being read; empty in the tail
    part: Vec<f64>,
    at: usize,
}

impl Iter<'_> {
    /// Goes to the next part, or to the tail after the last.
    fn turn(&mut self) {
        self.at = 0;
        match self.series.blocks.get(self.next / BLOCK) {
            Some(place) => {
                self.part.resize(PART, f64::NAN);
                let from = self.next % BLOCK;
                self.series.store.read(*place, from, &mut self.part);
                self.next += PART;
            }
            None => self.part = vec![],
        }
    }

    /// The first number after a part; none after the tail.
    #[cold]
    fn turned(&mut self) -> Option<f64> {
        if self.part.is_empty() {
            return None;
        }
        self.turn();
        self.next()
    }
}

impl Iterator for Iter<'_> {
    type Item = f64;

    #[inline]
    fn next(&mut self) -> Option<f64> {
        let present = match self.part.is_empty() {
            true => self.tail,
            false => &self.part,
        };
        let Some(x) = present.get(self.at) else {
            return self.turned();
        };
        self.at += 1;
        Some(*x)
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = match self.part.is_empty() {
            true => self.tail.len().saturating_sub(self.at),
            false => PART - self.at + self.series.len() - self.next,
        };
        (left, Some(left))
    }
}

impl ExactSizeIterator for Iter<'_> {}

/// Points of a reading, in the order of time, that are there.
pub fn points(time: &Series, values: &Series) -> impl Iterator<Item = (f64, f64)> {
    time.iter().zip(values).filter(|(_, y)| y.is_finite())
}

/// From each of the values to the next.
pub fn steps(values: impl Iterator<Item = f64>) -> impl Iterator<Item = f64> {
    let mut before = None;
    values.filter_map(move |x| before.replace(x).map(|before| x - before))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(count: usize) -> impl Iterator<Item = f64> + Clone {
        (0..count).map(|k| (k as f64).sqrt())
    }

    #[test]
    fn what_goes_to_the_disk_comes_back_in_order() {
        for count in [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK, 3 * BLOCK + 7] {
            let series = Series::gathered(&Store::default(), numbers(count));
            assert_eq!(series.len(), count);
            assert!(series.iter().eq(numbers(count)), "{count}");
            assert!(series.clone().tail.own().capacity() <= 2 * BLOCK);
            for from in [
                0,
                1,
                BLOCK - 1,
                BLOCK,
                BLOCK + 1,
                2 * BLOCK + 3,
                count,
                count + 1,
            ] {
                let rest = series.iter_from(from);
                assert_eq!(
                    rest.len(),
                    count.saturating_sub(from),
                    "{count} from {from}"
                );
                assert!(rest.eq(numbers(count).skip(from)), "{count} from {from}");
                assert_eq!(series.get(from), numbers(count).nth(from));
                let short = series.shortened(from.min(count));
                assert!(short.iter().eq(numbers(count).take(from)));
                let part = numbers(count).skip(from).take(BLOCK + 3);
                assert!(series.part(from, BLOCK + 3).into_iter().eq(part));
            }
            assert_eq!(series.last(), numbers(count).last());
            assert_eq!(Series::from(series.to_vec()), series);
            assert!(series.check().is_ok());
        }
    }

    #[test]
    fn a_clone_goes_its_own_way() {
        let mut a = Series::gathered(&Store::default(), numbers(BLOCK + 5));
        let mut b = a.clone();
        (0..BLOCK).for_each(|_| a.push(1.0));
        (0..BLOCK).for_each(|_| b.push(2.0));
        assert!(a.iter().skip(BLOCK + 5).all(|x| x == 1.0));
        assert!(b.iter().skip(BLOCK + 5).all(|x| x == 2.0));
        // what was in memory before may be longer than a block
        let mut held = Series::from(vec![3.0; 2 * BLOCK + 1]);
        held.push(4.0);
        assert_eq!((held.len(), held.last()), (2 * BLOCK + 2, Some(4.0)));
        assert_eq!(held.iter().sum::<f64>(), 3.0 * (2 * BLOCK + 1) as f64 + 4.0);
    }

    #[test]
    fn lent_numbers_stay_where_they_are_until_they_are_changed() {
        let owner: Lent = std::sync::Arc::new(vec![1.0, 2.0, 3.0]);
        let mut series = Series::lent(owner.clone());
        let twin = series.clone();
        let place = (*owner).as_ref().as_ptr();
        assert_eq!(twin.tail.as_ptr(), place);
        assert_eq!(series.shortened(3).tail.as_ptr(), place);
        assert_eq!(series.shortened(2).to_vec(), [1.0, 2.0]);
        series.push(4.0);
        assert_eq!(series.to_vec(), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(
            (twin.to_vec(), (*owner).as_ref().len()),
            (vec![1.0, 2.0, 3.0], 3)
        );
    }

    #[test]
    fn steps_lie_between_neighbours() {
        let found: Vec<f64> = steps([1.0, 4.0, 3.0].into_iter()).collect();
        assert_eq!(found, [3.0, -1.0]);
        let readings = Series::from(vec![1.0, f64::NAN, 2.0]);
        let time = Series::from(vec![0.0, 1.0, 2.0]);
        assert!(points(&time, &readings).eq([(0.0, 1.0), (2.0, 2.0)]));
    }
}
