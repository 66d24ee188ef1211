//! A Python with the libraries that others read our files with.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

const PACKAGES: [&str; 4] = ["plyfile==1.1.5", "pygltflib==1.16.5", "spark-dsg==1.1.3", "mcap==1.6.0"];

/// Says that a test was skipped, and why.
pub(crate) fn skip(reason: &str) {
    if let Some(log) = std::env::var_os("DSM_SKIP_LOG") {
        let mut log = fs::OpenOptions::new().append(true).create(true).open(log).unwrap();
        writeln!(log, "{reason}").unwrap();
    }
}

/// The Python, kept beside the build; `None` where it cannot be had.
pub(crate) fn find_python() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("exchange-python");
    let (python, done) = (folder.join("bin/python"), folder.join("packages"));
    let wanted = PACKAGES.join("\n");
    if fs::read_to_string(&done).is_ok_and(|found| found == wanted) {
        return Some(python);
    }
    let succeeds = |command: &mut Command| command.output().is_ok_and(|output| output.status.success());
    let made = succeeds(Command::new("python3").args(["-m", "venv"]).arg(&folder));
    let install = ["-m", "pip", "install", "--quiet", "--retries", "1", "--timeout", "20"];
    if made && succeeds(Command::new(&python).args(install).args(PACKAGES)) {
        fs::write(done, wanted).unwrap();
        return Some(python);
    }
    None
}
