//! The simulated detector: what a good open-vocabulary detector would say, with its errors.
