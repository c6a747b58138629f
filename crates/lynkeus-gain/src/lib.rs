//! Small dense linear algebra of observer gains.
