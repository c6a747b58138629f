//! Observer families, one file each.
