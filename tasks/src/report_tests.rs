//! Contract: the page holds what happened, needs nothing from outside, runs no script, and shows hostile names as text.
use super::*;
use crate::journal::{Event, Sample};
use crate::picture::tests::{small_frame, small_map};
use crate::summary::{Failure, MapSummary, Stage, TruthSummary};
use dsm::ground::{Candidate, ReferenceFrame};
use nalgebra::Point2;

pub(crate) const HOSTILE: &str = "<img src=x onerror=alert(1)>\"'&";

pub(crate) fn finished(name: &str) -> Finished {
    let grounding = Grounding {
        status: GroundingStatus::Ambiguous,
        object_id: Some(ObjectId(7)),
        room_id: None,
        score: 0.61,
        candidates: (0..10)
            .map(|i| Candidate {
                object_id: Some(ObjectId(7 + i)),
                room_id: None,
                score: 0.6,
                reasons: vec![format!("colour: {name}")],
            })
            .collect(),
        decided_by: name.to_owned(),
        frame: ReferenceFrame::None,
        backend: "embedded".into(),
        spoken: Vec::new(),
        query: None,
    };
    let step = StepSummary {
        skill: "grasp".into(),
        outcome: StepOutcome::Ambiguous,
        reason: name.to_owned(),
        duration_s: 12.5,
        grounding: Some(grounding),
        ..StepSummary::skipped(0, format!("Grasp {name}"), 0.0)
    };
    let expectation = ExpectationSummary {
        kind: "object_lifted".into(),
        passed: false,
        measured: name.into(),
        required: "0.10 m".into(),
    };
    let summary = Summary {
        schema: 1,
        episode: name.to_owned(),
        scene: name.to_owned(),
        robot: "porter".into(),
        physics: "rapier".into(),
        perception: "noisy".into(),
        seed: 3,
        success: false,
        failure: Some(Failure { step: 0, stage: Stage::Grounding, reason: name.into() }),
        steps: vec![step],
        expectations: vec![expectation],
        metrics: Metrics {
            sim_time_s: 20.0,
            path_length_m: 3.25,
            shortest_path_m: None,
            spl: None,
            soft_spl: None,
            known_map_spl: None,
            collisions: 0,
            others_touched: 0,
            min_clearance_m: Some(0.12),
            limit_violations: 0,
            contact_force_max_n: 0.0,
            person_contact_max_m_per_s: None,
            non_target_displacement_max_m: 0.004,
        },
        map: MapSummary { objects: 1, relations: 0, rooms: 0 },
        truth: TruthSummary::default(),
    };
    let mut journal = Journal { path: vec![Point2::new(0.5, 0.5), Point2::new(1.5, 0.5)], ..Journal::default() };
    journal.samples.push(Sample { speed_m_per_s: 0.4, clearance_m: Some(0.2), ..Sample::default() });
    journal.events.push(Event { at_s: 1.5, what: name.to_owned() });
    for i in 0..40 {
        journal.pictures.push((format!("picture {i} {name}"), Arc::new(small_frame())));
    }
    Finished { summary, map: Arc::new(small_map(name)), journal, recorded: None }
}

fn page_of(name: &str) -> String {
    let timing = Timing { wall_s: 10.0, report_s: 0.5, sim_time_s: 20.0, real_time_factor: 2.0 };
    page(&finished(name), &timing, &format!("dsm run {name}.toml --seed 3"))
}

/// Names of all elements in order, closing ones with a slash.
fn tags(html: &str) -> Vec<&str> {
    html.split('<')
        .skip(1)
        .filter_map(|rest| rest.split([' ', '>', '\n']).next())
        .map(|t| t.trim_end_matches('/'))
        .collect()
}

#[test]
fn the_page_tells_what_happened() {
    let html = page_of("apple");
    for part in [
        "Failed",
        "stage <b>grounding</b>",
        "object_lifted",
        "3.25 m",
        "2.0x real time",
        "apple (object 7)",
        "dsm run apple.toml",
    ] {
        assert!(html.contains(part), "{part} is missing");
    }

    assert!(html.contains("and 2 more in summary.json"));
    assert!(html.contains("no longer in the map (object 8)"));
    assert!(html.contains("16 of 40 pictures") && html.contains("picture 0 ") && html.contains("picture 39 "));
    assert_eq!(html.matches("<img ").count(), 35, "colour and depth, and three views of the answer");
}

#[test]
fn hostile_names_stay_text() {
    let html = page_of(HOSTILE);
    assert!(!html.contains("<img src=x") && !html.contains("onerror=alert(1)>"), "a name became markup");
    assert!(html.contains("&lt;img src=x onerror=alert(1)&gt;&quot;&#39;&amp;"));
    assert_eq!(tags(&html), tags(&page_of("apple")), "names add no element");
}

#[test]
fn the_page_needs_nothing_from_outside() {
    let html = page_of("apple");
    let outside = html.replace("http://www.w3.org/2000/svg", "");
    for word in ["http:", "https:", "<script", "@import", "url(", "<iframe"] {
        assert!(!outside.contains(word), "{word}");
    }
    for source in html.split(" src=\"").skip(1).chain(html.split(" href=\"").skip(1)) {
        assert!(source.starts_with("data:"), "{}", &source[..40]);
    }
}

#[test]
fn every_element_is_closed() {
    check_that_every_element_is_closed(&page_of("apple"));
}

pub(crate) fn check_that_every_element_is_closed(html: &str) {
    let mut open = Vec::new();
    for rest in html.split('<').skip(1) {
        let tag = rest.split([' ', '>', '\n', '/']).next().unwrap_or_default();
        let void = ["!doctype", "meta", "link", "img", "br"].contains(&tag);
        if let Some(name) = rest.strip_prefix('/') {
            let name = name.split('>').next().unwrap_or_default();
            assert_eq!(open.pop(), Some(name), "</{name}> closes something else");
        } else if !void && !rest.split('>').next().unwrap_or_default().ends_with('/') {
            open.push(tag);
        }
    }
    assert!(open.is_empty(), "{open:?}");
}
