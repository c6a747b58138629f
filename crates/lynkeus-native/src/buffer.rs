//! Numbers that begin with a cache line.

/// Bytes of a cache line.
const LINE: usize = 64;

/// A run of values of `LANES` numbers that begins with a cache line, so that none of them lies
/// across two.
#[derive(Debug, Default)]
pub struct Buffer<const LANES: usize> {
    numbers: Vec<f64>,
    first: usize,
    len: usize,
}

impl<const LANES: usize> Buffer<LANES> {
    /// `len` values, all zero.
    #[must_use]
    pub fn new(len: usize) -> Self {
        let spare = LINE / size_of::<f64>();
        let numbers = vec![0.0; len * LANES + spare];
        let first = numbers.as_ptr().align_offset(LINE).min(spare);
        Self {
            numbers,
            first,
            len,
        }
    }

    /// The values.
    #[must_use]
    pub fn values(&self) -> &[[f64; LANES]] {
        let numbers = &self.numbers[self.first..];
        &numbers.as_chunks().0[..self.len]
    }

    /// The values, to write to.
    pub fn values_mut(&mut self) -> &mut [[f64; LANES]] {
        let numbers = &mut self.numbers[self.first..];
        &mut numbers.as_chunks_mut().0[..self.len]
    }
}

/// A copy begins with a cache line of its own.
impl<const LANES: usize> Clone for Buffer<LANES> {
    fn clone(&self) -> Self {
        let mut copy = Self::new(self.len);
        copy.values_mut().copy_from_slice(self.values());
        copy
    }
}
