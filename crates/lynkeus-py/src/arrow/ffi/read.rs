//! What comes in: streams and arrays of somebody else.

use std::ffi::{CStr, c_char, c_int};
use std::sync::Arc;

use super::{Array, Carried, Schema, Stream};

/// The text at a pointer; empty where there is none.
fn text<'a>(at: *const c_char) -> &'a str {
    match at.is_null() {
        true => "",
        // SAFETY: the interface has texts that end with a zero and live as long as their struct,
        // which every caller below borrows
        false => unsafe { CStr::from_ptr(at) }.to_str().unwrap_or("\u{fffd}"),
    }
}

impl Schema {
    pub fn format(&self) -> &str {
        text(self.format)
    }

    pub fn name(&self) -> &str {
        text(self.name)
    }

    pub fn is_dictionary(&self) -> bool {
        !self.dictionary.is_null()
    }

    pub fn children(&self) -> impl Iterator<Item = &Schema> {
        let count = usize::try_from(self.n_children).unwrap_or(0);
        let count = if self.children.is_null() { 0 } else { count };
        // SAFETY: so many pointers to schemas, alive as long as this one
        (0..count).filter_map(move |i| unsafe { (*self.children.add(i)).as_ref() })
    }
}

impl Stream {
    /// What its arrays are made of.
    ///
    /// # Errors
    /// What the producer tells.
    pub fn schema(&mut self) -> Result<Schema, String> {
        let mut schema = Schema::released();
        let get = self.get_schema.ok_or("the stream gives no schema")?;
        // SAFETY: the producer's own function, on its stream and an empty struct to be filled
        match unsafe { get(self, &mut schema) } {
            0 => Ok(schema),
            code => Err(self.failed(code)),
        }
    }

    /// The next array, none after the last.
    ///
    /// # Errors
    /// What the producer tells.
    pub fn next(&mut self) -> Result<Option<Array>, String> {
        let mut array = Array::released();
        let get = self.get_next.ok_or("the stream gives no arrays")?;
        // SAFETY: as for the schema
        match unsafe { get(self, &mut array) } {
            0 => Ok(Some(array).filter(|array| !array.is_released())),
            code => Err(self.failed(code)),
        }
    }

    fn failed(&mut self, code: c_int) -> String {
        // SAFETY: asked right after the failure; the text lives until the next call
        let told = self.get_last_error.map(|get| text(unsafe { get(self) }));
        match told {
            Some(told) if !told.is_empty() => told.to_owned(),
            _ => std::io::Error::from_raw_os_error(code).to_string(),
        }
    }
}

/// Rows of a column, alive as long as the array that they came with.
#[derive(Clone)]
pub struct View {
    whole: Arc<Array>,
    array: *const Array,
    /// where the rows start in the buffers
    start: usize,
    rows: usize,
}

// SAFETY: `array` points into `whole`, which is shared, alive and never changed
unsafe impl Send for View {}
// SAFETY: as above
unsafe impl Sync for View {}

/// What a producer must not say.
const BROKEN: &str = "the Arrow array contradicts itself";

impl View {
    /// All rows of an array.
    ///
    /// # Errors
    /// Its lengths are no lengths.
    pub fn of(array: Array) -> Result<Self, String> {
        let whole = Arc::new(array);
        Ok(Self {
            array: Arc::as_ptr(&whole),
            start: usize::try_from(whole.offset).map_err(|_| BROKEN)?,
            rows: usize::try_from(whole.length).map_err(|_| BROKEN)?,
            whole,
        })
    }

    /// How many rows it has.
    pub fn rows(&self) -> usize {
        self.rows
    }

    fn array(&self) -> &Array {
        // SAFETY: it is `whole` or one of its children
        unsafe { &*self.array }
    }

    /// The same rows of a child.
    ///
    /// # Errors
    /// There is no such child, or it is too short.
    pub fn child(&self, place: usize) -> Result<Self, String> {
        let parent = self.array();
        let count = usize::try_from(parent.n_children).unwrap_or(0);
        if place >= count || parent.children.is_null() {
            return Err(BROKEN.into());
        }
        // SAFETY: one of as many pointers as there are children
        let array = unsafe { *parent.children.add(place) }.cast_const();
        // SAFETY: children live as long as their parent
        let child = unsafe { array.as_ref() }.ok_or(BROKEN)?;
        let offset = usize::try_from(child.offset).map_err(|_| BROKEN)?;
        let length = usize::try_from(child.length).map_err(|_| BROKEN)?;
        let start = offset.checked_add(self.start).ok_or(BROKEN)?;
        match self.start.checked_add(self.rows) {
            Some(end) if end <= length => Ok(Self {
                whole: Arc::clone(&self.whole),
                array,
                start,
                rows: self.rows,
            }),
            _ => Err(BROKEN.into()),
        }
    }

    /// So many bytes of a buffer from a place on; none where there is no such buffer.
    fn buffer(&self, place: usize, from: usize, bytes: usize) -> Option<&[u8]> {
        let array = self.array();
        let count = usize::try_from(array.n_buffers).unwrap_or(0);
        if place >= count || array.buffers.is_null() {
            return None;
        }
        // SAFETY: one of as many pointers as there are buffers
        let buffer = unsafe { *array.buffers.add(place) }.cast::<u8>();
        if buffer.is_null() {
            return (bytes == 0).then_some(&[]);
        }
        isize::try_from(from.checked_add(bytes)?).ok()?;
        // SAFETY: the interface promises a buffer as long as offset and length make it, which is no
        // longer than memory
        Some(unsafe { std::slice::from_raw_parts(buffer.add(from), bytes) })
    }

    /// Its values, so many bytes each.
    ///
    /// # Errors
    /// There is no such buffer.
    pub fn values(&self, width: usize) -> Result<&[u8], String> {
        let (from, bytes) = (self.start.checked_mul(width), self.rows.checked_mul(width));
        let values = from
            .zip(bytes)
            .and_then(|(from, bytes)| self.buffer(1, from, bytes));
        values.ok_or_else(|| BROKEN.into())
    }

    /// Its values where they are bits.
    ///
    /// # Errors
    /// There is no such buffer.
    pub fn bits(&self) -> Result<Bits<'_>, String> {
        self.bits_of(1).ok_or_else(|| BROKEN.into())
    }

    /// Which rows are there; none where all are.
    pub fn validity(&self) -> Option<Bits<'_>> {
        match self.array().null_count {
            0 => None,
            _ => self.bits_of(0),
        }
    }

    fn bits_of(&self, place: usize) -> Option<Bits<'_>> {
        let bytes = self.start.checked_add(self.rows)?.div_ceil(8);
        Some(Bits {
            bytes: self.buffer(place, 0, bytes)?,
            start: self.start,
        })
    }

    /// Its values as numbers where they are, if they lie as numbers must.
    pub fn lent(&self) -> Option<Numbers> {
        let bytes = self.values(size_of::<f64>()).ok()?;
        let place = bytes.as_ptr().cast::<f64>();
        (place.is_aligned() && !bytes.is_empty()).then(|| Numbers {
            view: self.clone(),
            place,
        })
    }
}

/// A bit for each row.
#[derive(Clone, Copy)]
pub struct Bits<'a> {
    bytes: &'a [u8],
    start: usize,
}

impl Bits<'_> {
    /// The bit of a row.
    pub fn get(&self, row: usize) -> bool {
        let at = self.start + row;
        let byte = self.bytes.get(at / 8);
        byte.is_some_and(|byte| byte >> (at % 8) & 1 == 1)
    }
}

/// Numbers in a buffer of somebody else.
pub struct Numbers {
    view: View,
    place: *const f64,
}

// SAFETY: `place` points into the array that `view` keeps alive, which nobody changes
unsafe impl Send for Numbers {}
// SAFETY: as above
unsafe impl Sync for Numbers {}

impl AsRef<[f64]> for Numbers {
    fn as_ref(&self) -> &[f64] {
        // SAFETY: aligned and as many bytes as was asked of the buffer; every word is a number
        unsafe { std::slice::from_raw_parts(self.place, self.view.rows) }
    }
}
