//! The failure book: `failure.html` of a run that failed. One page with the stage, the cause, what was seen and known then,
//! and the command that does it again.

use crate::journal::Journal;
use crate::language::EMBEDDED;
use crate::picture::{escape, map_svg};
use crate::report::{close_page, open_page, word_of, write_figures};
use crate::run::{Finished, RunSpec};
use crate::summary::{StepOutcome, Summary};
use dsm::frame::RgbdFrame;
use std::fmt::Write;
use std::sync::Arc;

/// Name of the page in the folder of its run.
pub const FAILURE_FILE: &str = "failure.html";
/// Events so long before the end of the step that failed are told, seconds.
const LAST_S: f64 = 60.0;
/// Pictures of events that are shown; the last frames come with them.
const MOST_EVENT_PICTURES: usize = 6;
/// Contacts that are listed, the strongest first.
const MOST_CONTACTS: usize = 8;

/// The command that runs it again, from the folder in which it ran.
pub fn replay_command(spec: &RunSpec) -> String {
    let file = spec.file.display().to_string();
    let quoted = if file.contains(' ') { format!("'{file}'") } else { file };
    let mut command = format!("dsm run {quoted} --seed {}", spec.seed);
    let mut flag = |name: &str, value: &str, usual: &str| {
        if value != usual {
            let _ = write!(command, " --{name} {value}");
        }
    };
    flag("robot", &spec.robot, &spec.episode.robot);
    flag("physics", &spec.physics, "rapier");
    flag("perception", &spec.perception, "noisy");
    flag("backend", spec.language.name(), EMBEDDED);
    flag("time-limit-s", &spec.time_limit_s.to_string(), &spec.episode.time_limit_s.to_string());
    command
}

/// The page of a failed run; `None` when it succeeded.
pub fn failure_page(finished: &Finished, spec: &RunSpec) -> Option<String> {
    let Finished { summary, map, journal, .. } = finished;
    let failure = summary.failure.as_ref()?;
    let mut html = open_page(&format!("Failure: {}, seed {}", escape(&summary.episode), summary.seed));
    let _ = writeln!(
        html,
        "<h1>{}, seed {} <span class=\"mark bad\">{}</span></h1>\n<p class=\"why\">{}</p>\n\
         <p class=\"dim\">Again: <code>{}</code></p>\n<p><a href=\"report.html\">The whole report</a></p>",
        escape(&summary.episode),
        summary.seed,
        word_of(&failure.stage),
        escape(&failure.reason),
        escape(&replay_command(spec))
    );
    write_what_was_asked(&mut html, summary);
    write_truth(&mut html, summary);
    let end_s = end_of_failed_step(summary);
    let _ = writeln!(html, "<h2>The last {LAST_S:.0} seconds</h2>\n<ol>");
    for event in journal.events.iter().filter(|event| (end_s - LAST_S..=end_s + 0.01).contains(&event.at_s)) {
        let _ = writeln!(html, "<li><time>{:.1} s</time> {}</li>", event.at_s, escape(&event.what));
    }
    html.push_str("</ol>\n");
    let pictures = pictures_near(journal, end_s);
    if !pictures.is_empty() {
        html.push_str("<h2>What it saw</h2>\n");
        write_figures(&mut html, &pictures);
    }
    let target = summary.steps.iter().rev().find_map(|step| step.grounding.as_ref()?.object_id);
    if let Some(svg) = map_svg(map, &journal.path, target) {
        let _ = writeln!(html, "<h2>What it knew</h2>\n<div class=\"wide map\">{svg}</div>");
    }
    Some(close_page(html))
}

/// The page of an episode that did not come to its end.
pub fn crash_page(spec: &RunSpec, reason: &str) -> String {
    let mut html = open_page(&format!("Failure: {}, seed {}", escape(&spec.name), spec.seed));
    let _ = writeln!(
        html,
        "<h1>{}, seed {} <span class=\"mark bad\">crash</span></h1>\n<p class=\"why\">{}</p>\n\
         <p class=\"dim\">Again: <code>{}</code></p>",
        escape(&spec.name),
        spec.seed,
        escape(reason),
        escape(&replay_command(spec))
    );
    close_page(html)
}

fn end_of_failed_step(summary: &Summary) -> f64 {
    let end = |step: &crate::summary::StepSummary| step.start_s + step.duration_s;
    let begun = summary.steps.iter().filter(|step| step.outcome != StepOutcome::Skipped);
    begun.map(end).fold(0.0, f64::max)
}

fn write_what_was_asked(html: &mut String, summary: &Summary) {
    html.push_str("<h2>What was asked</h2>\n<div class=\"wide\"><table class=\"narrow\"><tbody>\n");
    for step in &summary.steps {
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td>{}</td><td>{}</td></tr>",
            escape(&step.command),
            word_of(&step.outcome),
            escape(&step.reason)
        );
    }
    for e in summary.expectations.iter() {
        let holds = if e.passed { "holds" } else { "does not hold" };
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td>{holds}</td><td>{}; required: {}</td></tr>",
            escape(&e.kind),
            escape(&e.measured),
            escape(&e.required)
        );
    }
    html.push_str("</tbody></table></div>\n");
}

/// What only the judge knows: disturbances and contacts.
fn write_truth(html: &mut String, summary: &Summary) {
    let truth = &summary.truth;
    if !truth.disturbances.is_empty() {
        html.push_str("<h2>What was done to the world</h2>\n<ol>\n");
        for event in &truth.disturbances {
            let _ = writeln!(html, "<li><time>{:.1} s</time> {}</li>", event.at_s, escape(&event.what));
        }
        html.push_str("</ol>\n");
    }
    let mut contacts = truth.contacts.clone();
    contacts.sort_by(|a, b| b.max_force_n.total_cmp(&a.max_force_n));
    if !contacts.is_empty() {
        html.push_str("<h2>What it touched</h2>\n<ol>\n");
        for c in contacts.iter().take(MOST_CONTACTS) {
            let _ = writeln!(
                html,
                "<li><time>{:.1} s</time> {} and {}: {:.0} N, began at {:.2} m/s</li>",
                c.start_s,
                escape(&c.link),
                escape(&c.body),
                c.max_force_n,
                c.approach_speed_m_per_s
            );
        }
        html.push_str("</ol>\n");
    }
}

/// The pictures of the last events before the end of the step, then the last frames, each once.
fn pictures_near(journal: &Journal, end_s: f64) -> Vec<(String, Arc<RgbdFrame>)> {
    let events: Vec<_> = journal.pictures.iter().filter(|(_, frame)| frame.stamp.as_s() <= end_s).collect();
    let first = events.len().saturating_sub(MOST_EVENT_PICTURES);
    let mut pictures: Vec<(String, Arc<RgbdFrame>)> =
        events[first..].iter().map(|picture| (*picture).clone()).collect();
    for frame in &journal.recent {
        if pictures.iter().all(|(_, shown)| shown.id != frame.id) {
            pictures.push((format!("{:.1} s", frame.stamp.as_s()), frame.clone()));
        }
    }
    pictures.sort_by_key(|(_, frame)| frame.stamp);
    pictures
}

#[cfg(test)]
#[path = "failure_page_tests.rs"]
mod tests;
