//! Hash-consed expression graphs, their derivatives, and tapes evaluated over many algebras.
