//! Contract: the report of a run and the index of a suite open in a browser without a line in its console, and fit a
//! telephone and a desk. Skipped where there is no Chromium.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its run fails")]

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

fn find_browser() -> Option<&'static str> {
    let answers = |name: &&str| {
        let asked = Command::new(name).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        asked.is_ok_and(|status| status.success())
    };
    BROWSERS.into_iter().find(answers)
}

fn skip(reason: &str) {
    if let Some(log) = std::env::var_os("DSM_SKIP_LOG") {
        let mut log = fs::OpenOptions::new().append(true).create(true).open(log).unwrap();
        writeln!(log, "pages: {reason}").unwrap();
    }
}

/// The width that a page needs in a window of `width` pixels, and what the browser wrote into its console.
fn open(browser: &str, folder: &Path, page: &Path, width: u32) -> (u32, Vec<String>) {
    let frame = folder.join(format!("frame-{width}.html"));
    let text = format!(
        "<!doctype html><body><iframe id=f style='border:0;width:{width}px;height:900px' src='file://{}' onload=\"\
         document.body.dataset.needs=f.contentDocument.documentElement.scrollWidth\"></iframe>",
        page.display()
    );
    fs::write(&frame, text).unwrap();
    let out = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--allow-file-access-from-files"])
        .args(["--enable-logging=stderr", "--window-size=1600,1000", "--dump-dom"])
        .arg(format!("--user-data-dir={}", folder.join("profile").display()))
        .arg(format!("file://{}", frame.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&out.stdout).into_owned();
    let needs = dom.split("data-needs=\"").nth(1).and_then(|rest| rest.split('"').next()?.parse().ok());
    let console =
        String::from_utf8_lossy(&out.stderr).lines().filter(|l| l.contains("CONSOLE")).map(str::to_owned).collect();
    (needs.unwrap_or_else(|| panic!("{} did not open", page.display())), console)
}

#[test]
fn pages_open_without_complaints_and_fit_small_and_large_windows() {
    let Some(browser) = find_browser() else { return skip("no Chromium on this machine") };
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("suite");
    let episode = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/apartment/episodes/fetch_apple.toml");
    let mut command = Command::new(env!("CARGO_BIN_EXE_dsm"));
    for variable in ["DSM_SEED", "DSM_ROBOT", "DSM_PHYSICS", "DSM_PERCEPTION", "DSM_THREADS", "DSM_LOG"] {
        command.env_remove(variable);
    }
    command.env("DSM_TIME_LIMIT_S", "12").arg("suite").arg(episode).args(["--seeds", "2..3", "--out"]).arg(&out);
    command.stdout(Stdio::null()).stderr(Stdio::null()).status().unwrap();
    for page in ["index.html", "fetch_apple-2/report.html", "fetch_apple-2/failure.html"].map(|page| out.join(page)) {
        for width in [390, 1440] {
            let (needs, console) = open(browser, folder.path(), &page, width);
            assert!(console.is_empty(), "{}: {console:?}", page.display());
            assert!(needs <= width, "{} needs {needs} of {width} px", page.display());
        }
    }
}
