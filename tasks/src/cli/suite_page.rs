//! `index.html` of a suite: failures by stage, then every episode, each one click from its own page.

use super::suite_file::SuiteFolder;
use super::suite_result::{Suite, SuiteEpisode, describe, word};
use super::{Output, ResultArgs};
use crate::cli::run::REPORT_FILE;
use crate::error::TaskError;
use crate::failure_page::FAILURE_FILE;
use crate::picture::escape;
use crate::report::{close_page, open_page};
use crate::summary::Metrics;
use dsm::store::write_atomically;
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Name of the page in the folder of its suite.
const INDEX_FILE: &str = "index.html";
/// Up to so many failed episodes are listed below their stage from the start; more open by a click.
const MOST_OPEN: usize = 20;
/// What a relative link may hold as it is.
const IN_LINKS: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'_').remove(b'.').remove(b'/').remove(b'~');

/// Arguments of `dsm suite-page`.
#[derive(Debug, clap::Args)]
pub struct SuitePageArgs {
    /// The folder of a suite, with its suite.json.
    suite: PathBuf,
    #[command(flatten)]
    result: ResultArgs,
}

#[derive(Serialize)]
struct Written {
    page: PathBuf,
    episodes: usize,
}

/// Writes the page of a suite that ran before.
pub(super) fn run(args: SuitePageArgs) -> anyhow::Result<u8> {
    let SuiteFolder { folder, suite } = SuiteFolder::load(&args.suite)?;
    write_index(&suite, &folder)?;
    let written = Written { page: folder.join(INDEX_FILE), episodes: suite.episodes.len() };
    Output::new(args.result)
        .give(&written, || format!("{} episodes in {}\n", written.episodes, written.page.display()))?;
    Ok(0)
}

/// Writes the page into the suite's folder.
pub(super) fn write_index(suite: &Suite, folder: &Path) -> Result<(), TaskError> {
    Ok(write_atomically(&folder.join(INDEX_FILE), index_page(suite, folder).as_bytes())?)
}

/// An episode and its pages, as links from another page.
pub(super) struct Linked<'a> {
    /// The episode.
    pub episode: &'a SuiteEpisode,
    report: Option<String>,
    failure: Option<String>,
}

impl<'a> Linked<'a> {
    /// Finds the pages of an episode. `to_suite` leads from the page that links to the suite's folder: nothing, or a
    /// relative path that ends with a slash.
    pub(super) fn find(episode: &'a SuiteEpisode, folder: &Path, to_suite: &str) -> Self {
        let own = format!("{}-{}", episode.id, episode.seed);
        let page = |name: &str| {
            let is_there = folder.join(&own).join(name).is_file();
            is_there.then(|| link(&format!("{to_suite}{own}/{name}")))
        };
        Self { episode, report: page(REPORT_FILE), failure: page(FAILURE_FILE).filter(|_| !episode.success) }
    }

    /// Name and seed, which lead to the report, or to the page of the failure where there is none.
    pub(super) fn name(&self) -> String {
        let name = format!("{}, seed {}", escape(&self.episode.id), self.episode.seed);
        linked(self.report.as_ref().or(self.failure.as_ref()), name)
    }

    /// The outcome, which leads to the page of the failure, or to the report where there is none.
    pub(super) fn mark(&self) -> String {
        let stage = self.episode.failed_stage.map_or("failed".to_owned(), word);
        let (class, word) = if self.episode.success { ("good", "success") } else { ("bad", stage.as_str()) };
        let mark = format!("<span class=\"mark {class}\">{}</span>", escape(word));
        linked(self.failure.as_ref().or(self.report.as_ref()), mark)
    }

    /// Why it failed, as text for a page; nothing for a success.
    pub(super) fn why(&self) -> String {
        escape(self.episode.reason.as_deref().unwrap_or_default())
    }
}

fn linked(page: Option<&String>, what: String) -> String {
    page.map_or(what.clone(), |page| format!("<a href=\"{page}\">{what}</a>"))
}

/// A relative path as a link.
pub(super) fn link(path: &str) -> String {
    utf8_percent_encode(path, IN_LINKS).to_string()
}

/// The page; which episodes have pages of their own is looked up below `folder`.
fn index_page(suite: &Suite, folder: &Path) -> String {
    let lines: Vec<Linked<'_>> = suite.episodes.iter().map(|episode| Linked::find(episode, folder, "")).collect();
    let mut html = open_page("Suite");
    write_head(&mut html, suite);
    write_stages(&mut html, &lines);
    write_episodes(&mut html, &lines);
    close_page(html)
}

// Writing to a String cannot fail, which is why the results of `write!` are dropped throughout.

fn write_head(html: &mut String, suite: &Suite) {
    let t = &suite.totals;
    let [low, high] = t.success_interval.map(|share| 100.0 * share);
    let _ = writeln!(
        html,
        "<h1>Suite</h1>\n<p>{} of {} episodes succeeded ({:.0} %, 95 % interval {low:.0} to {high:.0} %); {} collisions, \
         {} limit violations, {:.0} simulated seconds.</p>",
        t.successes,
        t.episodes,
        100.0 * t.success_rate,
        t.collisions,
        t.limit_violations,
        t.sim_time_s
    );
    if t.by_skill.is_empty() {
        return;
    }
    html.push_str("<h2>Successes by skill</h2>\n<div class=\"wide\"><table class=\"narrow\"><tbody>\n");
    for (skill, share) in &t.by_skill {
        let _ = writeln!(html, "<tr><td>{}</td><td>{}</td></tr>", escape(skill), describe(share));
    }
    html.push_str("</tbody></table></div>\n");
}

/// Each stage with its episodes, the one in which most fail first.
fn write_stages(html: &mut String, lines: &[Linked<'_>]) {
    html.push_str("<h2>Failures by stage</h2>\n");
    let mut stages: BTreeMap<String, Vec<&Linked<'_>>> = BTreeMap::new();
    for line in lines {
        if let Some(stage) = line.episode.failed_stage {
            stages.entry(word(stage)).or_default().push(line);
        }
    }
    let failed: usize = stages.values().map(Vec::len).sum();
    if failed == 0 {
        html.push_str("<p class=\"dim\">No episode failed.</p>\n");
        return;
    }
    let open = if failed <= MOST_OPEN { " open" } else { "" };
    let mut stages: Vec<_> = stages.into_iter().collect();
    stages.sort_by_key(|(_, episodes)| std::cmp::Reverse(episodes.len()));
    for (stage, episodes) in stages {
        let _ = writeln!(
            html,
            "<details class=\"card\"{open}><summary><b>{stage}</b> {} of {failed} failures\
             <span class=\"bar\" style=\"width:{:.1}%\"></span></summary>\n<table class=\"narrow\"><tbody>",
            episodes.len(),
            100.0 * episodes.len() as f64 / failed as f64
        );
        for line in episodes {
            let _ = writeln!(html, "<tr><td>{}</td><td>{}</td></tr>", line.name(), line.why());
        }
        html.push_str("</tbody></table></details>\n");
    }
}

fn write_episodes(html: &mut String, lines: &[Linked<'_>]) {
    html.push_str(
        "<h2>Episodes</h2>\n<div class=\"wide\"><table class=\"narrow\"><thead><tr><th>Episode</th><th>Outcome</th>\
         <th class=\"number\">Time</th><th class=\"number\">Path</th><th class=\"number\">SPL</th>\
         <th class=\"number\">Clearance</th><th class=\"number\">Collisions</th><th>Why</th></tr></thead><tbody>\n",
    );
    for line in lines {
        let of = |value: fn(&Metrics) -> Option<String>| {
            line.episode.metrics.as_ref().and_then(value).unwrap_or_else(|| "-".to_owned())
        };
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td>{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td>\
             <td class=\"number\">{}</td><td class=\"number\">{}</td><td>{}</td></tr>",
            line.name(),
            line.mark(),
            of(|m| Some(format!("{:.1} s", m.sim_time_s))),
            of(|m| Some(format!("{:.1} m", m.path_length_m))),
            of(|m| Some(format!("{:.2} SPL", m.known_map_spl.or(m.spl)?))),
            of(|m| Some(format!("{:.2} m free", m.min_clearance_m?))),
            of(|m| Some(format!("{} collisions", m.collisions))),
            line.why()
        );
    }
    html.push_str("</tbody></table></div>\n");
}

#[cfg(test)]
mod tests {
    //! Contract: every episode is one click from its own page, every failure stands below its stage, names that look like
    //! markup stay text, and links hold whatever a file may be called.
    use super::*;
    use crate::report::tests::{HOSTILE, check_that_every_element_is_closed};
    use crate::summary::Stage;

    fn lines() -> Vec<SuiteEpisode> {
        let failed = |id: &str, seed, stage| SuiteEpisode::without_metrics(id, seed, stage, HOSTILE.to_owned());
        let good = SuiteEpisode { success: true, failed_stage: None, reason: None, ..failed("a", 1, Stage::Hold) };
        vec![good, failed("a", 2, Stage::Hold), failed("b #1", 3, Stage::Hold), failed(HOSTILE, 4, Stage::Crash)]
    }

    #[test]
    fn every_episode_is_one_click_away() {
        let folder = tempfile::tempdir().unwrap();
        for (own, page) in [("a-1", REPORT_FILE), ("a-2", REPORT_FILE), ("a-2", FAILURE_FILE), ("b #1-3", FAILURE_FILE)]
        {
            std::fs::create_dir_all(folder.path().join(own)).unwrap();
            std::fs::write(folder.path().join(own).join(page), "").unwrap();
        }
        write_index(&Suite::new(lines()), folder.path()).unwrap();
        let html = std::fs::read_to_string(folder.path().join(INDEX_FILE)).unwrap();
        let links = |page: &str| html.matches(&format!("<a href=\"{page}\">")).count();
        assert_eq!(links("a-1/report.html"), 2, "by name and outcome");
        assert_eq!((links("a-2/report.html"), links("a-2/failure.html")), (2, 1), "by stage and name; by outcome");
        assert_eq!(links("b%20%231-3/failure.html"), 3, "without a report all lead to the failure");
        assert_eq!(html.matches("<a ").count(), 8, "what has no page has no link");
        for part in ["<b>hold</b> 2 of 3 failures", "<b>crash</b> 1 of 3 failures", "1 of 4 episodes succeeded"] {
            assert!(html.contains(part), "{part}");
        }
        assert!(html.find("<b>hold</b>") < html.find("<b>crash</b>"), "the most frequent stage comes first");
        assert!(!html.contains("<img") && !html.contains("<script"), "a name became markup");
        check_that_every_element_is_closed(&html);
    }

    #[test]
    fn a_suite_without_failures_says_so() {
        let html = index_page(&Suite::new(lines()[..1].to_vec()), Path::new("nowhere"));
        assert!(html.contains("No episode failed.") && !html.contains("<details"), "{html}");
        check_that_every_element_is_closed(&html);
    }
}
