//! Limits that are drivers: they wrap a robot and implement the same traits.
