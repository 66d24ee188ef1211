//! What is known about categories before anything is seen.
