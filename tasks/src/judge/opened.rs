//! Whether doors and drawers stand as they should, and whether that came about honestly.

use super::{Judge, find, summary};
use crate::episode::{Expectation, ExpectationKind};
use crate::summary::ExpectationSummary;
use dsm::eval::{TrueObject, TruePart, Truth};
use dsm::geometry::OrientedBox;

/// Nothing may be pressed harder than this, newtons.
const MOST_FORCE_N: f64 = 60.0;
/// Nothing else may be moved farther than this, metres.
const MOST_MOVED_M: f64 = 0.05;
/// A door without an end is open when it is turned by this, radians; a drawer without one when it is out by this, metres.
const OPEN_RAD: f64 = std::f64::consts::FRAC_PI_2;
const OPEN_M: f64 = 0.3;
/// What comes no nearer to its end than this is closed, radians or metres.
const CLOSED_RAD: f64 = 0.035;
const CLOSED_M: f64 = 0.01;
/// Contents may stick out of their part by this, metres: boxes of things that lie askew.
const INSIDE_M: f64 = 0.05;

/// How far a part stands from closed (radians or metres), and the same as a share of all its way. A part is closed where its
/// joint is at 0, or at the end nearest to that.
fn open_by(part: &TruePart) -> (f64, f64) {
    let Some([low, high]) = part.range else {
        let full = if part.slides { OPEN_M } else { OPEN_RAD };
        return (part.position.abs(), part.position.abs() / full);
    };
    let closed = 0.0_f64.clamp(low.min(high), high.max(low));
    let full = (high - closed).abs().max((closed - low).abs()).max(1e-6);
    let by = (part.position - closed).abs();
    (by, by / full)
}

/// Follows the parts of one piece of furniture.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Opened {
    since_s: Option<f64>,
}

/// What shall be true of the parts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted<'a> {
    /// The furniture.
    pub whole: &'a str,
    /// The part; any of them when it is not named.
    pub part: Option<&'a str>,
    /// The least share of its way that it is open; `None` for closed.
    pub at_least: Option<f64>,
}

impl Wanted<'_> {
    fn parts<'t>(&self, truth: &'t Truth) -> impl Iterator<Item = &'t TruePart> {
        let named =
            |part: &&TruePart| part.part_of == self.whole && self.part.is_none_or(|name| part.object.body == name);
        truth.parts.iter().filter(named).collect::<Vec<_>>().into_iter()
    }

    fn holds(&self, truth: &Truth) -> bool {
        let mut parts = self.parts(truth).peekable();
        match self.at_least {
            Some(share) => parts.any(|part| open_by(part).1 >= share),
            None => {
                let bound = |part: &TruePart| if part.slides { CLOSED_M } else { CLOSED_RAD };
                parts.peek().is_some() && parts.all(|part| open_by(part).0 <= bound(part))
            }
        }
    }

    /// The part that is open farthest, in words.
    pub(super) fn describe(&self, truth: &Truth) -> String {
        let farthest = self.parts(truth).max_by(|a, b| open_by(a).1.total_cmp(&open_by(b).1));
        farthest.map_or_else(
            || format!("{} has no such part", self.whole),
            |part| {
                let ((by, share), unit) = (open_by(part), if part.slides { "m" } else { "rad" });
                format!("{} is open by {by:.3} {unit}, {:.0} %", part.object.body, 100.0 * share)
            },
        )
    }
}

impl Opened {
    /// Takes in the next sample.
    pub(super) fn follow(&mut self, truth: &Truth, wanted: &Wanted<'_>) {
        let now_s = truth.stamp.as_s();
        self.since_s = wanted.holds(truth).then(|| self.since_s.unwrap_or(now_s));
    }

    /// For how long it has been so, seconds.
    pub(super) fn time_s(&self, now_s: f64) -> f64 {
        self.since_s.map_or(0.0, |since_s| now_s - since_s)
    }
}

fn holds_within(bounds: &OrientedBox, object: &TrueObject, margin_m: f64) -> bool {
    bounds.contains(&object.bounds.center, margin_m)
}

/// What lay in a part at the start.
fn contents_of<'t>(first: &'t Truth, whole: &str) -> Vec<(&'t TruePart, &'t TrueObject)> {
    let parts = first.parts.iter().filter(|part| part.part_of == whole);
    let inside = |part: &'t TruePart| {
        let things = first.objects.iter().filter(|object| object.free);
        things.filter(move |thing| holds_within(&part.object.bounds, thing, 0.0)).map(move |thing| (part, thing))
    };
    parts.flat_map(inside).collect()
}

/// Contents that are not in their part any more, other than `taken`.
fn find_spilt<'t>(first: &'t Truth, last: &Truth, whole: &str, taken: &[&str]) -> Option<&'t str> {
    contents_of(first, whole).into_iter().find_map(|(part, thing)| {
        let now = last.parts.iter().find(|other| other.object.body == part.object.body)?;
        let lies = find(last, &thing.body)?;
        let kept = holds_within(&now.object.bounds, lies, INSIDE_M) || taken.contains(&thing.body.as_str());
        (!kept).then_some(thing.body.as_str())
    })
}

/// What an expectation wants of doors and drawers, when it is about them.
pub(super) fn wanted_of(e: &Expectation) -> Option<Wanted<'_>> {
    let at_least = match e.kind {
        ExpectationKind::JointOpen => Some(e.at_least),
        ExpectationKind::JointClosed => None,
        _ => return None,
    };
    Some(Wanted { whole: e.object.as_deref()?, part: e.part.as_deref(), at_least })
}

impl Judge {
    /// What lay in the furniture at the start: it comes along with its drawers.
    pub(super) fn contents(&self, wanted: &Wanted<'_>) -> Vec<&str> {
        let first = self.first.iter().flat_map(|first| contents_of(first, wanted.whole));
        first.map(|(_, thing)| thing.body.as_str()).collect()
    }

    /// Judges a door or drawer.
    pub(super) fn judge_part(&self, i: usize, e: &Expectation, first: &Truth, last: &Truth) -> ExpectationSummary {
        let Some(wanted) = wanted_of(e) else { return summary(e, false, String::new(), String::new()) };
        let held_s = self.opened[i].time_s(last.stamp.as_s());
        let force_n = self.contacts().iter().map(|c| c.max_force_n).fold(0.0, f64::max);
        // What else the task is about may be taken; what lies in the part comes along.
        let named = self.targets();
        let contents = self.contents(&wanted);
        let excused = |body: &str| named.contains(&body) || contents.contains(&body);
        let moved = self.displacement.iter().filter(|(body, _)| !excused(body)).max_by(|a, b| a.1.total_cmp(b.1));
        let moved_m = moved.map_or(0.0, |(_, moved_m)| *moved_m);
        let spilt = find_spilt(first, last, wanted.whole, &named);
        let passed = held_s >= e.hold_s && force_n <= MOST_FORCE_N && moved_m <= MOST_MOVED_M && spilt.is_none();
        let measured = format!(
            "{} for {held_s:.1} s; most force {force_n:.0} N; {} moved by {moved_m:.3} m; spilt: {}",
            wanted.describe(last),
            moved.map_or("nothing", |(body, _)| body.as_str()),
            spilt.unwrap_or("nothing")
        );
        let share = wanted.at_least.map_or("closed".to_owned(), |share| format!("open by {:.0} %", 100.0 * share));
        let required = format!("{share} for {} s; at most {MOST_FORCE_N} N and {MOST_MOVED_M} m", e.hold_s);
        summary(e, passed, measured, required)
    }
}

#[cfg(test)]
mod tests {
    //! Contract: a drawer counts as open by its share of the way, held; closed means all parts of it; what it holds comes
    //! along and must stay inside.
    use super::*;
    use dsm::time::Stamp;
    use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

    fn object(body: &str, x_m: f64, side_m: f64, free: bool) -> TrueObject {
        TrueObject {
            body: body.into(),
            category: body.into(),
            world_from_body: Isometry3::translation(x_m, 0.0, 0.5),
            bounds: OrientedBox {
                center: Point3::new(x_m, 0.0, 0.5),
                size: Vector3::repeat(side_m),
                rotation: UnitQuaternion::identity(),
            },
            free,
        }
    }

    fn truth(step: i64, out_m: f64, cup_at_m: f64) -> Truth {
        let drawer = |name: &str, position: f64| TruePart {
            object: object(name, position, 0.4, false),
            part_of: "dresser".into(),
            joint: name.into(),
            slides: true,
            position,
            velocity: 0.0,
            range: Some([0.0, 0.3]),
        };
        Truth {
            stamp: Stamp(500_000_000 * step),
            objects: vec![object("dresser", 0.0, 0.5, false), object("cup", cup_at_m, 0.08, true)],
            world_from_base: Isometry3::identity(),
            contacts: Vec::new(),
            events: Vec::new(),
            clearance_m: None,
            in_view: Vec::new(),
            joints: Vec::new(),
            parts: vec![drawer("drawer_1", out_m), drawer("drawer_2", 0.004)],
        }
    }

    fn time_s(wanted: &Wanted<'_>, outs: &[f64]) -> f64 {
        let mut opened = Opened::default();
        for (step, out_m) in outs.iter().enumerate() {
            opened.follow(&truth(step as i64, *out_m, 0.0), wanted);
        }
        opened.time_s(0.5 * (outs.len() - 1) as f64)
    }

    #[test]
    fn open_and_closed_are_held() {
        let wanted = |part, at_least| Wanted { whole: "dresser", part, at_least };
        let outs = [0.0, 0.1, 0.2, 0.2, 0.2, 0.2];
        assert_eq!(time_s(&wanted(Some("drawer_1"), Some(0.6)), &outs), 1.5);
        assert_eq!(time_s(&wanted(None, Some(0.6)), &outs), 1.5, "any of them");
        assert_eq!(time_s(&wanted(Some("drawer_2"), Some(0.6)), &outs), 0.0);
        assert_eq!(time_s(&wanted(Some("drawer_2"), None), &outs), 2.5);
        assert_eq!(time_s(&wanted(None, None), &outs), 0.0, "all of them");
        assert_eq!(time_s(&wanted(Some("door_1"), None), &outs), 0.0, "there is none");
    }

    #[test]
    fn contents_come_along() {
        let first = truth(0, 0.0, 0.1);
        assert!(contents_of(&first, "dresser").iter().any(|(_, thing)| thing.body == "cup"));
        // In both drawers of this sketch: the one that moves keeps it.
        assert_eq!(find_spilt(&first, &truth(9, 0.1, 0.2), "dresser", &[]), None);
        assert_eq!(find_spilt(&first, &truth(9, 0.1, 1.2), "dresser", &[]), Some("cup"));
        assert_eq!(find_spilt(&first, &truth(9, 0.1, 1.2), "dresser", &["cup"]), None);
        assert!(contents_of(&first, "table").is_empty());
    }
}
