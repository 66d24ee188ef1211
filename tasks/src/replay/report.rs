//! Whether a replay came to the same, and where it first did not.

use super::entry::{End, Head, Learnt, Noted};
use super::source::Expected;
use crate::error::TaskError;
use crate::executor::Account;
use crate::summary::StepSummary;
use dsm::map::Map;
use dsm::store::{StoreError, decode, encode_map};
use dsm::time::Stamp;
use dsm_robot::recorded::ReplayEnd;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;

/// Version of the report's layout.
const SCHEMA: u32 = 1;

/// What differs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Differing {
    /// What a frame changed in the map.
    Map,
    /// An event, a grounding, the account of a step.
    Decision,
    /// What a driver was asked.
    Command,
}

/// Where a replay first differs from its recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FirstDifference {
    /// What differs.
    pub of: Differing,
    /// Which part of it.
    pub part: String,
    /// When, simulated seconds.
    pub stamp_s: f64,
    /// What the recording holds.
    pub expected: String,
    /// What the replay came to.
    pub got: String,
}

/// What a replay came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReplayReport {
    /// Version of this layout.
    pub schema: u32,
    /// Name of the episode.
    pub episode: String,
    /// Its seed.
    pub seed: u64,
    /// The robot.
    pub robot: String,
    /// Who detected in the replay.
    pub detector: String,
    /// Whether all that was compared is the same, bit for bit.
    pub identical: bool,
    /// Whether the end of the recorded run was reached: not when the recording breaks off, or the replay differs before.
    pub reached_end: bool,
    /// Simulated time that was replayed, seconds.
    pub sim_time_s: f64,
    /// Control periods that were replayed.
    pub periods: usize,
    /// Commands to drivers that were compared.
    pub commands: usize,
    /// Frames whose part in the map was compared.
    pub frames: usize,
    /// Events that were compared.
    pub events: usize,
    /// Steps whose accounts were compared, with what their words were grounded to.
    pub steps: usize,
    /// Bytes of the final map that were compared; 0 when the recording has no end.
    pub map_bytes: usize,
    /// The earliest difference.
    pub first_difference: Option<FirstDifference>,
    /// The first difference of each kind.
    pub differences: Vec<FirstDifference>,
    /// What else is to be known.
    pub notices: Vec<String>,
}

impl ReplayReport {
    /// Adds what differs from other expectations.
    pub fn add(&mut self, found: Vec<FirstDifference>) {
        self.differences.extend(found);
        self.identical = self.differences.is_empty();
        self.first_difference = find_earliest(&self.differences);
    }
}

fn find_earliest(differences: &[FirstDifference]) -> Option<FirstDifference> {
    differences.iter().min_by(|a, b| a.stamp_s.total_cmp(&b.stamp_s).then(a.of.cmp(&b.of))).cloned()
}

/// All that a replay came to.
pub(super) struct Outcome<'a> {
    pub(super) head: &'a Head,
    pub(super) detector: String,
    pub(super) expected: Vec<Expected>,
    pub(super) end: Option<ReplayEnd>,
    pub(super) learnt: &'a [Learnt],
    pub(super) noted: &'a [Noted],
    pub(super) account: &'a Account,
    pub(super) map: &'a Map,
    pub(super) notices: Vec<String>,
}

/// The recording's side, sorted.
#[derive(Default)]
struct Sorted {
    learnt: Vec<Learnt>,
    noted: Vec<Noted>,
    last: Stamp,
    periods: usize,
    commands: usize,
    end: Option<End>,
    breaks: Option<String>,
}

impl Sorted {
    fn new(expected: Vec<Expected>) -> Result<Self, TaskError> {
        let mut sorted = Self::default();
        for item in expected {
            match item {
                Expected::Learnt(learnt) => sorted.learnt.push(learnt),
                Expected::Noted(noted) => sorted.noted.push(noted),
                Expected::Period(now, commands) => {
                    sorted.last = now;
                    sorted.periods += 1;
                    sorted.commands += commands;
                }
                Expected::End(end) => sorted.end = Some(*end),
                Expected::Full(stamp) => {
                    sorted.breaks = Some(format!("it was bounded and is full at {:.2} s", stamp.as_s()));
                }
                Expected::Break(why) => sorted.breaks = Some(why),
                Expected::Damaged(error) => return Err(error),
            }
        }
        Ok(sorted)
    }
}

/// Compares.
///
/// # Errors
/// [`TaskError`]: the recording is damaged.
pub(super) fn compare(outcome: Outcome<'_>) -> Result<ReplayReport, TaskError> {
    let Outcome { head, detector, expected, end, learnt, noted, account, map, mut notices } = outcome;
    let recorded = Sorted::new(expected)?;
    if let Some(ReplayEnd::Unreadable { stamp, reason }) = &end {
        let reason = format!("at {:.2} s: {reason}", stamp.as_s());
        return Err(StoreError::Foreign { path: head.name.clone().into(), expected: "a recording", reason }.into());
    }
    let whole = recorded.end.is_some();
    if let Some(why) = &recorded.breaks {
        notices.push(format!("the recording ends before the run does: {why}"));
    }
    let (frames, of_map) = compare_learnt(&recorded, learnt, whole);
    let (events, of_events) = compare_noted(&recorded, noted, whole);
    let mut differences: Vec<FirstDifference> = of_map.into_iter().chain(of_events).collect();
    differences.extend(compare_commands(&recorded, end.as_ref()));
    let (mut steps, mut map_bytes) = (0, 0);
    if let (Some(recorded_end), None) = (&recorded.end, &end) {
        steps = recorded_end.steps.len();
        map_bytes = recorded_end.map.len();
        differences.extend(compare_end(recorded_end, account, map, recorded.last));
    }
    let first_difference = find_earliest(&differences);
    Ok(ReplayReport {
        schema: SCHEMA,
        episode: head.name.clone(),
        seed: head.seed,
        robot: head.robot.clone(),
        detector,
        identical: differences.is_empty(),
        reached_end: whole,
        sim_time_s: recorded.last.as_s(),
        periods: recorded.periods,
        commands: recorded.commands,
        frames,
        events,
        steps,
        map_bytes,
        first_difference,
        differences,
        notices,
    })
}

/// Frames that were compared, and the first that taught something else. A recording that breaks off knows fewer.
fn compare_learnt(recorded: &Sorted, got: &[Learnt], whole: bool) -> (usize, Option<FirstDifference>) {
    let words = |learnt: Option<&Learnt>| match learnt {
        Some(learnt) => format!("frame {} changes the map by {:016x}", learnt.frame.0, learnt.digest),
        None => "no further frame".to_owned(),
    };
    let common = recorded.learnt.len().min(got.len());
    let count = if whole { recorded.learnt.len().max(got.len()) } else { common };
    let differs = |&place: &usize| match (recorded.learnt.get(place), got.get(place)) {
        (Some(expected), Some(got)) => (expected.frame, expected.digest) != (got.frame, got.digest),
        _ => true,
    };
    let first = (0..count).find(differs).map(|place| {
        let (expected, got) = (recorded.learnt.get(place), got.get(place));
        FirstDifference {
            of: Differing::Map,
            part: "map".into(),
            stamp_s: expected.or(got).map_or(0.0, |learnt| learnt.stamp.as_s()),
            expected: words(expected),
            got: words(got),
        }
    });
    (common, first)
}

/// Events that were compared, and the first that differs. In the last period of a recording that breaks off anything may
/// have followed.
fn compare_noted(recorded: &Sorted, got: &[Noted], whole: bool) -> (usize, Option<FirstDifference>) {
    let counts = |noted: &&Noted| whole || noted.stamp < recorded.last;
    let (expected, got): (Vec<_>, Vec<_>) =
        (recorded.noted.iter().filter(counts).collect(), got.iter().filter(counts).collect());
    let place = (0..expected.len().max(got.len())).find(|&place| expected.get(place) != got.get(place));
    let first = place.map(|place| {
        let (expected, got) = (expected.get(place), got.get(place));
        let words = |noted: Option<&&Noted>| {
            noted.map_or("no further event".to_owned(), |n| format!("at {:.2} s: {}", n.stamp.as_s(), n.what))
        };
        let stamps = expected.into_iter().chain(got).map(|noted| noted.stamp);
        FirstDifference {
            of: Differing::Decision,
            part: "event".into(),
            stamp_s: stamps.min().unwrap_or_default().as_s(),
            expected: words(expected),
            got: words(got),
        }
    });
    (expected.len(), first)
}

fn compare_commands(recorded: &Sorted, end: Option<&ReplayEnd>) -> Option<FirstDifference> {
    let of_run = |stamp: Stamp, expected: &str, got: &str| FirstDifference {
        of: Differing::Command,
        part: "run".into(),
        stamp_s: stamp.as_s(),
        expected: expected.into(),
        got: got.into(),
    };
    let is_over = recorded.end.is_some() || recorded.breaks.is_some();
    match end {
        Some(ReplayEnd::Differs(found)) => Some(FirstDifference {
            of: Differing::Command,
            part: found.part.into(),
            stamp_s: found.stamp.as_s(),
            expected: found.expected.clone(),
            got: found.got.clone(),
        }),
        Some(ReplayEnd::Over(stamp)) if recorded.end.is_some() => Some(of_run(*stamp, "the run ends", "it goes on")),
        None if !is_over => Some(of_run(recorded.last, "the run goes on", "it ends")),
        _ => None,
    }
}

/// Accounts of steps and the final map.
fn compare_end(expected: &End, account: &Account, map: &Map, last: Stamp) -> Vec<FirstDifference> {
    let mut found = Vec::new();
    for place in 0..expected.steps.len().max(account.steps.len()) {
        let (recorded, got) = (expected.steps.get(place), account.steps.get(place));
        let text = |step: Option<&StepSummary>| {
            step.map_or("no such step".to_owned(), |step| serde_json::to_string(step).unwrap_or_default())
        };
        if text(recorded) != text(got) {
            found.push(FirstDifference {
                of: Differing::Decision,
                part: format!("step {place}"),
                stamp_s: recorded.or(got).map_or(0.0, |step| step.start_s + step.duration_s),
                expected: text(recorded),
                got: text(got),
            });
            break;
        }
    }
    let bytes = encode_map(map);
    if bytes != expected.map {
        found.push(FirstDifference {
            of: Differing::Map,
            part: "final map".into(),
            stamp_s: last.as_s(),
            expected: format!("{} bytes", expected.map.len()),
            got: format!("{} bytes; {}", bytes.len(), find_odd_object(&expected.map, map)),
        });
    }
    found
}

/// The first object in which two maps differ, in words.
fn find_odd_object(expected: &[u8], map: &Map) -> String {
    let Ok(recorded) = decode(expected, Path::new("the recorded map")) else {
        return "the recorded map cannot be read".into();
    };
    let recorded = recorded.map;
    let ids = recorded.objects.keys().chain(map.objects.keys()).collect::<BTreeSet<_>>();
    let odd = ids.into_iter().find(|id| recorded.objects.get(id) != map.objects.get(id));
    odd.map_or_else(|| "objects are the same".into(), |id| format!("object {} differs", id.0))
}
