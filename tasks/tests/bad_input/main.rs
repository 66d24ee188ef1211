//! Contract: broken input ends with exit code 2 and an error that names the file, the line where one is known, and what
//! was expected; nothing is printed on stdout, no file is written or changed, and nothing panics.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its files fails")]

mod bench;
mod episodes;
mod evals;
mod flags;
mod known_boxes;
mod maps;
mod robots;
mod scenes;
mod segmentation;
mod sequences;
