//! A Modelica subset read into plants; every diagnostic points at the source line.
