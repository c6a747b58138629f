//! The structs of Arrow's C interfaces, and all that is unsafe about them: what comes in is moved
//! out of its capsule and read through views that keep it alive, what goes out is owned by the
//! struct that carries it. The rest of the crate sees safe functions only.
//!
//! <https://arrow.apache.org/docs/format/CDataInterface.html>,
//! <https://arrow.apache.org/docs/format/CStreamInterface.html>,
//! <https://arrow.apache.org/docs/format/CDataInterface/PyCapsuleInterface.html>

mod give;
mod read;

use std::ffi::{CStr, c_char, c_int, c_void};
use std::ptr;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyCapsule;

pub use give::{Batches, Part, schema, stream};
pub use read::{Bits, View};

/// What a producer gives to end the life of a struct.
type Release<T> = Option<unsafe extern "C" fn(*mut T)>;

/// Names and kinds of columns.
#[repr(C)]
pub struct Schema {
    format: *const c_char,
    name: *const c_char,
    metadata: *const c_char,
    flags: i64,
    n_children: i64,
    children: *mut *mut Schema,
    dictionary: *mut Schema,
    release: Release<Schema>,
    private_data: *mut c_void,
}

/// Rows of a column, or of all columns of a table.
#[repr(C)]
pub struct Array {
    length: i64,
    null_count: i64,
    offset: i64,
    n_buffers: i64,
    n_children: i64,
    buffers: *mut *const c_void,
    children: *mut *mut Array,
    dictionary: *mut Array,
    release: Release<Array>,
    private_data: *mut c_void,
}

/// Arrays one after the other.
#[repr(C)]
pub struct Stream {
    get_schema: Option<unsafe extern "C" fn(*mut Stream, *mut Schema) -> c_int>,
    get_next: Option<unsafe extern "C" fn(*mut Stream, *mut Array) -> c_int>,
    get_last_error: Option<unsafe extern "C" fn(*mut Stream) -> *const c_char>,
    release: Release<Stream>,
    private_data: *mut c_void,
}

/// A struct of the interface, which travels in a capsule of this name.
pub trait Carried: Send + Sized + 'static {
    const NAME: &'static CStr;
    /// one that holds nothing
    fn released() -> Self;
    fn is_released(&self) -> bool;
}

macro_rules! carried {
    ($kind:ident, $name:literal, { $($field:ident: $none:expr),* }) => {
        impl Carried for $kind {
            const NAME: &'static CStr = $name;

            fn released() -> Self {
                Self { release: None, private_data: ptr::null_mut(), $($field: $none),* }
            }

            fn is_released(&self) -> bool {
                self.release.is_none()
            }
        }

        // SAFETY: the interface lets any thread use and release a struct, one at a time
        unsafe impl Send for $kind {}

        impl Drop for $kind {
            fn drop(&mut self) {
                if let Some(release) = self.release {
                    // SAFETY: the producer's own function, called once: it sets `release` to null
                    unsafe { release(self) }
                }
            }
        }
    };
}

carried!(Schema, c"arrow_schema", {
    format: ptr::null(), name: ptr::null(), metadata: ptr::null(), flags: 0, n_children: 0,
    children: ptr::null_mut(), dictionary: ptr::null_mut()
});
carried!(Array, c"arrow_array", {
    length: 0, null_count: 0, offset: 0, n_buffers: 0, n_children: 0, buffers: ptr::null_mut(),
    children: ptr::null_mut(), dictionary: ptr::null_mut()
});
carried!(Stream, c"arrow_array_stream", { get_schema: None, get_next: None, get_last_error: None });

// SAFETY: nothing changes an array after it was made, so that threads may read it together
unsafe impl Sync for Array {}

/// Moves a struct out of its capsule.
///
/// # Errors
/// It is no capsule of that name, or was read before.
pub fn taken<T: Carried>(capsule: &Bound<'_, PyAny>) -> PyResult<T> {
    let capsule = capsule.cast::<PyCapsule>()?;
    let place = capsule.pointer_checked(Some(T::NAME))?.cast::<T>();
    // SAFETY: a capsule of this name holds this struct, and the interpreter's lock, which is held
    // here, keeps others from it
    let found = unsafe { place.replace(T::released()) };
    match found.is_released() {
        false => Ok(found),
        true => Err(PyValueError::new_err(format!(
            "the capsule {:?} was read before",
            T::NAME
        ))),
    }
}

/// A capsule with a struct in it, which it releases unless somebody takes it out.
///
/// # Errors
/// What Python reports.
pub fn capsule<T: Carried>(py: Python<'_>, value: T) -> PyResult<Bound<'_, PyCapsule>> {
    PyCapsule::new_with_value(py, value, T::NAME)
}
