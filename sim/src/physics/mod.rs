//! Physics behind one trait.
