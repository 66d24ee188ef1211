//! Opening a closed door between rooms: look at it, read which way it opens, then pull it by its handle or push it with the
//! closed hand, and get out of its way.

use super::Outcome;
use super::approach::{Approach, Ground, come_to, find_approach_around, find_approaches, plan_on_ground};
use super::arm::{move_joints_around, move_through};
use super::close::hands_ahead;
use super::doors::{ClosedDoor, Leaf, Opens, read_leaf};
use super::drive::{Drive, DriveOutcome};
use super::front_places::{Reach, WRIST_LOOK_M, reaches};
use super::fronts::{Grabbed, Side, gather};
use super::grasp::{GraspSettings, finger_links};
use super::obstacles::{find_obstacles, leave_out_overlaps};
use super::open::{open_by, pose_before};
use super::pull::{creep, turn};
use super::retreat::{back_off, retreat};
use super::shove::{Arc, Shoved, shove};
use crate::agent::{Agent, Gaze, Halt};
use crate::summary::Stage;
use dsm::Pose;
use dsm::time::Span;
use dsm_robot::control::{IkRequest, find_ik};
use dsm_robot::joints::JointPositions;
use dsm_robot::model::{Configuration, Obstacle, RobotModel};
use dsm_robot::nav::{NavConfig, Pose2};
use nalgebra::{Point2, Point3, Translation3, Vector2, Vector3};

/// Attempts before a door is given up.
const MAX_ATTEMPTS: usize = 2;
/// A door is pulled, or pushed, so far, radians: the robot drives through beside the leaf.
const PULL_RAD: f64 = 1.35;
const PUSH_RAD: f64 = 1.3;
/// A hand that comes no farther, with what it stopped before the leaf, has met a door that opens to the other side, radians.
const STUCK_RAD: f64 = 0.16;
/// Distances of the base from the leaf that it pushes, the best first, metres.
const PUSH_FROM_M: [f64; 5] = [0.62, 0.66, 0.7, 0.58, 0.54];
/// Room in which the arm unfolds, behind that, metres.
const UNFOLD_BACK_M: [f64; 4] = [0.35, 0.25, 0.45, 0.15];
/// Heights at which a leaf is pushed, the best first, metres, and how far towards the hinges from its handle.
const PUSH_AT_M: [f64; 4] = [0.95, 0.85, 1.05, 0.75];
const BESIDE_HANDLE_M: [f64; 2] = [0.09, 0.16];
/// The hand stops so far before the leaf, metres: what localisation and looks are off.
const BEFORE_M: f64 = 0.06;
/// An open doorway is looked at from so much farther back, metres, and the base backs off at this speed, metres per second.
const LOOK_BACK_M: f64 = 0.45;
const LOOK_BACK_M_PER_S: f64 = 0.15;
/// The posture in which the robot drives, and how far that may stick out of the footprint, metres.
const FOLDED: &str = "carry";
const FOLDED_M: f64 = 0.02;

type Tried<T> = Result<T, (Stage, String)>;

/// Opens a closed door so far that the robot can drive through.
pub(super) fn open_door(
    agent: &mut Agent,
    nav: &NavConfig,
    settings: &GraspSettings,
    door: &ClosedDoor,
) -> Result<Outcome, Halt> {
    let task = Task { nav, settings, door };
    let mut known = None;
    let mut last = (Stage::Planning, "no attempt was made".to_owned());
    for attempt in 0..MAX_ATTEMPTS {
        match task.attempt(agent, &mut known)? {
            Ok(how) => return Ok(Outcome::Done(how)),
            Err((stage, reason)) => {
                agent.note(format!("the door, attempt {attempt} failed ({stage:?}): {reason}"));
                last = (stage, reason);
            }
        }
    }
    Ok(Outcome::Failed(last.0, last.1))
}

struct Task<'a> {
    nav: &'a NavConfig,
    settings: &'a GraspSettings,
    door: &'a ClosedDoor,
}

impl Task<'_> {
    /// Looks and opens once. `known` is what an earlier push has shown of the way it opens.
    fn attempt(&self, agent: &mut Agent, known: &mut Option<Opens>) -> Result<Tried<String>, Halt> {
        agent.gaze = Gaze::AHEAD;
        let arrived = Drive::to_pose(self.nav, self.door.look_from).run(agent)?;
        if arrived != DriveOutcome::Arrived {
            return Ok(Err((Stage::Planning, format!("the way before the door failed: {arrived:?}"))));
        }
        let leaf = match self.look(agent)? {
            Ok(leaf) => leaf,
            Err(reason) => return Ok(Err((Stage::Mapping, reason))),
        };
        let opens = known.unwrap_or(leaf.opens);
        let radius_m = (leaf.handle.center.xy() - leaf.hinge).norm();
        let deep_mm = 1e3 * leaf.deep_m;
        agent.note(format!(
            "a closed door, its handle {radius_m:.2} m from its hinges, {deep_mm:.0} mm behind the wall: it opens {}",
            if opens == Opens::Away { "away, so push" } else { "this way, so pull" }
        ));
        match opens {
            Opens::Towards => {
                let pulled = self.pull(agent, &leaf)?;
                agent.swept.push(leaf.swept(opens));
                Ok(pulled)
            }
            Opens::Away => {
                let pushed = self.push(agent, &leaf)?;
                agent.swept.push(leaf.swept(opens));
                if let Ok(Shoved::HeldUp(angle_rad)) = pushed
                    && angle_rad < STUCK_RAD
                {
                    *known = Some(Opens::Towards);
                    let reason = "it does not give way to a push: it opens this way".to_owned();
                    return Ok(Err((Stage::Open, reason)));
                }
                Ok(pushed.map(|pushed| format!("pushed open by {:.0} degrees", pushed.angle_rad().to_degrees())))
            }
        }
    }

    /// The leaf as the head sees it from here, in the world frame.
    fn look(&self, agent: &mut Agent) -> Result<Result<Leaf, String>, Halt> {
        const FRAMES: usize = 5;
        let at = self.door.middle;
        let mut points = Vec::new();
        for height_m in [1.15, 0.7] {
            agent.gaze = Gaze::Point(Point3::new(at.x, at.y, height_m));
            agent.rest(Span::from_s(0.8))?;
            points.extend(gather(agent, "head", FRAMES)?);
        }
        let world_from_base = agent.world_from_base()?;
        let points: Vec<Point3<f64>> = points.iter().map(|p| world_from_base * p).collect();
        Ok(read_leaf(&points, &at, &self.door.normal, self.door.half_m))
    }

    /// Pulls the door open by its handle.
    fn pull(&self, agent: &mut Agent, leaf: &Leaf) -> Result<Tried<String>, Halt> {
        let towards = (leaf.hinge - leaf.handle.center.xy()).dot(&leaf.front.right().xy());
        // Hinged at the right it opens to the left, seen from above.
        let grabbed = Grabbed { handle: leaf.handle, hinge: Some((leaf.hinge, towards.signum())) };
        let (left_m, right_m) = leaf.front.right_m;
        let (middle, normal, half_m) = (leaf.middle(), leaf.front.normal, 0.5 * (right_m - left_m));
        let side = Side { middle, normal, half_m, depth_m: 0.1 };
        open_by(agent, self.nav, self.settings, (self.door.id, &self.door.bounds), (&grabbed, &side), PULL_RAD)
    }

    /// Pushes the door open with the closed hand, and backs off.
    fn push(&self, agent: &mut Agent, leaf: &Leaf) -> Result<Tried<Shoved>, Halt> {
        let leaf = *leaf;
        let (reach, approach, at) = match plan_on_ground(agent, self.nav, None, move |ground| plan_push(ground, &leaf))?
        {
            Ok(planned) => planned,
            Err(reason) => return Ok(Err((Stage::Planning, reason))),
        };
        let obstacles = |agent: &mut Agent| {
            let world_from_base = agent.world_from_base()?;
            Ok(find_obstacles(agent.map(), Some(&agent.live), &world_from_base, None))
        };
        let step_m_per_s = self.settings.step_speed_m_per_s;
        if let Err(failure) = come_to(agent, self.nav, &approach, "door", &at, step_m_per_s, obstacles)? {
            if failure.0 == Stage::Reach {
                retreat(agent)?;
            }
            return Ok(Err(failure));
        }
        if let Err(failure) = self.line_up(agent, &leaf, &reach, &at)? {
            retreat(agent)?;
            return Ok(Err(failure));
        }
        let model = agent.model().clone();
        let base_from_world = agent.world_from_base()?.inverse();
        let tool = model.kinematics.root_from_link(&agent.configuration()?, model.tool);
        let seen = leaf.moved(&base_from_world);
        // Hinged at the left it turns to the left.
        let sense = if seen.hinge.y > tool.translation.y { 1.0 } else { -1.0 };
        let arc = Arc::from_tool(seen.hinge, sense, &tool, model.settings.gripper.tip_beyond_tool_m);
        let wanted_rad = PUSH_RAD + BEFORE_M / arc.radius_m();
        let pushed = shove(agent, &arc, (BEFORE_M, wanted_rad), &finger_links(&model))?;
        agent.note(format!("{pushed:?}"));
        if !withdraw(agent, &approach)? {
            return Ok(Err((Stage::Reach, "the arm does not fold again before the door".into())));
        }
        // From near, the floor where the leaf stood is not seen well enough to be taken for free.
        back_off(agent, LOOK_BACK_M, LOOK_BACK_M_PER_S)?;
        Ok(Ok(pushed))
    }

    /// Turns towards the leaf, holds the closed hand ahead and drives on until it is right before it.
    fn line_up(&self, agent: &mut Agent, leaf: &Leaf, reach: &Reach, at: &Point3<f64>) -> Result<Tried<()>, Halt> {
        agent.grip(0.0, 10.0);
        let way = agent.world_from_base()?.inverse() * -leaf.front.normal;
        turn(agent, way.y.atan2(way.x))?;
        let world_from_base = agent.world_from_base()?;
        let here = world_from_base.inverse() * at;
        let tip_m = agent.model().settings.gripper.tip_beyond_tool_m;
        let mut grip = reach.base_from_grip;
        let left_m = here.x - tip_m - grip.translation.x;
        (grip.translation.y, grip.translation.z) = (here.y, here.z);
        let obstacles = find_obstacles(agent.map(), Some(&agent.live), &world_from_base, None);
        let back_m = (WRIST_LOOK_M - left_m).clamp(0.0, WRIST_LOOK_M);
        let before = Translation3::new(-back_m, 0.0, 0.0) * grip;
        if let Err(failure) = pose_before(agent, self.settings, before, reach, &obstacles, "the door")? {
            return Ok(Err(failure));
        }
        let model = agent.model().clone();
        let tool = model.kinematics.root_from_link(&agent.configuration()?, model.tool);
        let here = agent.world_from_base()?.inverse() * at;
        creep(agent, here.x - tip_m - tool.translation.x - BEFORE_M, 0.08)?;
        Ok(Ok(()))
    }
}

/// Backs off to where the arm unfolded and folds it there the way that it came: in a doorway it has no room to. Whether it is
/// folded then.
fn withdraw(agent: &mut Agent, approach: &Approach) -> Result<bool, Halt> {
    /// What touches on the way back ends it early, this often at most; so near is there, metres.
    const TRIES: usize = 2;
    const NEAR_M: f64 = 0.03;
    const SPEED_M_PER_S: f64 = 0.15;
    let unfold_at = &approach.unfold_at;
    let ahead = Vector2::new(unfold_at.yaw_rad.cos(), unfold_at.yaw_rad.sin());
    for _ in 0..TRIES {
        let here = Pose2::from_pose(&agent.world_from_base()?).position;
        let left_m = (here - unfold_at.position).dot(&ahead);
        if left_m > NEAR_M {
            creep(agent, -left_m, SPEED_M_PER_S)?;
        }
    }
    let around = |agent: &mut Agent| -> Result<Vec<Obstacle>, Halt> {
        let world_from_base = agent.world_from_base()?;
        let mut obstacles = find_obstacles(agent.map(), Some(&agent.live), &world_from_base, None);
        let (model, configuration) = (agent.model().clone(), agent.configuration()?);
        leave_out_overlaps(&model, &configuration, &mut obstacles);
        Ok(obstacles)
    };
    let folded = agent.model().find_posture(FOLDED);
    let way: Vec<JointPositions> = approach.postures.iter().rev().cloned().chain(folded.clone()).collect();
    let obstacles = around(agent)?;
    move_through(agent, &way, &obstacles)?;
    if is_folded(agent)? {
        return Ok(true);
    }
    retreat(agent)?;
    if let (false, Some(folded)) = (is_folded(agent)?, folded) {
        let obstacles = around(agent)?;
        move_joints_around(agent, &folded, &obstacles)?;
    }
    is_folded(agent)
}

/// Whether the arm is within the footprint, as far as it ever is.
fn is_folded(agent: &mut Agent) -> Result<bool, Halt> {
    let configuration = agent.configuration()?;
    let model = agent.model();
    Ok(model.radius_m(&configuration) <= model.settings.base.footprint_radius_m + FOLDED_M)
}

/// Where to stand and how to reach to push a leaf open, the way there, and where on the leaf to push.
fn plan_push(ground: &Ground<'_>, leaf: &Leaf) -> Result<(Reach, Approach, Point3<f64>), String> {
    let &Ground { model, costmap, field, folded, .. } = ground;
    let normal = leaf.front.normal.xy();
    let yaw_rad = (-normal.y).atan2(-normal.x);
    let is_place = |p: &Point2<f64>| costmap.is_traversable_at(p) && field.find_length_to_m(p).is_some();
    let along = (leaf.handle.center.xy() - leaf.hinge).normalize();
    let handle_m = (leaf.handle.center.xy() - leaf.hinge).dot(&along);
    let mut reached = 0;
    for from_m in PUSH_FROM_M {
        // In the middle of the doorway: the base drives into it.
        let stand = leaf.middle() + normal * from_m;
        let unfolds = UNFOLD_BACK_M.iter().map(|back_m| Pose2 { position: stand + normal * *back_m, yaw_rad });
        let unfolds: Vec<Pose2> = unfolds.filter(|place| is_place(&place.position)).collect();
        if unfolds.is_empty() {
            continue;
        }
        let base_from_world = Pose2 { position: stand, yaw_rad }.to_pose().inverse();
        let places = BESIDE_HANDLE_M.iter().flat_map(|by_m| PUSH_AT_M.map(|z| (handle_m - by_m, z)));
        let found = places.into_iter().find_map(|(radius_m, z)| {
            let at = leaf.hinge + along * radius_m;
            let at = Point3::new(at.x, at.y, z);
            reach_arc(model, folded, leaf, &base_from_world, &at).map(|reach| (reach, at))
        });
        let Some((reach, at)) = found else { continue };
        reached += 1;
        let approach = unfolds.iter().find_map(|unfold_at| {
            let stands = [*unfold_at];
            let swept = find_approaches(ground, &stands, 0.0, 1).into_iter().next();
            swept.or_else(|| find_approach_around(ground, &stands, 0.0))
        });
        if let Some(approach) = approach {
            return Ok((reach, approach, at));
        }
    }
    Err(format!("no way to any of {reached} places from which the arm can push the door open"))
}

/// How the arm reaches a place on a leaf, when it can go on from there until the door is open.
fn reach_arc(
    model: &RobotModel,
    folded: &Configuration,
    leaf: &Leaf,
    base_from_world: &Pose,
    at: &Point3<f64>,
) -> Option<Reach> {
    const STEPS: u32 = 4;
    let tip_m = model.settings.gripper.tip_beyond_tool_m;
    let tip = base_from_world * at;
    let hinge = leaf.moved(base_from_world).hinge;
    let sense = if hinge.y > tip.y { 1.0 } else { -1.0 };
    hands_ahead().into_iter().find_map(|rotation| {
        let grip = Pose::from_parts((tip - Vector3::x() * tip_m).coords.into(), rotation);
        let (joints, before) = reaches(model, folded, &grip)?;
        let arc = Arc::from_tool(hinge, sense, &grip, tip_m);
        let mut last = joints;
        for step in 1..=STEPS {
            let angle_rad = PUSH_RAD * f64::from(step) / f64::from(STEPS);
            let goal = Translation3::new(-arc.base_at_m(angle_rad), 0.0, 0.0) * arc.tool_at(angle_rad);
            let mut start = folded.clone();
            start.apply(&last);
            last = find_ik(model, &goal, &IkRequest { restarts: 0, ..IkRequest::new(&start) })?;
        }
        Some(Reach { swing_rad: PUSH_RAD, base_from_grip: grip, joints: before })
    })
}
