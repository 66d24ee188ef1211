//! Writes the reference of the book, `docs/reference/*.md`, from the program's own definitions.

#![allow(clippy::print_stdout, reason = "it tells what it wrote")]

use anyhow::{Context, Result};
use scenarios::{reference, root};

fn main() -> Result<()> {
    let folder = root().join("docs/reference");
    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    for (name, text) in reference::pages() {
        let file = folder.join(&name);
        std::fs::write(&file, text).with_context(|| file.display().to_string())?;
        println!("docs/reference/{name}");
    }
    Ok(())
}
