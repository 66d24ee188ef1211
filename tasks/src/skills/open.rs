//! Opening drawers and doors: look at the front, find the handle by its shape, hold it, pull or swing it while the base backs
//! off, let go.

use super::Outcome;
use super::approach::{come_to, plan_on_ground};
use super::arm::{ArmOutcome, STUCK_AFTER, ToolMove, move_tool, move_tool_around};
use super::carcass::find_whole;
use super::drive::{Drive, DriveOutcome};
use super::front_places::{Reach, WRIST_LOOK_M, nearest_roll, places_to_look, plan_reach};
use super::fronts::{Expected, Grabbed, Side, choose_handle, find_hinge, gather, moved, read_front};
use super::grasp::{GraspSettings, finger_links};
use super::hold::close;
use super::inside::OpenDrawer;
use super::obstacles::find_obstacles;
use super::pull::{Pulled, creep, pull, turn};
use super::retreat::retreat;
use super::swing::{Hinge, swing};
use crate::agent::{Agent, Gaze, Halt};
use crate::summary::Stage;
use dsm::Pose;
use dsm::geometry::OrientedBox;
use dsm::ground::Part;
use dsm::map::ObjectId;
use dsm::time::Span;
use dsm_robot::grasp::{Front, Handle};
use dsm_robot::model::Obstacle;
use dsm_robot::nav::{Costmap, Field, NavConfig, Pose2};
use nalgebra::{Point3, Translation3};

/// Attempts before the skill gives up.
const MAX_ATTEMPTS: usize = 2;
/// Before the handle the fingers line up, metres.
const BEFORE_M: f64 = 0.1;
/// Grip on a handle, newtons: with friction of 0.6 on either side it slips at 36 N, before anything is pressed with 60 N.
const GRIP_N: f64 = 30.0;
/// What the fingers hold between these widths is a bar, metres.
const BAR_M: (f64, f64) = (0.006, 0.035);
/// The hand opens to no more than this around a bar, metres: others may be near.
const OPENING_M: f64 = 0.08;
/// Share of its depth by which furniture lets its drawers out: three quarters is what plain runners do.
const EXTENSION: f64 = 0.75;
/// ... between these bounds, metres: how deep furniture is that was seen from the front alone is not known, and what lies far
/// back is only seen when the drawer is all out. Its end holds the hand, which slips before it presses.
const WAY_M: (f64, f64) = (0.42, 0.45);
/// The hand backs out so far before it moves otherwise, metres: fingers are around a bar by 5 cm.
const BACK_OUT_M: f64 = 0.16;
/// A pull that ends sooner has opened nothing, metres.
const LEAST_WAY_M: f64 = 0.1;
/// A hand that looks this much ahead comes off a handle when the base backs: the cosine of 15 degrees.
const STRAIGHT: f64 = 0.966;
/// A door is swung so far, radians: things are taken out past it.
const SWING_RAD: f64 = 1.15;
/// Radius of a handle about its hinge between these bounds, metres: doors of cupboards and wardrobes.
const RADIUS_M: (f64, f64) = (0.15, 0.9);

type Tried<T> = Result<T, (Stage, String)>;

/// Opens a drawer of an object; `part` says which.
pub fn open(
    agent: &mut Agent,
    nav: &NavConfig,
    settings: &GraspSettings,
    id: ObjectId,
    part: Part,
) -> Result<(Outcome, Option<OpenDrawer>), Halt> {
    let Some((_, bounds)) = find_whole(agent.map(), id) else {
        return Ok((Outcome::Failed(Stage::Mapping, format!("object {} left the map", id.0)), None));
    };
    let mut last = (Stage::Planning, "no attempt was made".to_owned());
    for attempt in 0..MAX_ATTEMPTS {
        let task = Task { nav, settings, id, bounds, part, wanted_rad: SWING_RAD };
        match task.attempt(agent)? {
            Ok((reason, drawer)) => return Ok((Outcome::Done(reason), drawer)),
            Err((stage, reason)) => {
                agent.note(format!("opening, attempt {attempt} failed ({stage:?}): {reason}"));
                last = (stage, reason);
                if stage == Stage::Planning || stage == Stage::Mapping {
                    break;
                }
                // The hand may be before what it must not lift.
                creep(agent, -BACK_OUT_M, 0.1)?;
                retreat(agent)?;
            }
        }
    }
    Ok((Outcome::Failed(last.0, last.1), None))
}

/// Opens once, by a handle that was seen (world frame), a door by `wanted_rad`; how far it came, in words.
pub(super) fn open_by(
    agent: &mut Agent,
    nav: &NavConfig,
    settings: &GraspSettings,
    (id, bounds): (ObjectId, &OrientedBox),
    (target, side): (&Grabbed, &Side),
    wanted_rad: f64,
) -> Result<Tried<String>, Halt> {
    let task = Task { nav, settings, id, bounds: *bounds, part: Part::default(), wanted_rad };
    let opened = task.open_seen(agent, target, side)?.map(|(how, _)| how);
    if opened.is_err() {
        // The hand may be before what it must not lift.
        creep(agent, -BACK_OUT_M, 0.1)?;
        retreat(agent)?;
    }
    Ok(opened)
}

/// What is to be opened.
struct Task<'a> {
    nav: &'a NavConfig,
    settings: &'a GraspSettings,
    id: ObjectId,
    bounds: OrientedBox,
    part: Part,
    /// How far a door is swung, radians.
    wanted_rad: f64,
}

impl Task<'_> {
    fn attempt(&self, agent: &mut Agent) -> Result<Tried<(String, Option<OpenDrawer>)>, Halt> {
        match self.find_handle(agent)? {
            Ok((target, side)) => self.open_seen(agent, &target, &side),
            Err(failure) => Ok(Err(failure)),
        }
    }

    /// Holds the handle that was seen and opens what it belongs to.
    fn open_seen(
        &self,
        agent: &mut Agent,
        target: &Grabbed,
        side: &Side,
    ) -> Result<Tried<(String, Option<OpenDrawer>)>, Halt> {
        let (handle, kind) = (&target.handle, if target.hinge.is_some() { "door" } else { "drawer" });
        let (long_mm, at_m) = (1e3 * handle.length_m, handle.center.z);
        agent.note(format!("the handle of a {kind}, {long_mm:.0} mm long at {at_m:.2} m height"));
        let reach = match self.come_before(agent, target)? {
            Ok(reach) => reach,
            Err(failure) => return Ok(Err(failure)),
        };
        let held = match self.line_up(agent, handle, &reach)? {
            Ok(handle) => handle,
            Err(failure) => return Ok(Err(failure)),
        };
        if let Err(failure) = self.hold(agent, &held, &reach)? {
            return Ok(Err(failure));
        }
        let (pulled, open) = self.move_part(agent, target, &held, side)?;
        agent.note(format!("{open}: {pulled:?}"));
        self.let_go(agent)?;
        if pulled.way_m() < LEAST_WAY_M {
            return Ok(Err((Stage::Hold, format!("it gave way by {:.0} mm only: {pulled:?}", 1e3 * pulled.way_m()))));
        }
        retreat(agent)?;
        let out_m = pulled.way_m();
        let drawer = target.hinge.is_none().then_some(OpenDrawer { handle: *handle, out_m, half_m: side.half_m });
        Ok(Ok((open, drawer)))
    }

    /// Pulls the drawer or swings the door that the hand holds.
    fn move_part(
        &self,
        agent: &mut Agent,
        target: &Grabbed,
        held: &Handle,
        side: &Side,
    ) -> Result<(Pulled, String), Halt> {
        let fingers = finger_links(agent.model());
        let Some((hinge, sense)) = target.hinge else {
            let wanted_m = (EXTENSION * side.depth_m).clamp(WAY_M.0, WAY_M.1);
            let pulled = pull(agent, &held.normal, wanted_m, &fingers)?;
            return Ok((pulled, format!("opened by {:.2} m", pulled.way_m())));
        };
        // Where the hinge is to the handle was seen from before; where the handle is, from near.
        let base_from_world = agent.world_from_base()?.inverse();
        let off = base_from_world.rotation * (Point3::new(hinge.x, hinge.y, 0.0) - target.handle.center);
        let right = nalgebra::Vector3::z().cross(&held.normal).xy();
        let along = right * right.dot(&off.xy()).signum();
        let hinge = Hinge { at: held.center.xy() + off.xy(), along, sense };
        let (pulled, angle_rad) = swing(agent, &hinge, self.wanted_rad, &fingers)?;
        Ok((pulled, format!("opened by {:.0} degrees", angle_rad.to_degrees())))
    }

    /// Drives before one side after the other until one shows the handle; it in the world frame.
    fn find_handle(&self, agent: &mut Agent) -> Result<Tried<(Grabbed, Side)>, Halt> {
        let (map, nav, bounds) = (agent.map().clone(), self.nav.clone(), self.bounds);
        let start = Pose2::from_pose(&agent.world_from_base()?).position;
        let places = agent.plan(move || {
            let costmap = Costmap::from_free_space(&map.free_space, &nav.costmap);
            let field = Field::from_start(&costmap, &start);
            places_to_look(&map, &bounds, &costmap, &field)
        })?;
        if places.is_empty() {
            return Ok(Err((Stage::Planning, "no place before it can be reached".into())));
        }
        let mut seen = 0;
        for (side, place) in places {
            agent.gaze = Gaze::AHEAD;
            let driven = Drive::to_pose(self.nav, place).run(agent)?;
            if driven != DriveOutcome::Arrived {
                agent.note(format!("a side cannot be looked at: {driven:?}"));
                continue;
            }
            let Some((front, handles)) = self.look(agent, &side)? else { continue };
            seen += handles.len();
            let world_from_base = agent.world_from_base()?;
            if let Some(handle) = choose_handle(&handles, self.part) {
                let hinge = find_hinge(&front, &handles, &handle);
                let hinge = hinge.filter(|(at, _)| {
                    let radius_m = (at - handle.center.xy()).norm();
                    (RADIUS_M.0..RADIUS_M.1).contains(&radius_m)
                });
                let in_world = |(at, sense): (nalgebra::Point2<f64>, f64)| {
                    ((world_from_base * Point3::new(at.x, at.y, 0.0)).xy(), sense)
                };
                let handle = moved(&handle, &world_from_base);
                return Ok(Ok((Grabbed { handle, hinge: hinge.map(in_world) }, side)));
            }
        }
        Ok(Err((Stage::Mapping, format!("no such handle is seen; {seen} others are"))))
    }

    /// A side as the head sees it: its front and the handles, in the frame of the base.
    fn look(&self, agent: &mut Agent, side: &Side) -> Result<Option<(Front, Vec<Handle>)>, Halt> {
        const FRAMES: usize = 6;
        /// Handles higher than this are out of reach, metres.
        const HIGHEST_M: f64 = 1.2;
        let top_m = self.bounds.top_m().min(HIGHEST_M);
        let mut points = Vec::new();
        for share in [0.7, 0.3] {
            agent.gaze = Gaze::Point(Point3::new(side.middle.x, side.middle.y, share * top_m));
            agent.rest(Span::from_s(0.8))?;
            points.extend(gather(agent, "head", FRAMES)?);
        }
        let world_from_base = agent.world_from_base()?;
        let expected = Expected::side(side, &world_from_base);
        let found = read_front(&points, &self.bounds, &world_from_base, &expected);
        agent.note(match &found {
            Some((front, handles)) => {
                format!("a front of {:.2} m with {} handles", front.right_m.1 - front.right_m.0, handles.len())
            }
            None => "no front is seen".into(),
        });
        Ok(found)
    }

    /// Drives before the handle and unfolds the arm there; the hand ends before the handle, a step back.
    fn come_before(&self, agent: &mut Agent, target: &Grabbed) -> Result<Tried<Reach>, Halt> {
        let (handle, target, wanted_rad) = (target.handle, *target, self.wanted_rad);
        let planned = plan_on_ground(agent, self.nav, None, move |ground| plan_reach(ground, &target, wanted_rad))?;
        let (reach, approach) = match planned {
            Ok(planned) => planned,
            Err(reason) => return Ok(Err((Stage::Reach, reason))),
        };
        if target.hinge.is_some() {
            agent.log(format!("the arm can swing the door by {:.2} rad from there", reach.swing_rad));
        }
        let obstacles = |agent: &mut Agent| {
            let world_from_base = agent.world_from_base()?;
            Ok(find_obstacles(agent.map(), Some(&agent.live), &world_from_base, None))
        };
        let step_m_per_s = self.settings.step_speed_m_per_s;
        if let Err(failure) = come_to(agent, self.nav, &approach, "handle", &handle.center, step_m_per_s, obstacles)? {
            return Ok(Err(failure));
        }
        Ok(Ok(reach))
    }

    /// Brings the hand before the handle: turns square to the front, poses the arm, drives the last step, and looks with the
    /// wrist camera. The handle in the frame of the base.
    fn line_up(&self, agent: &mut Agent, expected: &Handle, reach: &Reach) -> Result<Tried<Handle>, Halt> {
        const FRAMES: usize = 5;
        const NEAR_M: f64 = 0.1;
        // Square to the front. The arm hides it from the head by now: what was seen before must do.
        let at = moved(expected, &agent.world_from_base()?.inverse());
        turn(agent, (-at.normal.y).atan2(-at.normal.x))?;
        let near = moved(expected, &agent.world_from_base()?.inverse());
        // The arm, a step back from where it will hold: what is left of the way is driven.
        let left_m = near.center.x - reach.base_from_grip.translation.x;
        let tip_m = agent.model().settings.gripper.tip_beyond_tool_m;
        let grip = nearest_roll(&near.grips(tip_m), &reach.base_from_grip);
        let before = Translation3::new(-left_m, 0.0, 0.0) * grip * Translation3::new(0.0, 0.0, -WRIST_LOOK_M);
        let world_from_base = agent.world_from_base()?;
        let obstacles = find_obstacles(agent.map(), Some(&agent.live), &world_from_base, None);
        agent.grip(OPENING_M, 10.0);
        if let Err(failure) = pose_before(agent, self.settings, before, reach, &obstacles, "the handle")? {
            return Ok(Err(failure));
        }
        creep(agent, left_m, 0.1)?;
        // From here on nothing moves but the arm.
        for look in 0..3 {
            if let Some(handle) = self.find_near(agent, expected, "wrist", FRAMES, NEAR_M)? {
                agent.log(format!("the wrist camera finds the handle in look {look}"));
                return Ok(Ok(handle));
            }
        }
        // The head's eyes must do.
        Ok(match self.find_near(agent, expected, "head", FRAMES, NEAR_M)? {
            Some(handle) => Ok(handle),
            None => Err((Stage::Grasp, "the handle is not seen from near".into())),
        })
    }

    /// The handle of the newest frames that is nearest to where it is expected (world frame), in the frame of the base.
    fn find_near(
        &self,
        agent: &mut Agent,
        expected: &Handle,
        camera: &str,
        frames: usize,
        near_m: f64,
    ) -> Result<Option<Handle>, Halt> {
        let points = gather(agent, camera, frames)?;
        let world_from_base = agent.world_from_base()?;
        let at = moved(expected, &world_from_base.inverse());
        let Some((_, handles)) = read_front(&points, &self.bounds, &world_from_base, &Expected::of(&at)) else {
            agent.log(format!("the {camera} camera sees no front"));
            return Ok(None);
        };
        let away_m = |handle: &Handle| (handle.center - at.center).norm();
        let same = handles.iter().filter(|handle| handle.is_upright() == at.is_upright());
        let nearest = same.min_by(|a, b| away_m(a).total_cmp(&away_m(b))).copied();
        agent.log(format!(
            "the {camera} camera sees {} handles, the nearest {:.0} mm from where it was",
            handles.len(),
            nearest.map_or(f64::NAN, |handle| 1e3 * away_m(&handle))
        ));
        Ok(nearest.filter(|handle| away_m(handle) < near_m))
    }

    /// Puts the fingers around the handle and closes them.
    fn hold(&self, agent: &mut Agent, handle: &Handle, reach: &Reach) -> Result<Tried<()>, Halt> {
        let fingers = finger_links(agent.model());
        let tip_m = agent.model().settings.gripper.tip_beyond_tool_m;
        let grip = nearest_roll(&handle.grips(tip_m), &reach.base_from_grip);
        let world_from_base = agent.world_from_base()?;
        // The handle stands out of what the map holds: what is seen there is to be held.
        let obstacles = find_obstacles(agent.map(), None, &world_from_base, Some(self.id));
        for back_m in [BEFORE_M, 0.0] {
            let motion = ToolMove {
                goal: grip * Translation3::new(0.0, 0.0, -back_m),
                obstacles: &obstacles,
                touching: &fingers,
                speed_m_per_s: self.settings.approach_speed_m_per_s,
                posture: Some(&reach.joints),
                give_up_after: STUCK_AFTER,
                gentle: false,
                clearance_m: Some(self.settings.planner.clearance_m),
            };
            if let ArmOutcome::Stuck { error_m, error_rad } = move_tool(agent, &motion)?
                && (error_m > 0.012 || error_rad > 0.1)
            {
                return Ok(Err((Stage::Reach, format!("stuck {error_m:.3} m, {error_rad:.2} rad at the handle"))));
            }
        }
        let gentle = GraspSettings { grip_force_n: GRIP_N, ..self.settings.clone() };
        let width_m = close(agent, &gentle)?;
        agent.note(format!("{:.0} mm between the fingers", 1e3 * width_m));
        if !(BAR_M.0..=BAR_M.1).contains(&width_m) {
            return Ok(Err((Stage::Grasp, format!("{:.0} mm between the fingers are no handle", 1e3 * width_m))));
        }
        Ok(Ok(()))
    }

    /// Opens the hand, and takes it off the handle the way it looks: first with the arm, then with the base.
    fn let_go(&self, agent: &mut Agent) -> Result<(), Halt> {
        agent.grip(OPENING_M, 10.0);
        agent.rest(Span::from_s(0.8))?;
        let (model, configuration) = (agent.model().clone(), agent.configuration()?);
        let base_from_tool = model.kinematics.root_from_link(&configuration, model.tool);
        let ahead = base_from_tool.rotation * nalgebra::Vector3::z();
        if ahead.x < STRAIGHT {
            let fingers = finger_links(&model);
            let off = ToolMove {
                goal: base_from_tool * Translation3::new(0.0, 0.0, -BEFORE_M),
                obstacles: &[],
                touching: &fingers,
                speed_m_per_s: self.settings.approach_speed_m_per_s,
                posture: None,
                give_up_after: STUCK_AFTER,
                gentle: false,
                clearance_m: None,
            };
            move_tool(agent, &off)?;
        }
        creep(agent, -BACK_OUT_M, 0.1)?;
        Ok(())
    }
}

/// Poses the arm before what it is to hold or push, `goal` in the frame of the base; a little off is good enough, for what
/// follows is guided by looking.
pub(super) fn pose_before(
    agent: &mut Agent,
    settings: &GraspSettings,
    goal: Pose,
    reach: &Reach,
    obstacles: &[Obstacle],
    what: &str,
) -> Result<Tried<()>, Halt> {
    let motion = ToolMove {
        goal,
        obstacles,
        touching: &[],
        speed_m_per_s: settings.free_speed_m_per_s,
        posture: Some(&reach.joints),
        give_up_after: STUCK_AFTER,
        gentle: false,
        clearance_m: None,
    };
    Ok(match move_tool_around(agent, &motion, (0.05, 0.2))? {
        ArmOutcome::Stuck { error_m, error_rad } if error_m > 0.05 || error_rad > 0.2 => {
            Err((Stage::Reach, format!("stuck {error_m:.3} m, {error_rad:.2} rad before {what}")))
        }
        _ => Ok(()),
    })
}
