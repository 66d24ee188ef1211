//! A Python with the libraries that others read our files with.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Says that a test was skipped, and why.
pub(crate) fn skip(reason: &str) {
    if let Some(log) = std::env::var_os("DSM_SKIP_LOG") {
        let mut log = fs::OpenOptions::new().append(true).create(true).open(log).unwrap();
        writeln!(log, "{reason}").unwrap();
    }
}

/// A Python with `packages`, kept beside the build in a folder of this name; `None` where it cannot be had.
pub(crate) fn find_python(name: &str, packages: &[&str]) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let (python, done) = (folder.join("bin/python"), folder.join("packages"));
    let wanted = packages.join("\n");
    if fs::read_to_string(&done).is_ok_and(|found| found == wanted) {
        return Some(python);
    }
    let succeeds = |command: &mut Command| command.output().is_ok_and(|output| output.status.success());
    let made = succeeds(Command::new("python3").args(["-m", "venv"]).arg(&folder));
    let install = ["-m", "pip", "install", "--quiet", "--retries", "1", "--timeout", "20"];
    if made && succeeds(Command::new(&python).args(install).args(packages)) {
        fs::write(done, wanted).unwrap();
        return Some(python);
    }
    None
}

/// What `script`, a file of this folder's parent, prints for a folder; it must end well.
pub(crate) fn run_script(python: &Path, script: &str, folder: &Path) -> String {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(script);
    let output = Command::new(python).arg(script).arg(folder).output().unwrap();
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{said}");
    said
}
