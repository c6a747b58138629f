//! Simulation and log replay of systems and their observers.
