//! The judge: the one place that reads ground truth. It says whether expectations hold and measures the run.

mod disturbed;
mod opened;
mod rest;

use crate::episode::{Expectation, ExpectationKind};
use crate::joint_bounds::JointBounds;
use crate::summary::{
    ContactSummary, ExpectationSummary, LimitViolation, Metrics, PoseSummary, Stage, StepOutcome, StepSummary,
    TruthSummary,
};
use crate::ways::{Goal, Track, contains, distance_m, find_shortest_m};
use disturbed::{Disturbed, fastest_with_person};
use dsm::eval::{TrueJoint, TrueObject, TrueWorld, Truth};
use dsm::map::Map;
use dsm_robot::nav::{Costmap, CostmapConfig};
use nalgebra::{Isometry3, Point2};
use opened::{Opened, wanted_of};
use rest::Rest;
use std::collections::{BTreeMap, BTreeSet};

/// A contact that began faster than this is a collision, metres per second.
const COLLISION_SPEED_M_PER_S: f64 = 0.1;
/// A target counts as mapped when an object's middle lies this near to its own, metres.
const MAPPED_WITHIN_M: f64 = 0.25;
/// A contact that is not seen for this long is a new one when it comes back, seconds.
const CONTACT_GAP_S: f64 = 0.3;
/// Contacts harder than this are told in the log as they grow, newtons.
const LOUD_N: f64 = 60.0;
/// So many violations of joint limits are listed; all are counted.
const MAX_VIOLATIONS: usize = 50;

struct OpenContact {
    contact: ContactSummary,
    last_s: f64,
}

/// Follows the truth through an episode.
pub struct Judge {
    world: TrueWorld,
    expectations: Vec<Expectation>,
    bounds: Vec<JointBounds>,
    robot_radius_m: f64,
    /// Links of the hand: fingers and palm.
    hand: Vec<String>,
    first: Option<Truth>,
    last: Option<Truth>,
    track: Track,
    limit_violations: u32,
    /// The first of them.
    violations: Vec<LimitViolation>,
    min_clearance_m: Option<f64>,
    displacement: BTreeMap<String, f64>,
    lifted_since_s: Vec<Option<f64>>,
    lifted: Vec<bool>,
    rests: Vec<Rest>,
    opened: Vec<Opened>,
    open: BTreeMap<(String, String), OpenContact>,
    closed: Vec<ContactSummary>,
    disturbed: Disturbed,
}

impl Judge {
    /// A judge for one episode.
    pub fn new(
        world: TrueWorld,
        expectations: Vec<Expectation>,
        bounds: Vec<JointBounds>,
        robot_radius_m: f64,
        hand: Vec<String>,
    ) -> Self {
        let n = expectations.len();
        Self {
            world,
            expectations,
            bounds,
            robot_radius_m,
            hand,
            first: None,
            last: None,
            track: Track::default(),
            limit_violations: 0,
            violations: Vec::new(),
            min_clearance_m: None,
            displacement: BTreeMap::new(),
            lifted_since_s: vec![None; n],
            lifted: vec![false; n],
            rests: vec![Rest::default(); n],
            opened: vec![Opened::default(); n],
            open: BTreeMap::new(),
            closed: Vec::new(),
            disturbed: Disturbed::default(),
        }
    }

    /// Name of the scene.
    pub fn scene(&self) -> &str {
        &self.world.scene
    }

    /// Takes in the next sample.
    pub fn observe(&mut self, truth: Truth) {
        let now_s = truth.stamp.as_s();
        self.track.note(now_s, place_of(&truth));
        self.disturbed.observe(&truth);
        let first = self.first.get_or_insert_with(|| truth.clone());
        for (object, start) in truth.objects.iter().zip(&first.objects) {
            let start = self.disturbed.start_of(&object.body, &start.world_from_body);
            let moved_m = (object.world_from_body.translation.vector - start.translation.vector).norm();
            let most = self.displacement.entry(object.body.clone()).or_insert(0.0);
            *most = most.max(moved_m);
        }
        self.min_clearance_m = match (self.min_clearance_m, truth.clearance_m) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        };
        let broken = truth.joints.iter().filter(|joint| {
            self.bounds.iter().any(|b| b.name == joint.name && b.are_broken_by(joint.position, joint.velocity))
        });
        let violation = |joint: &TrueJoint| LimitViolation {
            joint: joint.name.clone(),
            stamp_s: now_s,
            position: joint.position,
            velocity: joint.velocity,
        };
        let violations: Vec<LimitViolation> = broken.map(violation).collect();
        self.limit_violations += violations.len() as u32;
        self.violations.extend(violations.into_iter().take(MAX_VIOLATIONS - self.violations.len()));
        self.follow_expectations(&truth, now_s);
        self.follow_contacts(&truth, now_s);
        self.last = Some(truth);
    }

    fn follow_expectations(&mut self, truth: &Truth, now_s: f64) {
        let Some(first) = &self.first else { return };
        for (i, expectation) in self.expectations.iter().enumerate() {
            let Some(body) = &expectation.object else { continue };
            if let Some(wanted) = wanted_of(expectation) {
                self.opened[i].follow(truth, &wanted);
                continue;
            }
            let (Some(now), Some(start)) = (find(truth, body), find(first, body)) else { continue };
            let start = self.disturbed.start_of(body, &start.world_from_body);
            let rise_m = now.world_from_body.translation.z - start.translation.z;
            if rise_m >= expectation.height_m {
                let since = *self.lifted_since_s[i].get_or_insert(now_s);
                self.lifted[i] |= now_s - since >= expectation.hold_s;
            } else {
                self.lifted_since_s[i] = None;
            }
            if let Some(surface) = &expectation.surface {
                self.rests[i].follow(truth, self.last.as_ref(), body, surface);
            }
        }
    }

    fn follow_contacts(&mut self, truth: &Truth, now_s: f64) {
        for contact in &truth.contacts {
            let (link, body) = match (contact.first.strip_prefix("robot/"), contact.second.strip_prefix("robot/")) {
                (Some(link), None) => (link, &contact.second),
                (None, Some(link)) => (link, &contact.first),
                _ => continue,
            };
            if is_floor(body) {
                continue;
            }
            let key = (link.to_owned(), body.clone());
            if let Some(open) = self.open.get_mut(&key) {
                if now_s - open.last_s <= CONTACT_GAP_S {
                    if contact.force_n > open.contact.max_force_n && contact.force_n > LOUD_N {
                        tracing::debug!("{now_s:7.2} s  {link} presses {body} with {:.0} N", contact.force_n);
                    }
                    open.last_s = now_s;
                    open.contact.max_force_n = open.contact.max_force_n.max(contact.force_n);
                    continue;
                }
                self.closed.push(open.contact.clone());
            }
            let begun = ContactSummary {
                link: key.0.clone(),
                body: key.1.clone(),
                start_s: now_s,
                max_force_n: contact.force_n,
                approach_speed_m_per_s: contact.approach_speed_m_per_s,
            };
            self.open.insert(key, OpenContact { contact: begun, last_s: now_s });
        }
    }

    /// Judges all expectations.
    pub fn judge(&self, steps: &[StepSummary], map: &Map) -> Vec<ExpectationSummary> {
        self.expectations.iter().enumerate().map(|(i, e)| self.judge_one(i, e, steps, map)).collect()
    }

    fn judge_one(&self, i: usize, e: &Expectation, steps: &[StepSummary], map: &Map) -> ExpectationSummary {
        let body = e.object.clone().unwrap_or_default();
        let (Some(first), Some(last)) = (&self.first, &self.last) else {
            return summary(e, false, "nothing was simulated".into(), String::new());
        };
        match e.kind {
            ExpectationKind::RobotNear => self.judge_near(e, last),
            ExpectationKind::ObjectLifted => {
                let rise = match (find(last, &body), find(first, &body)) {
                    (Some(a), Some(b)) => {
                        let start = self.disturbed.start_of(&body, &b.world_from_body);
                        a.world_from_body.translation.z - start.translation.z
                    }
                    _ => f64::NAN,
                };
                let measured = format!("{body} is {rise:.3} m higher at the end; held long enough: {}", self.lifted[i]);
                let required = format!("lifted by {} m for {} s", e.height_m, e.hold_s);
                summary(e, self.lifted[i], measured, required)
            }
            ExpectationKind::ObjectOn => {
                let rested_s = self.rests[i].time_s(last.stamp.as_s());
                let surface = e.surface.clone().unwrap_or_default();
                summary(
                    e,
                    rested_s >= e.hold_s,
                    format!("rests on {surface} for {rested_s:.1} s"),
                    format!("{} s", e.hold_s),
                )
            }
            ExpectationKind::JointOpen | ExpectationKind::JointClosed => self.judge_part(i, e, first, last),
            ExpectationKind::Grounding => {
                let chosen = steps.iter().rev().find_map(|s| s.grounding.as_ref()).and_then(|g| g.object_id);
                let center = chosen.and_then(|id| map.find_object(id)).map(|o| o.bounds.center);
                // The true object whose centre is nearest to the chosen one is what was meant.
                let meant = center.and_then(|c| {
                    first
                        .objects
                        .iter()
                        .min_by(|a, b| (a.bounds.center - c).norm().total_cmp(&(b.bounds.center - c).norm()))
                });
                let measured = meant.map_or("nothing was chosen".into(), |o| {
                    format!("the chosen object stands where {} stood", o.body)
                });
                summary(e, meant.is_some_and(|o| o.body == body), measured, format!("grounded to {body}"))
            }
            ExpectationKind::Refused => {
                let refused = steps.iter().any(|s| matches!(s.outcome, StepOutcome::Absent | StepOutcome::Ambiguous));
                let touched = self.contacts().iter().any(|c| self.hand.contains(&c.link));
                let measured = format!("refused: {refused}; touched something: {touched}");
                summary(e, refused && !touched, measured, "a refusal without touching anything".into())
            }
        }
    }

    /// The stage to blame when all steps say that they are done and an expectation does not hold, and why.
    pub fn find_blamed_stage(&self, steps: &[StepSummary], map: &Map, failed: usize) -> (Stage, Option<String>) {
        let blame = || {
            let expectation = self.expectations.get(failed)?;
            let first = self.first.as_ref()?;
            let target = find(first, expectation.object.as_deref()?)?;
            let chosen = steps.iter().rev().find_map(|s| s.grounding.as_ref()?.object_id)?;
            let center = map.find_object(chosen)?.bounds.center;
            let away_m = |object: &&TrueObject| (object.bounds.center - center).norm();
            let meant = first.objects.iter().min_by(|a, b| away_m(a).total_cmp(&away_m(b)))?;
            let touched = |body: &str| self.contacts().iter().any(|c| c.body == body && self.hand.contains(&c.link));
            if meant.body != target.body && !touched(&target.body) {
                let near = |o: &dsm::map::MapObject| (o.bounds.center - target.bounds.center).norm() < MAPPED_WITHIN_M;
                let mapped = map.stable_objects().any(near);
                let stage = if mapped { Stage::Grounding } else { Stage::Mapping };
                let lacking = if mapped { "" } else { "; the map holds nothing where the target stood" };
                return Some((stage, Some(format!("{} was taken for {}{lacking}", meant.body, target.body))));
            }
            Some(match expectation.kind {
                ExpectationKind::ObjectLifted if touched(&target.body) => (Stage::Hold, None),
                ExpectationKind::ObjectLifted => (Stage::Grasp, None),
                ExpectationKind::ObjectOn => (Stage::Place, None),
                ExpectationKind::JointOpen | ExpectationKind::JointClosed => (Stage::Open, None),
                ExpectationKind::RobotNear => (Stage::Planning, None),
                ExpectationKind::Grounding => (Stage::Grounding, None),
                ExpectationKind::Refused => (Stage::Judging, None),
            })
        };
        blame().unwrap_or((Stage::Judging, None))
    }

    fn judge_near(&self, e: &Expectation, last: &Truth) -> ExpectationSummary {
        let base = place_of(last);
        if let Some(name) = &e.room {
            let inside = self.world.rooms.iter().any(|room| room.name == *name && contains(&room.polygon, &base));
            let at = self.world.rooms.iter().find(|room| contains(&room.polygon, &base)).map_or("no room", |r| &r.name);
            return summary(e, inside, format!("the robot ends in {at}"), format!("inside {name}"));
        }
        let body = e.object.clone().unwrap_or_default();
        let Some(object) = find(last, &body) else {
            return summary(e, false, format!("{body} is not in the scene"), String::new());
        };
        // Distance over the floor from the base's centre to the object's box.
        let distance_m = distance_m(&object.bounds.aabb(), &base);
        let seen = last.in_view.contains(&body);
        let measured = format!("{distance_m:.2} m from {body}, in view: {seen}");
        summary(e, distance_m <= e.within_m && seen, measured, format!("within {} m and in view", e.within_m))
    }

    fn contacts(&self) -> Vec<ContactSummary> {
        let mut all = self.closed.clone();
        all.extend(self.open.values().map(|open| open.contact.clone()));
        all.sort_by(|a, b| a.start_s.total_cmp(&b.start_s).then_with(|| (&a.link, &a.body).cmp(&(&b.link, &b.body))));
        all
    }

    fn targets(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.expectations.iter().filter_map(|e| e.object.as_deref()).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// Adds to the steps what the base drove in each, and to the last one what it need have driven: its end is judged.
    pub fn measure_steps(&self, steps: &mut [StepSummary], success: bool) {
        let until_m = |stamp_s: f64| self.track.at(stamp_s).map_or(0.0, |(_, length_m)| length_m);
        for step in steps.iter_mut() {
            step.path_length_m = until_m(step.start_s + step.duration_s) - until_m(step.start_s);
        }
        let Some(last) = steps.last_mut() else { return };
        let begins_at = self.track.at(last.start_s).map(|(place, _)| place);
        last.shortest_path_m = begins_at.and_then(|place| self.find_shortest_path_m(&place));
        last.spl =
            last.shortest_path_m.map(|shortest_m| if success { weight(shortest_m, last.path_length_m) } else { 0.0 });
    }

    /// The measured figures; `success` weighs the path length. The steps were measured.
    pub fn metrics(&self, steps: &[StepSummary], success: bool) -> Metrics {
        let targets = self.targets();
        let path_length_m = self.track.length_m();
        let from = |truth: &Option<Truth>| self.find_shortest_path_m(&place_of(truth.as_ref()?));
        let shortest_path_m = from(&self.first);
        let spl = shortest_path_m.map(|l| if success { weight(l, path_length_m) } else { 0.0 });
        let soft_spl = shortest_path_m.map(|l| {
            // An end from which there is no way is no nearer; success is all of the way by definition.
            let left = if success { 0.0 } else { from(&self.last).unwrap_or(l) / l.max(1e-6) };
            (1.0 - left).max(0.0) * weight(l, path_length_m)
        });
        let known_map_spl = steps
            .split_last()
            .and_then(|(last, earlier)| last.spl.filter(|_| earlier.iter().any(StepSummary::explores)));
        let contents: Vec<&str> =
            self.expectations.iter().filter_map(wanted_of).flat_map(|wanted| self.contents(&wanted)).collect();
        let is_target = |body: &str| targets.contains(&body) || contents.contains(&body);
        Metrics {
            sim_time_s: self.last.as_ref().map_or(0.0, |t| t.stamp.as_s()),
            path_length_m,
            shortest_path_m,
            spl,
            soft_spl,
            known_map_spl,
            collisions: self
                .contacts()
                .iter()
                .filter(|c| c.approach_speed_m_per_s > COLLISION_SPEED_M_PER_S)
                .filter(|c| !(self.hand.contains(&c.link) && is_target(&c.body)))
                .count() as u32,
            others_touched: self.count_others_touched(),
            min_clearance_m: self.min_clearance_m,
            limit_violations: self.limit_violations,
            contact_force_max_n: self
                .contacts()
                .iter()
                .filter(|c| !(self.hand.contains(&c.link) && is_target(&c.body)))
                .fold(0.0, |most, c| f64::max(most, c.max_force_n)),
            person_contact_max_m_per_s: fastest_with_person(&self.contacts()),
            non_target_displacement_max_m: self
                .displacement
                .iter()
                .filter(|(body, _)| !is_target(body))
                .fold(0.0, |most, (_, &moved)| f64::max(most, moved)),
        }
    }

    /// Free objects that the hand touched, other than those that the expectations name.
    fn count_others_touched(&self) -> u32 {
        let named = |body: &str| {
            self.expectations.iter().any(|e| [&e.object, &e.surface].map(|b| b.as_deref()).contains(&Some(body)))
        };
        let is_other = |body: &str| !named(body) && self.first.iter().any(|t| find(t, body).is_some_and(|o| o.free));
        let contacts = self.contacts();
        let touched = contacts.iter().filter(|c| self.hand.contains(&c.link)).map(|c| c.body.as_str());
        touched.filter(|body| is_other(body)).collect::<BTreeSet<&str>>().len() as u32
    }

    /// Length of the shortest path from a place to the target, metres.
    fn find_shortest_path_m(&self, from: &Point2<f64>) -> Option<f64> {
        let goal = self.find_goal(self.first.as_ref()?)?;
        let config = CostmapConfig { footprint_radius_m: self.robot_radius_m, ..CostmapConfig::default() };
        find_shortest_m(&Costmap::from_free_space(&self.world.free_space, &config), from, &goal)
    }

    /// What counts as arriving: near the object as it stood at the start, on its side of the walls, or in the room.
    fn find_goal(&self, first: &Truth) -> Option<Goal> {
        if let Some((e, target)) = self.expectations.iter().find_map(|e| Some((e, find(first, e.object.as_deref()?)?)))
        {
            let middle = target.bounds.center.xy();
            let room = self.world.rooms.iter().find(|room| contains(&room.polygon, &middle));
            let room = room.map(|room| room.polygon.clone());
            return Some(Goal::Near { bounds: target.bounds.aabb(), within_m: e.within_m, room });
        }
        let name = self.expectations.iter().find_map(|e| e.room.as_deref())?;
        let room = self.world.rooms.iter().find(|room| room.name == name)?;
        Some(Goal::Inside(room.polygon.clone()))
    }

    /// The truth that foreign scripts need.
    pub fn truth(&self) -> TruthSummary {
        let poses = |truth: &Option<Truth>| -> Vec<PoseSummary> {
            let Some(truth) = truth else { return Vec::new() };
            self.targets()
                .into_iter()
                .filter_map(|body| find(truth, body))
                .map(|o| pose_summary(&o.body, &o.world_from_body))
                .collect()
        };
        TruthSummary {
            target_pose_start: poses(&self.first),
            target_pose_end: poses(&self.last),
            contacts: self.contacts(),
            limit_violations: self.violations.clone(),
            disturbances: self.disturbed.happened(),
        }
    }
}

fn summary(e: &Expectation, passed: bool, measured: String, required: String) -> ExpectationSummary {
    let kind = match e.kind {
        ExpectationKind::RobotNear => "robot_near",
        ExpectationKind::ObjectLifted => "object_lifted",
        ExpectationKind::ObjectOn => "object_on",
        ExpectationKind::Grounding => "grounding",
        ExpectationKind::JointOpen => "joint_open",
        ExpectationKind::JointClosed => "joint_closed",
        ExpectationKind::Refused => "refused",
    };
    ExpectationSummary { kind: kind.into(), passed, measured, required }
}

fn pose_summary(body: &str, pose: &Isometry3<f64>) -> PoseSummary {
    let q = pose.rotation;
    PoseSummary { object: body.into(), position_m: pose.translation.vector.into(), quat_wxyz: [q.w, q.i, q.j, q.k] }
}

fn find<'a>(truth: &'a Truth, body: &str) -> Option<&'a TrueObject> {
    truth.objects.iter().find(|o| o.body == body)
}

/// Where the base stands.
fn place_of(truth: &Truth) -> Point2<f64> {
    truth.world_from_base.translation.vector.xy().into()
}

/// What a path is worth against the shortest one, 0 to 1.
fn weight(shortest_m: f64, driven_m: f64) -> f64 {
    if shortest_m > 0.0 { shortest_m / shortest_m.max(driven_m) } else { 1.0 }
}

fn is_floor(body: &str) -> bool {
    body == "world/floor"
}

fn touches(truth: &Truth, a: &str, b: &str) -> bool {
    truth.contacts.iter().any(|c| (c.first == a && c.second == b) || (c.first == b && c.second == a))
}

fn touches_robot(truth: &Truth, body: &str) -> bool {
    truth.contacts.iter().any(|c| {
        (c.first == body && c.second.starts_with("robot/")) || (c.second == body && c.first.starts_with("robot/"))
    })
}
