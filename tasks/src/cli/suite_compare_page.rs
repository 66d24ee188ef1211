//! The page of two suites: what changed in either direction, every episode of both one click away.

use super::suite_change::{Change, Comparison, Pair, Unpaired, pairs};
use super::suite_file::SuiteFolder;
use super::suite_page::{Linked, link};
use super::suite_result::describe;
use crate::picture::escape;
use crate::report::{close_page, open_page};
use std::fmt::Write;

/// A suite and the way from the page to its folder: nothing, or a relative path that ends with a slash.
pub(super) type Reached<'a> = (&'a SuiteFolder, &'a str);

/// The page.
pub(super) fn compare_page(comparison: &Comparison, suites: [Reached<'_>; 2]) -> String {
    let [a, b] = suites;
    let pairs = pairs(&a.0.suite.episodes, &b.0.suite.episodes);
    let of = |change: Change| pairs.iter().copied().filter(|pair| pair.change() == change).collect::<Vec<_>>();
    let mut html = open_page("Two suites");
    write_head(&mut html, comparison, suites);
    html.push_str("<h2>What changed</h2>\n");
    for (change, title) in [
        (Change::Worse, "Worse: succeeded in A, fails in B"),
        (Change::Better, "Better: failed in A, succeeds in B"),
        (Change::OtherStage, "Fails in both, in another stage"),
    ] {
        write_pairs(&mut html, title, &of(change), suites, " open");
    }
    write_stages(&mut html, comparison);
    write_figures(&mut html, comparison);
    html.push_str("<h2>What did not change</h2>\n");
    write_pairs(&mut html, "Ends alike in both", &of(Change::Alike), suites, "");
    write_unpaired(&mut html, "Only in A", &comparison.only_in_a, a);
    write_unpaired(&mut html, "Only in B", &comparison.only_in_b, b);
    close_page(html)
}

// Writing to a String cannot fail, which is why the results of `write!` are dropped throughout.

fn write_head(html: &mut String, comparison: &Comparison, suites: [Reached<'_>; 2]) {
    let c = comparison;
    let _ = writeln!(
        html,
        "<h1>Two suites</h1>\n<p>{} episodes and seeds are in both: <b>{} better</b>, <b>{} worse</b>, {} fail in another \
         stage, {} are the same to the last digit. Sign test: p = {:.3}.</p>",
        c.a.shared.of, c.better, c.worse, c.other_stage, c.identical, c.sign_test_p
    );
    html.push_str("<div class=\"wide\"><table class=\"narrow\"><tbody>\n");
    for ((name, side), (suite, way)) in [("A", &c.a), ("B", &c.b)].into_iter().zip(suites) {
        let index = match suite.folder.join("index.html").is_file() {
            true => format!("<a href=\"{}\">{}</a>", link(&format!("{way}index.html")), shown(suite)),
            false => shown(suite),
        };
        let _ = writeln!(
            html,
            "<tr><td><b>{name}</b> {index}</td><td>{} of those in both</td><td>{} of all</td></tr>",
            describe(&side.shared),
            describe(&side.all)
        );
    }
    html.push_str("</tbody></table></div>\n");
}

fn shown(suite: &SuiteFolder) -> String {
    escape(&suite.folder.display().to_string())
}

fn write_pairs(html: &mut String, title: &str, pairs: &[Pair<'_>], [a, b]: [Reached<'_>; 2], open: &str) {
    let _ = writeln!(html, "<details class=\"card\"{open}><summary><b>{}</b> {title}</summary>", pairs.len());
    if !pairs.is_empty() {
        html.push_str(
            "<table class=\"narrow\"><thead><tr><th>Episode</th><th>A</th><th>B</th><th>Why</th></tr></thead><tbody>\n",
        );
        for pair in pairs {
            let (first, second) = (Linked::find(pair.a, &a.0.folder, a.1), Linked::find(pair.b, &b.0.folder, b.1));
            let _ = writeln!(
                html,
                "<tr><td>{}, seed {}</td><td><span class=\"side\">A</span> {}</td><td><span class=\"side\">B</span> {}</td>\
                 <td>{}</td></tr>",
                escape(&pair.a.id),
                pair.a.seed,
                first.mark(),
                second.mark(),
                reasons(&first, &second)
            );
        }
        html.push_str("</tbody></table>\n");
    }
    html.push_str("</details>\n");
}

/// Why it failed, with the suite in which it did, once where both say the same.
fn reasons(a: &Linked<'_>, b: &Linked<'_>) -> String {
    match (a.why(), b.why()) {
        (a, b) if a == b => a,
        (a, b) if b.is_empty() => format!("A: {a}"),
        (a, b) if a.is_empty() => format!("B: {b}"),
        (a, b) => format!("A: {a}<br>B: {b}"),
    }
}

fn write_stages(html: &mut String, comparison: &Comparison) {
    html.push_str("<h2>Failures by stage</h2>\n");
    if comparison.failed_stages.is_empty() {
        html.push_str("<p class=\"dim\">No episode failed.</p>\n");
        return;
    }
    open_table(html, "Stage");
    for (stage, [a, b]) in &comparison.failed_stages {
        write_row(html, stage, [a.to_string(), b.to_string()], format!("{:+}", *b as i64 - *a as i64));
    }
    html.push_str("</tbody></table></div>\n");
}

fn write_figures(html: &mut String, comparison: &Comparison) {
    html.push_str("<h2>Figures of what both hold</h2>\n");
    open_table(html, "Figure");
    for figure in &comparison.figures {
        let name = format!("{} (N = {})", figure.name, figure.of);
        let values = [figure.a, figure.b].map(|value| format!("{value:.2}"));
        write_row(html, &name, values, format!("{:+.2}", figure.b - figure.a));
    }
    html.push_str("</tbody></table></div>\n");
}

fn open_table(html: &mut String, first: &str) {
    let _ = writeln!(
        html,
        "<div class=\"wide\"><table class=\"narrow\"><thead><tr><th>{first}</th><th class=\"number\">A</th>\
         <th class=\"number\">B</th><th class=\"number\">Change</th></tr></thead><tbody>"
    );
}

fn write_row(html: &mut String, name: &str, [a, b]: [String; 2], change: String) {
    let _ = writeln!(
        html,
        "<tr><td>{}</td><td class=\"number\"><span class=\"side\">A</span> {a}</td>\
         <td class=\"number\"><span class=\"side\">B</span> {b}</td>\
         <td class=\"number\"><span class=\"side\">change</span> {change}</td></tr>",
        escape(name)
    );
}

fn write_unpaired(html: &mut String, title: &str, unpaired: &[Unpaired], (suite, way): Reached<'_>) {
    if unpaired.is_empty() {
        return;
    }
    let _ = writeln!(html, "<details class=\"card\"><summary><b>{}</b> {title}</summary><ol>", unpaired.len());
    let episodes = &suite.suite.episodes;
    let alone = episodes.iter().filter(|e| unpaired.iter().any(|other| (&other.id, other.seed) == (&e.id, e.seed)));
    for episode in alone {
        let linked = Linked::find(episode, &suite.folder, way);
        let _ = writeln!(html, "<li>{} {} {}</li>", linked.name(), linked.mark(), linked.why());
    }
    html.push_str("</ol></details>\n");
}

#[cfg(test)]
mod tests {
    //! Contract: what changed stands there in both directions with links into both suites, and names that look like markup
    //! stay text.
    use super::*;
    use crate::cli::suite_result::{Suite, SuiteEpisode};
    use crate::report::tests::{HOSTILE, check_that_every_element_is_closed};
    use crate::summary::Stage;

    fn suite(folder: &std::path::Path, good: &[u64], seeds: std::ops::Range<u64>) -> SuiteFolder {
        let line = |seed: u64| {
            let failed = SuiteEpisode::without_metrics("apple", seed, Stage::Hold, HOSTILE.to_owned());
            match good.contains(&seed) {
                true => SuiteEpisode { success: true, failed_stage: None, reason: None, ..failed },
                false => failed,
            }
        };
        for seed in seeds.clone() {
            let own = folder.join(format!("apple-{seed}"));
            std::fs::create_dir_all(&own).unwrap();
            std::fs::write(own.join("report.html"), "").unwrap();
        }
        SuiteFolder { folder: folder.to_owned(), suite: Suite::new(seeds.map(line).collect()) }
    }

    #[test]
    fn both_suites_are_one_click_away() {
        let folder = tempfile::tempdir().unwrap();
        let a = suite(&folder.path().join("a"), &[0, 2], 0..4);
        let b = suite(&folder.path().join("b"), &[1, 2], 0..5);
        let html = compare_page(&Comparison::of(&a, &b), [(&a, "../a/"), (&b, "../b/")]);
        for seed in 0..4 {
            for side in ["a", "b"] {
                assert!(html.contains(&format!("<a href=\"../{side}/apple-{seed}/report.html\">")), "{side} {seed}");
            }
        }
        for part in [
            "<b>1</b> Worse: succeeded in A, fails in B",
            "<b>1</b> Better: failed in A, succeeds in B",
            "<b>2</b> Ends alike in both",
            "<b>1</b> Only in B",
            "../b/apple-4/report.html",
        ] {
            assert!(html.contains(part), "{part} is missing");
        }
        assert!(!html.contains("<img") && !html.contains("<script"), "a reason became markup");
        check_that_every_element_is_closed(&html);
    }
}
