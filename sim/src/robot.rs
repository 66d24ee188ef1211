//! The simulated robot: driver traits over physics and cameras.
