//! Arrow's C interfaces, by which tables go from one library to another without a copy: logs come
//! in ([`import`]), results go out ([`export`]).

pub mod export;
// the C interfaces are pointers, so that they cannot be read without `unsafe`
#[allow(unsafe_code)]
mod ffi;
pub mod import;
mod kind;
