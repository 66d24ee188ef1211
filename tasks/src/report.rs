//! `report.html`: one page about one run that needs nothing but a browser.
//!
//! No scripts, no styles or pictures from outside; every text that comes from files, maps or commands is escaped.

use crate::cli::Timing;
use crate::journal::Journal;
use crate::picture::{color_png, depth_png, escape, halved, hex, image_png, map_svg, mean_color};
use crate::plot::{Curve, lines_svg, timeline_svg};
use crate::run::Finished;
use crate::summary::{ExpectationSummary, Metrics, StepOutcome, StepSummary, Summary};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dsm::frame::RgbdFrame;
use dsm::ground::{CandidateViews, Grounding, GroundingStatus};
use dsm::map::{Map, ObjectId, RoomId};
use dsm::raster::Renderer;
use dsm::store::{ShownObject, show_map};
use rayon::prelude::*;
use serde::Serialize;
use std::fmt::Write;
use std::sync::Arc;

/// A page holds at most so many pictures, evenly chosen with the first and the last; more would make it heavy.
const MOST_PICTURES: usize = 16;
/// A grounding lists at most so many candidates.
const MOST_CANDIDATES: usize = 8;

/// The beginning of a page, up to its content.
pub(crate) fn open_page(title: &str) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <link rel=\"icon\" href=\"data:,\">\n<title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n"
    )
}

/// The end of a page.
pub(crate) fn close_page(mut html: String) -> String {
    html.push_str("</main>\n</body>\n</html>\n");
    html
}

/// The page of a finished run; `again` is the command that does it again.
pub fn page(finished: &Finished, timing: &Timing, again: &str) -> String {
    let Finished { summary, map, journal, .. } = finished;
    let title = format!("{}, seed {}", escape(&summary.episode), summary.seed);
    let mut html = open_page(&title);
    write_head(&mut html, summary, timing, &title, again);
    write_steps(&mut html, &summary.steps, map);
    write_expectations(&mut html, &summary.expectations);
    write_metrics(&mut html, &summary.metrics, timing);
    write_timeline(&mut html, summary, journal);
    write_map(&mut html, summary, map, journal);
    write_pictures(&mut html, journal);
    write_objects(&mut html, map);
    write_events(&mut html, journal);
    close_page(html)
}

// Writing to a String cannot fail, which is why the results of `write!` are dropped throughout.

fn write_head(html: &mut String, summary: &Summary, timing: &Timing, title: &str, again: &str) {
    let (class, word) = if summary.success { ("good", "Success") } else { ("bad", "Failed") };
    let _ = writeln!(html, "<h1>{title} <span class=\"mark {class}\">{word}</span></h1>");
    if let Some(failure) = &summary.failure {
        let _ = writeln!(
            html,
            "<p class=\"why\">Step {}, stage <b>{}</b>: {}</p>",
            failure.step,
            word_of(&failure.stage),
            escape(&failure.reason)
        );
    }
    let _ = writeln!(
        html,
        "<p class=\"dim\">Scene {}, robot {}, physics {}, perception {}. {:.1} s of simulated time in {:.1} s ({:.1}x real time).</p>",
        escape(&summary.scene),
        escape(&summary.robot),
        escape(&summary.physics),
        escape(&summary.perception),
        timing.sim_time_s,
        timing.wall_s,
        timing.real_time_factor
    );
    let _ = writeln!(html, "<p class=\"dim\">Again: <code>{}</code></p>", escape(again));
}

fn write_steps(html: &mut String, steps: &[StepSummary], map: &Map) {
    html.push_str("<h2>Steps</h2>\n");
    for step in steps {
        let class = match step.outcome {
            StepOutcome::Done => "good",
            StepOutcome::Failed => "bad",
            StepOutcome::Absent | StepOutcome::Ambiguous | StepOutcome::Skipped => "so",
        };
        let _ = writeln!(
            html,
            "<section class=\"card\"><h3>{}. {} <span class=\"mark {class}\">{}</span></h3>\n<p>{}: {}</p>\n\
             <p class=\"dim\">from {:.1} s, {:.1} s long</p>",
            step.index,
            escape(&step.command),
            word_of(&step.outcome),
            escape(&step.skill),
            escape(&step.reason),
            step.start_s,
            step.duration_s
        );
        if let Some(grounding) = &step.grounding {
            write_grounding(html, grounding, map);
        }
        html.push_str("</section>\n");
    }
}

fn write_grounding(html: &mut String, grounding: &Grounding, map: &Map) {
    let class = if grounding.status == GroundingStatus::Found { "good" } else { "so" };
    let _ = writeln!(
        html,
        "<h4>Grounding <span class=\"mark {class}\">{}</span></h4>\n<p>{} (score {:.2}); decided by <q>{}</q>; verified by {}</p>",
        word_of(&grounding.status),
        name_of(map, grounding.object_id, grounding.room_id),
        grounding.score,
        escape(&grounding.decided_by),
        escape(&grounding.backend)
    );
    if grounding.candidates.is_empty() {
        return;
    }
    write_views(html, grounding, map);
    html.push_str(
        "<div class=\"wide\"><table class=\"narrow\"><thead><tr><th>Candidate</th><th class=\"number\">Score</th><th>Reasons</th></tr></thead><tbody>\n",
    );
    for candidate in grounding.candidates.iter().take(MOST_CANDIDATES) {
        let reasons: Vec<String> = candidate.reasons.iter().map(|reason| escape(reason)).collect();
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td class=\"number\">{:.2}</td><td>{}</td></tr>",
            name_of(map, candidate.object_id, candidate.room_id),
            candidate.score,
            reasons.join("<br>")
        );
    }
    html.push_str("</tbody></table></div>\n");
    let more = grounding.candidates.len().saturating_sub(MOST_CANDIDATES);
    if more > 0 {
        let _ = writeln!(html, "<p class=\"dim\">and {more} more in summary.json</p>");
    }
}

/// The three views of the answer, drawn from the points of the map as the verifier sees them.
fn write_views(html: &mut String, grounding: &Grounding, map: &Map) {
    let Some(object) = grounding.object_id.and_then(|id| map.find_object(id)) else { return };
    let Some(views) = CandidateViews::render(map, object, &[], &mut Renderer::default()) else { return };
    html.push_str("<div class=\"views\">");
    for (level, image) in [("object", &views.object), ("place", &views.place), ("scene", &views.scene)] {
        let _ = write!(
            html,
            "<figure><img alt=\"{level} view\" width=\"{}\" height=\"{}\" src=\"data:image/png;base64,{}\">\
             <figcaption>{level}</figcaption></figure>",
            image.width,
            image.height,
            STANDARD.encode(image_png(image))
        );
    }
    html.push_str("</div>\n");
}

fn write_expectations(html: &mut String, expectations: &[ExpectationSummary]) {
    html.push_str("<h2>Expectations</h2>\n");
    if expectations.is_empty() {
        html.push_str("<p class=\"dim\">The episode expects nothing.</p>\n");
        return;
    }
    html.push_str(
        "<div class=\"wide\"><table class=\"narrow\"><thead><tr><th>Kind</th><th></th><th>Measured</th><th>Required</th></tr></thead><tbody>\n",
    );
    for e in expectations {
        let (class, word) = if e.passed { ("good", "holds") } else { ("bad", "does not hold") };
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td><span class=\"mark {class}\">{word}</span></td><td>{}</td><td>{}</td></tr>",
            escape(&e.kind),
            escape(&e.measured),
            escape(&e.required)
        );
    }
    html.push_str("</tbody></table></div>\n");
}

fn write_metrics(html: &mut String, metrics: &Metrics, timing: &Timing) {
    let length = |value: Option<f64>| value.map_or("none".to_owned(), |v| format!("{v:.2} m"));
    let share = |value: Option<f64>| value.map_or("none".to_owned(), |v| format!("{v:.2}"));
    let rows = [
        ("Simulated time", format!("{:.1} s", metrics.sim_time_s)),
        ("Wall time", format!("{:.1} s", timing.wall_s)),
        ("Path of the base", format!("{:.2} m", metrics.path_length_m)),
        ("Shortest path", length(metrics.shortest_path_m)),
        ("SPL", share(metrics.spl)),
        ("SPL on a finished map", share(metrics.known_map_spl)),
        ("Collisions", metrics.collisions.to_string()),
        ("Others touched by the hand", metrics.others_touched.to_string()),
        ("Smallest clearance", length(metrics.min_clearance_m)),
        ("Limit violations", metrics.limit_violations.to_string()),
        ("Other objects moved at most", format!("{:.3} m", metrics.non_target_displacement_max_m)),
    ];
    html.push_str("<h2>Metrics</h2>\n<dl>\n");
    for (name, value) in rows {
        let _ = writeln!(html, "<div><dt>{name}</dt><dd>{value}</dd></div>");
    }
    html.push_str("</dl>\n");
}

fn write_timeline(html: &mut String, summary: &Summary, journal: &Journal) {
    let end_s = summary.metrics.sim_time_s;
    html.push_str("<h2>Timeline</h2>\n");
    let _ = writeln!(html, "<div class=\"wide plot\">{}</div>", timeline_svg(&summary.steps, &journal.events, end_s));
    let plots: [(&str, &[Curve<'_>]); 4] = [
        (
            "Clearance of the base in the map, m (up to a metre)",
            &[Curve { name: "Clearance", color: "#1e6ed2", value: |s| s.clearance_m }],
        ),
        ("Speed of the base, m/s", &[Curve { name: "Speed", color: "#17693a", value: |s| Some(s.speed_m_per_s) }]),
        (
            "Arm: least distance of a link to an obstacle or another link, m",
            &[Curve { name: "Distance", color: "#1e6ed2", value: |s| s.control?.distance_m }],
        ),
        (
            "Arm: what is left to the goal, m (rad for joint moves)",
            &[Curve { name: "Error", color: "#8a5a00", value: |s| s.control.map(|c| c.error) }],
        ),
    ];
    html.push_str("<div class=\"plots\">\n");
    for (caption, curves) in plots {
        if let Some(svg) = lines_svg(&journal.samples, end_s, curves) {
            let _ = writeln!(html, "<figure class=\"plot\"><figcaption>{caption}</figcaption>{svg}</figure>");
        }
    }
    html.push_str("</div>\n");
}

fn write_map(html: &mut String, summary: &Summary, map: &Map, journal: &Journal) {
    let target = summary.steps.iter().rev().find_map(|step| step.grounding.as_ref()?.object_id);
    let size = &summary.map;
    let _ = writeln!(
        html,
        "<h2>Map</h2>\n<p class=\"dim\">{} objects, {} relations, {} rooms from {} frames. White is free ground, dark grey \
         occupied; blue is the path, from the hollow to the full dot; the target has a red border.</p>",
        size.objects, size.relations, size.rooms, journal.frames_learned
    );
    match map_svg(map, &journal.path, target) {
        Some(svg) => {
            let _ = writeln!(html, "<div class=\"wide map\">{svg}</div>");
        }
        None => html.push_str("<p>The map is empty.</p>\n"),
    }
}

fn write_pictures(html: &mut String, journal: &Journal) {
    if journal.pictures.is_empty() {
        return;
    }
    html.push_str("<h2>Pictures</h2>\n");
    let count = journal.pictures.len();
    let shown = count.min(MOST_PICTURES);
    let at = |i: usize| if shown > 1 { i * (count - 1) / (shown - 1) } else { 0 };
    let chosen: Vec<_> = (0..shown).map(|i| journal.pictures[at(i)].clone()).collect();
    write_figures(html, &chosen);
    if shown < count {
        let _ = writeln!(html, "<p class=\"dim\">{shown} of {count} pictures</p>");
    }
}

/// Frames with captions, in colour and depth.
pub(crate) fn write_figures(html: &mut String, pictures: &[(String, Arc<RgbdFrame>)]) {
    let encode = |(_, frame): &(String, Arc<RgbdFrame>)| {
        let small = halved(frame);
        (small.model, [color_png(&small), depth_png(&small)].map(|png| STANDARD.encode(png)))
    };
    let encoded: Vec<_> = pictures.par_iter().map(encode).collect();
    html.push_str("<div class=\"pictures\">\n");
    for ((caption, frame), (model, encoded)) in pictures.iter().zip(&encoded) {
        let caption = escape(caption);
        let _ = write!(html, "<figure><div>");
        for (what, png) in ["colour", "depth"].into_iter().zip(encoded) {
            let _ = write!(
                html,
                "<img alt=\"{what}, {} camera\" width=\"{}\" height=\"{}\" src=\"data:image/png;base64,{}\">",
                escape(&frame.camera),
                model.width,
                model.height,
                png
            );
        }
        let _ = writeln!(html, "</div><figcaption>{caption} ({} camera)</figcaption></figure>", escape(&frame.camera));
    }
    html.push_str("</div>\n");
}

fn write_objects(html: &mut String, map: &Map) {
    let shown = show_map(map);
    let _ = writeln!(html, "<h2>Objects</h2>\n<details><summary>{} objects</summary>", shown.objects.len());
    html.push_str(
        "<div class=\"wide\"><table><thead><tr><th>Id</th><th>Name</th><th>Attributes</th><th>Centre, m</th><th>Size, m</th>\
         <th>Room</th><th>Seen</th><th>Sure</th></tr></thead><tbody>\n",
    );
    for object in &shown.objects {
        let color = map.find_object(ObjectId(object.id)).map_or([0; 3], mean_color);
        let triple = |v: [f64; 3]| format!("{:.2}, {:.2}, {:.2}", v[0], v[1], v[2]);
        let _ = writeln!(
            html,
            "<tr><td class=\"number\">{}</td><td><i style=\"background:{}\"></i>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>\
             <td class=\"number\">{}</td><td class=\"number\">{:.2}</td></tr>",
            object.id,
            hex(color),
            escape(&object.name),
            escape(&attributes_of(object)),
            triple(object.center),
            triple(object.size),
            escape(object.room.as_deref().unwrap_or("")),
            object.observations,
            object.confidence
        );
    }
    html.push_str("</tbody></table></div></details>\n");
}

fn write_events(html: &mut String, journal: &Journal) {
    let _ = writeln!(html, "<h2>Events</h2>\n<details open><summary>{} events</summary><ol>", journal.events.len());
    for event in &journal.events {
        let _ = writeln!(html, "<li><time>{:.1} s</time> {}</li>", event.at_s, escape(&event.what));
    }
    html.push_str("</ol></details>\n");
}

fn name_of(map: &Map, object: Option<ObjectId>, room: Option<RoomId>) -> String {
    match (object, room) {
        (Some(id), _) => {
            let name = map.find_object(id).map_or("no longer in the map", |object| object.name());
            format!("{} (object {})", escape(name), id.0)
        }
        (None, Some(id)) => {
            let name = map.find_room(id).map_or("no longer in the map", |room| &room.name);
            format!("{} (room {})", escape(name), id.0)
        }
        (None, None) => "nothing".to_owned(),
    }
}

fn attributes_of(object: &ShownObject) -> String {
    let attributes = &object.attributes;
    let words = attributes.appearance.iter().chain(&attributes.physical).map(|(key, word)| format!("{key} {word}"));
    words
        .chain(attributes.affordance.iter().map(|(key, words)| format!("{key} {}", words.join("/"))))
        .collect::<Vec<_>>()
        .join(", ")
}

/// A word of an enum as it stands in `summary.json`.
pub(crate) fn word_of<T: Serialize>(value: &T) -> String {
    let word = serde_json::to_value(value).ok().and_then(|value| value.as_str().map(str::to_owned));
    escape(&word.unwrap_or_default())
}

const STYLE: &str = "
:root{color-scheme:light;--good:#17693a;--bad:#b3261e;--so:#8a5a00;--line:#d9dce2;--dim:#5b6270}
*{box-sizing:border-box}
body{margin:0;background:#f5f6f8;color:#1c2028;font:16px/1.5 system-ui,sans-serif;overflow-wrap:anywhere}
main{max-width:1200px;margin:0 auto;padding:16px}
h1{font-size:1.5rem;margin:.5rem 0}h2{font-size:1.2rem;margin:2rem 0 .5rem}h3{font-size:1rem;margin:0}h4{font-size:.95rem;margin:1rem 0 0}
p{margin:.25rem 0}.dim{color:var(--dim);font-size:.9rem}.why{color:var(--bad)}
.mark{display:inline-block;padding:0 .5em;border-radius:1em;font-size:.8rem;font-weight:600;color:#fff;white-space:nowrap}
.good{background:var(--good)}.bad{background:var(--bad)}.so{background:var(--so)}
.card{background:#fff;border:1px solid var(--line);border-radius:8px;padding:12px 16px;margin:0 0 12px}
.wide{overflow-x:auto;background:#fff;border:1px solid var(--line);border-radius:8px;margin:.5rem 0}
table{border-collapse:collapse;width:100%;font-size:.9rem;overflow-wrap:normal}
th,td{text-align:left;vertical-align:top;padding:6px 10px;border-bottom:1px solid var(--line)}th{color:var(--dim);font-weight:600}
tr:last-child td{border-bottom:0}.number{font-variant-numeric:tabular-nums;text-align:right;white-space:nowrap}
td i{display:inline-block;width:.8em;height:.8em;margin-right:.4em;border:1px solid var(--dim);border-radius:2px}
dl{display:grid;grid-template-columns:repeat(auto-fill,minmax(155px,1fr));gap:8px;margin:0}
dl div{background:#fff;border:1px solid var(--line);border-radius:8px;padding:8px 12px}dt{color:var(--dim);font-size:.85rem}dd{margin:0;font-weight:600}
.number{text-align:right}
.plots{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,420px),1fr));gap:12px}
.plot svg{display:block;width:100%;height:auto;font:16px system-ui,sans-serif;fill:var(--dim)}.grid{stroke:var(--line);fill:none}
.views{display:grid;grid-template-columns:repeat(3,minmax(0,1fr));gap:8px;max-width:720px;margin:.5rem 0}.views img{width:100%}
.wide.plot svg{min-width:680px;max-width:960px;font-size:13px}
.map svg{display:block;width:100%;height:auto;font-family:system-ui,sans-serif}
.pictures{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,520px),1fr));gap:12px}
figure{margin:0;background:#fff;border:1px solid var(--line);border-radius:8px;padding:8px}figure div{display:flex;gap:4px}
figure img{width:50%;height:auto;min-width:0}figcaption{font-size:.85rem;color:var(--dim)}
.side{display:none;color:var(--dim)}.bar{display:block;height:8px;min-width:3px;margin:4px 0 2px;border-radius:4px;background:var(--bad)}
code{font:.9em/1.4 ui-monospace,monospace}
summary{cursor:pointer}ol{padding:0;margin:.5rem 0;list-style:none}li{padding:2px 0;border-bottom:1px solid var(--line)}
@media(max-width:600px){
.narrow thead{display:none}.narrow,.narrow tbody,.narrow tr,.narrow td{display:block;border:0;text-align:left}
.narrow tr{padding:6px 0;border-bottom:1px solid var(--line)}.narrow td{padding:1px 10px}.side{display:inline}
figure.plot svg{font-size:26px;overflow:visible;margin:10px 0 6px}
}
time{display:inline-block;min-width:5em;color:var(--dim);font-variant-numeric:tabular-nums}
";

#[cfg(test)]
#[path = "report_tests.rs"]
pub(crate) mod tests;
