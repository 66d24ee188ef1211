//! `dsm suite-compare A B`: two suites side by side, as a table, as JSON and as a page.

use super::suite_change::Comparison;
use super::suite_compare_page::compare_page;
use super::suite_file::SuiteFolder;
use super::{Output, ResultArgs};
use crate::error::TaskError;
use dsm::store::write_atomically;
use std::path::{Component, Path, PathBuf};

/// Arguments of `dsm suite-compare`.
#[derive(Debug, clap::Args)]
pub struct SuiteCompareArgs {
    /// The first suite: its folder, or its suite.json.
    a: PathBuf,
    /// The second suite; code 1 when an episode and seed fails here that succeeds in the first.
    b: PathBuf,
    /// The page to write; its folder is made. It links the pages of all episodes where they lie.
    #[arg(long, value_name = "FILE", default_value = "out/compare.html")]
    page: PathBuf,
    #[command(flatten)]
    result: ResultArgs,
}

/// Compares; code 1 when something got worse.
pub(super) fn run(args: SuiteCompareArgs) -> anyhow::Result<u8> {
    let [a, b] = [SuiteFolder::load(&args.a)?, SuiteFolder::load(&args.b)?];
    let comparison = Comparison::of(&a, &b);
    if comparison.a.shared.of == 0 {
        let [a, b] = [a.folder.display(), b.folder.display()];
        return Err(TaskError::Usage(format!("{a} and {b} have no episode and seed in common")).into());
    }
    let folder = args.page.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let read = |path: &Path| {
        let path = path.to_owned();
        move |source| TaskError::Read { path, source }
    };
    std::fs::create_dir_all(folder).map_err(read(folder))?;
    let to = |suite: &SuiteFolder| -> Result<String, TaskError> {
        let whole = |path: &Path| path.canonicalize().map_err(read(path));
        Ok(way(&whole(folder)?, &whole(&suite.folder)?))
    };
    let page = compare_page(&comparison, [(&a, &to(&a)?), (&b, &to(&b)?)]);
    write_atomically(&args.page, page.as_bytes()).map_err(TaskError::from)?;
    Output::new(args.result).give(&comparison, || {
        let mut text = comparison.table();
        text.push_str(&format!("page {}\n", args.page.display()));
        text
    })?;
    Ok(u8::from(comparison.worse > 0))
}

/// The way from one folder to another, both whole: nothing, or a relative path that ends with a slash.
fn way(from: &Path, to: &Path) -> String {
    let (from, to): (Vec<Component<'_>>, Vec<Component<'_>>) = (from.components().collect(), to.components().collect());
    let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let down = to[shared..].iter().map(|part| part.as_os_str().to_string_lossy().into_owned() + "/");
    "../".repeat(from.len() - shared) + &down.collect::<String>()
}

#[cfg(test)]
mod tests {
    //! Contract: links lead from the page to the suites wherever both lie.
    use super::*;

    #[test]
    fn a_way_leads_up_and_down() {
        let way = |from: &str, to: &str| way(Path::new(from), Path::new(to));
        assert_eq!(way("/x/out", "/x/out"), "");
        assert_eq!(way("/x/out", "/x/out/suite"), "suite/");
        assert_eq!(way("/x/pages/new", "/x/out/suite"), "../../out/suite/");
    }
}
