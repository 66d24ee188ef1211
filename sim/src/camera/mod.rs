//! Simulated cameras and their sensor model.
