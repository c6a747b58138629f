//! What the theorems of several families share: slopes on the box, and words. The numbers
//! are [`lynkeus_proof`]'s.

pub(crate) mod slopes;
pub(crate) mod threshold;
pub(crate) mod words;
