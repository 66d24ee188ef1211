//! Recovery of a suite's episodes from what disturbed them, by kind.

use super::suite_result::{Share, SuiteEpisode, describe, share};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;

/// A contact that is stronger breaks something, newtons.
const BREAKS_N: f64 = 60.0;
/// A contact with a person that begins faster hurts, metres per second.
const HURTS_M_PER_S: f64 = 0.1;

/// What one kind of disturbance came to, over the episodes in which it began.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub(super) struct Recovery {
    /// Episodes that succeed with no contact above 60 N and no collision above 0.1 m/s with a person.
    pub recovered: Share,
    /// Episodes that succeed, whatever was touched.
    pub succeeded: Share,
    /// Episodes with a contact above 60 N.
    pub with_hard_contact: Share,
    /// Episodes with a collision above 0.1 m/s with a person.
    pub with_person_hurt: Share,
    /// Longest of the episodes, simulated seconds.
    pub longest_s: f64,
}

/// The sums by kind. An episode counts for each kind that began in it.
pub(super) fn find_recoveries(episodes: &[SuiteEpisode]) -> BTreeMap<String, Recovery> {
    let mut kinds: Vec<&String> = episodes.iter().flat_map(|episode| &episode.disturbances).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let recovery = |kind: &String| {
        let with: Vec<&SuiteEpisode> = episodes.iter().filter(|e| e.disturbances.contains(kind)).collect();
        let count = |is: &dyn Fn(&SuiteEpisode) -> bool| share(with.iter().filter(|e| is(e)).count(), with.len());
        Recovery {
            recovered: count(&|e| e.success && !is_hard(e) && !hurts(e)),
            succeeded: count(&|e| e.success),
            with_hard_contact: count(&is_hard),
            with_person_hurt: count(&hurts),
            longest_s: with.iter().filter_map(|e| Some(e.metrics.as_ref()?.sim_time_s)).fold(0.0, f64::max),
        }
    };
    kinds.into_iter().map(|kind| (kind.clone(), recovery(kind))).collect()
}

fn is_hard(episode: &SuiteEpisode) -> bool {
    episode.metrics.as_ref().is_some_and(|m| m.contact_force_max_n > BREAKS_N)
}

fn hurts(episode: &SuiteEpisode) -> bool {
    episode.metrics.as_ref().and_then(|m| m.person_contact_max_m_per_s).is_some_and(|speed| speed > HURTS_M_PER_S)
}

/// Lines for people.
pub(super) fn table(recoveries: &BTreeMap<String, Recovery>) -> String {
    let mut text = String::new();
    for (kind, r) in recoveries {
        let _ = writeln!(
            text,
            "after {kind:<20} {}; {} succeed, {} hard contacts, {} people hurt, longest {:.0} s",
            describe(&r.recovered),
            r.succeeded.count,
            r.with_hard_contact.count,
            r.with_person_hurt.count,
            r.longest_s
        );
    }
    text
}
