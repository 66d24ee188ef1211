//! Contract: the page says stage and cause, what was done to the world, what was seen before the end, and how to run it
//! again; it needs nothing from outside, and hostile names stay text. Successes have no page.
use super::*;
use crate::episode::Episode;
use crate::report::tests::{HOSTILE, check_that_every_element_is_closed, finished};
use crate::summary::{ContactSummary, DisturbanceSummary};

fn spec(file: &str) -> RunSpec {
    let spec = RunSpec::new("apple", Episode { seed: 1, ..Episode::new("scenes/apartment") });
    RunSpec { file: file.into(), seed: 4, perception: "oracle".into(), ..spec }
}

fn page_of(name: &str) -> String {
    let mut finished = finished(name);
    let truth = &mut finished.summary.truth;
    truth.disturbances.push(DisturbanceSummary { at_s: 3.0, what: format!("slip of {name} begins") });
    truth.contacts.push(ContactSummary {
        link: "gripper".into(),
        body: name.into(),
        start_s: 2.0,
        max_force_n: 12.4,
        approach_speed_m_per_s: 0.05,
    });
    failure_page(&finished, &spec("homes/a b/x.toml")).expect("it failed")
}

#[test]
fn the_page_tells_what_failed_and_how_to_see_it_again() {
    let html = page_of("apple");
    for part in [
        "grounding",
        "dsm run &#39;homes/a b/x.toml&#39; --seed 4 --perception oracle",
        "slip of apple begins",
        "gripper and apple: 12 N",
        "report.html",
        "What it knew",
    ] {
        assert!(html.contains(part), "{part} is missing");
    }
    assert_eq!(html.matches("<img ").count(), 2 * MOST_EVENT_PICTURES, "colour and depth of the last events");
    check_that_every_element_is_closed(&html);
    check_that_every_element_is_closed(&crash_page(&spec("x.toml"), HOSTILE));
}

#[test]
fn hostile_names_stay_text_and_a_success_has_no_page() {
    for html in [page_of(HOSTILE), crash_page(&spec(HOSTILE), HOSTILE)] {
        assert!(!html.contains("<img src=x") && !html.contains("onerror=alert(1)>"), "a name became markup");
    }
    let mut good = finished("apple");
    good.summary.failure = None;
    assert_eq!(failure_page(&good, &spec("x.toml")), None);
}

#[test]
fn the_command_names_only_what_differs() {
    let plain = RunSpec { perception: "noisy".into(), ..spec("x.toml") };
    assert_eq!(replay_command(&plain), "dsm run x.toml --seed 4");
}
