//! What goes out: columns of numbers in batches.

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;

use super::{Array, Carried, Schema, Stream};

/// Rows of a column.
#[derive(Default)]
pub struct Part {
    values: Vec<f64>,
    /// a bit for each row that is there; none where all are
    validity: Option<Vec<u8>>,
    missing: usize,
}

impl Part {
    /// Of these numbers; a NaN is a null.
    pub fn of(values: Vec<f64>) -> Self {
        let missing = values.iter().filter(|x| x.is_nan()).count();
        let bits = |values: &[f64]| {
            let bits = values.iter().enumerate();
            bits.fold(0, |byte, (i, x)| byte | u8::from(!x.is_nan()) << i)
        };
        Self {
            validity: (missing > 0).then(|| values.chunks(8).map(bits).collect()),
            missing,
            values,
        }
    }
}

/// Rows of a table, batch by batch.
pub trait Batches: Send {
    /// Headers of the columns.
    fn names(&self) -> &[String];
    /// The next rows of every column.
    ///
    /// # Errors
    /// In words.
    fn next(&mut self) -> Result<Option<Vec<Part>>, String>;
}

/// The column may have rows without a value.
const NULLABLE: i64 = 2;

/// "Input/output error" of every system.
const EIO: c_int = 5;

/// Children on the heap, where a struct points to them.
struct Children<T>(Vec<*mut T>);

impl<T> Children<T> {
    fn of(children: impl Iterator<Item = T>) -> Self {
        Self(children.map(|c| Box::into_raw(Box::new(c))).collect())
    }

    fn count(&self) -> i64 {
        i64::try_from(self.0.len()).unwrap_or(0)
    }
}

impl<T> Drop for Children<T> {
    fn drop(&mut self) {
        for child in self.0.drain(..) {
            // SAFETY: made by `of`, dropped once; a child that was moved away is left as released
            drop(unsafe { Box::from_raw(child) });
        }
    }
}

/// What a struct of this kind points to.
struct Owner<T> {
    children: Children<T>,
    name: CString,
    /// what `buffers` point into
    _part: Part,
    buffers: Vec<*const c_void>,
}

/// Ends what a schema or an array points to.
macro_rules! release {
    ($name:ident, $kind:ident, $owner:ty) => {
        unsafe extern "C" fn $name(given: *mut $kind) {
            // SAFETY: called by whoever owns the struct, once, and it is one of ours
            let given = unsafe { &mut *given };
            // SAFETY: `private_data` is the box that it was made with
            drop(unsafe { Box::from_raw(given.private_data.cast::<$owner>()) });
            given.release = None;
            given.private_data = ptr::null_mut();
        }
    };
}

release!(release_schema, Schema, Owner<Schema>);
release!(release_array, Array, Owner<Array>);
release!(release_stream, Stream, Giving);

/// A table of columns of numbers.
pub fn schema(names: &[String]) -> Schema {
    let columns = names.iter().map(|name| field(name, c"g", [].into_iter()));
    field("", c"+s", columns)
}

fn field(name: &str, format: &'static CStr, children: impl Iterator<Item = Schema>) -> Schema {
    let mut owner = Box::new(Owner {
        children: Children::of(children),
        name: CString::new(name.replace('\0', "\u{fffd}")).unwrap_or_default(),
        _part: Part::default(),
        buffers: vec![],
    });
    let is_table = !owner.children.0.is_empty();
    Schema {
        format: format.as_ptr(),
        name: owner.name.as_ptr(),
        metadata: ptr::null(),
        flags: if is_table { 0 } else { NULLABLE },
        n_children: owner.children.count(),
        children: owner.children.0.as_mut_ptr(),
        dictionary: ptr::null_mut(),
        release: Some(release_schema),
        private_data: Box::into_raw(owner).cast(),
    }
}

/// So many columns, equally long: a reader trusts these lengths.
fn batch(parts: Vec<Part>, count: usize) -> Result<Array, String> {
    let rows = parts.first().map_or(0, |part| part.values.len());
    if parts.len() != count || parts.iter().any(|part| part.values.len() != rows) {
        return Err("internal fault: the columns differ in length".into());
    }
    let columns = Children::of(parts.into_iter().map(|part| {
        let validity = part.validity.as_ref();
        let validity = validity.map_or(ptr::null(), |bits| bits.as_ptr().cast());
        let buffers = vec![validity, part.values.as_ptr().cast()];
        array(part.values.len(), part, buffers, Children(vec![]))
    }));
    let nothing = Part::default();
    Ok(array(rows, nothing, vec![ptr::null()], columns))
}

fn array(rows: usize, part: Part, buffers: Vec<*const c_void>, children: Children<Array>) -> Array {
    let missing = i64::try_from(part.missing).unwrap_or(0);
    let mut owner = Box::new(Owner {
        children,
        name: CString::default(),
        _part: part,
        buffers,
    });
    Array {
        length: i64::try_from(rows).unwrap_or(0),
        null_count: missing,
        offset: 0,
        n_buffers: i64::try_from(owner.buffers.len()).unwrap_or(0),
        buffers: owner.buffers.as_mut_ptr(),
        n_children: owner.children.count(),
        children: owner.children.0.as_mut_ptr(),
        dictionary: ptr::null_mut(),
        release: Some(release_array),
        private_data: Box::into_raw(owner).cast(),
    }
}

/// A stream's batches, and the words of its last failure.
struct Giving {
    batches: Box<dyn Batches>,
    failure: CString,
}

/// A stream of these batches.
pub fn stream(batches: Box<dyn Batches>) -> Stream {
    let giving = Giving {
        batches,
        failure: CString::default(),
    };
    Stream {
        get_schema: Some(get_schema),
        get_next: Some(get_next),
        get_last_error: Some(get_last_error),
        release: Some(release_stream),
        private_data: Box::into_raw(Box::new(giving)).cast(),
    }
}

/// What a stream of ours gives.
///
/// # Safety
/// `stream` is one of [`stream`] that is not released, and nobody else uses it meanwhile.
unsafe fn giving<'a>(stream: *mut Stream) -> &'a mut Giving {
    // SAFETY: by the function's terms, `private_data` is the box that the stream was made with
    unsafe { &mut *(*stream).private_data.cast::<Giving>() }
}

unsafe extern "C" fn get_schema(stream: *mut Stream, out: *mut Schema) -> c_int {
    // SAFETY: the consumer calls it on our own stream
    let giving = unsafe { giving(stream) };
    // SAFETY: the consumer gives a place for a schema
    unsafe { out.write(schema(giving.batches.names())) };
    0
}

unsafe extern "C" fn get_next(stream: *mut Stream, out: *mut Array) -> c_int {
    // SAFETY: the consumer calls it on our own stream
    let giving = unsafe { giving(stream) };
    let next = catch_unwind(AssertUnwindSafe(|| {
        let parts = giving.batches.next()?;
        let count = giving.batches.names().len();
        parts.map(|parts| batch(parts, count)).transpose()
    }));
    let found = match next.unwrap_or_else(|_| Err("internal fault".into())) {
        Ok(Some(array)) => array,
        Ok(None) => Array::released(),
        Err(why) => {
            giving.failure = CString::new(why.replace('\0', " ")).unwrap_or_default();
            return EIO;
        }
    };
    // SAFETY: the consumer gives a place for an array
    unsafe { out.write(found) };
    0
}

unsafe extern "C" fn get_last_error(stream: *mut Stream) -> *const c_char {
    // SAFETY: the consumer calls it on our own stream
    let giving = unsafe { giving(stream) };
    match giving.failure.is_empty() {
        true => ptr::null(),
        false => giving.failure.as_ptr(),
    }
}
