//! Closing drawers and doors: look what stands open, push it to with the closed hand while the base follows, until it holds,
//! and look again.

use super::Outcome;
use super::ajar::{Ajar, Stand, read_stand};
use super::approach::{Approach, Ground, come_to, find_approach_around, find_approaches, plan_on_ground};
use super::carcass::{find_carcass, find_whole};
use super::drive::{Drive, DriveOutcome};
use super::front_places::{Reach, WRIST_LOOK_M, places_to_look, reaches};
use super::fronts::{Side, gather};
use super::grasp::{GraspSettings, finger_links};
use super::inside::OpenDrawer;
use super::obstacles::find_obstacles;
use super::open::pose_before;
use super::pull::{creep, turn};
use super::push::{Push, push};
use super::retreat::retreat;
use crate::agent::{Agent, Gaze, Halt};
use crate::summary::Stage;
use dsm::Pose;
use dsm::geometry::OrientedBox;
use dsm::ground::{Part, PartKind};
use dsm::map::{CellState, Map, ObjectId};
use dsm::time::Span;
use dsm_robot::grasp::Handle;
use dsm_robot::nav::{Costmap, Field, NavConfig, Pose2};
use nalgebra::{Point2, Point3, Translation3, UnitQuaternion, Vector3};
use std::collections::BTreeSet;

/// Pushes before the skill gives up.
const MAX_PUSHES: usize = 4;
/// Distances of the base from where it pushes, the best first, metres.
const PUSH_FROM_M: [f64; 6] = [0.62, 0.66, 0.58, 0.7, 0.54, 0.5];
/// Room in which the arm unfolds, behind the place to push from, metres.
const UNFOLD_BACK_M: [f64; 4] = [0.35, 0.25, 0.45, 0.15];
/// The hand stops so far before what it pushes, metres: what localisation and looks are off.
const BEFORE_M: f64 = 0.06;
/// What is nearer than expected by more is not what is to be pushed, metres.
const SURPRISE_M: f64 = 0.08;
/// A part may go on for so much longer than it looks, metres.
const FARTHER_M: f64 = 0.08;
/// What was pushed to until it held, all of the way but this, and seems to stand out by no more than that, is closed, metres:
/// a push into what does not give way presses on it.
const LOOKS_OFF_M: f64 = 0.04;
const NEARLY_M: f64 = 0.1;
/// Backs off so far before the arm moves otherwise, metres.
const BACK_OUT_M: f64 = 0.16;
/// Places from which what was pushed to is looked at again.
const LOOKS_AFTER: usize = 2;
/// Handles and edges higher than this are not looked for, metres.
const HIGHEST_M: f64 = 1.35;
/// Distance from a side for a look, and how far aside of its middle, metres: a door that leans out is seen from its hinge's
/// side.
const LOOK_M: [f64; 3] = [1.25, 1.1, 1.4];
const ASIDE_M: [f64; 5] = [0.0, 0.55, -0.55, 0.9, -0.9];

type Tried<T> = Result<T, (Stage, String)>;

/// Closes a door or drawer of an object; `part` says which. What the map knows to lie in a drawer goes with it: `stowed` gets
/// it.
pub fn close(
    agent: &mut Agent,
    nav: &NavConfig,
    settings: &GraspSettings,
    id: ObjectId,
    part: Part,
    stowed: &mut BTreeSet<ObjectId>,
) -> Result<Outcome, Halt> {
    let whole = find_whole(agent.map(), id);
    let Some(bounds) = whole.map(|(points, bounds)| find_carcass(&points, &bounds, &agent.map().free_space)) else {
        return Ok(Outcome::Failed(Stage::Mapping, format!("object {} left the map", id.0)));
    };
    let task = Task { nav, settings, bounds, part };
    let mut way_m = 0.0;
    let mut left_m = f64::INFINITY;
    for pushes in 0..=MAX_PUSHES {
        let (stand, side) = match task.look_around(agent, if pushes == 0 { usize::MAX } else { LOOKS_AFTER })? {
            Ok(seen) => seen,
            Err(failure) if pushes == 0 || failure.0 != Stage::Mapping => {
                return Ok(Outcome::Failed(failure.0, failure.1));
            }
            // What is closed may show neither handle nor edge.
            Err(_) => return Ok(Outcome::Done(format!("pushed to by {way_m:.2} m; nothing stands out any more"))),
        };
        let Stand::Open(ajar) = stand else {
            let how = if pushes == 0 { "it is closed already".to_owned() } else { format!("closed by {way_m:.2} m") };
            return Ok(Outcome::Done(how));
        };
        if left_m < LOOKS_OFF_M && ajar.way_m < NEARLY_M {
            return Ok(Outcome::Done(format!("closed by {way_m:.2} m, until it held")));
        }
        if pushes == MAX_PUSHES {
            let reason = format!("still open by {:.2} m after {MAX_PUSHES} pushes", ajar.way_m);
            return Ok(Outcome::Failed(Stage::Open, reason));
        }
        agent.note(format!("a {:?} stands open by {:.2} m", ajar.kind, ajar.way_m));
        let load: Vec<ObjectId> = match ajar.kind {
            PartKind::Drawer => drawer_of(&ajar, &side).contents(agent.map()),
            PartKind::Door => Vec::new(),
        };
        stowed.extend(load.iter().copied().filter(|other| *other != id));
        match task.push_to(agent, &ajar, &side, &load)? {
            Ok(pushed_m) => {
                way_m += pushed_m;
                left_m = ajar.way_m - pushed_m;
            }
            Err((stage, reason)) => {
                agent.note(format!("closing, push {pushes} failed ({stage:?}): {reason}"));
                if stage == Stage::Planning || pushes + 1 == MAX_PUSHES {
                    return Ok(Outcome::Failed(stage, reason));
                }
            }
        }
        retreat(agent)?;
    }
    Ok(Outcome::Failed(Stage::Open, "no push was made".into()))
}

/// The drawer that stands open there.
fn drawer_of(ajar: &Ajar, side: &Side) -> OpenDrawer {
    /// Handles stand so far off their fronts, and are so thick, metres; their length does not matter here.
    const OFF_M: f64 = 0.04;
    const THICK_M: f64 = 0.015;
    let along = Vector3::z().cross(&ajar.way);
    let center = ajar.at + ajar.way * ajar.way_m;
    let handle = Handle { center, along, length_m: 0.12, thick_m: THICK_M, off_m: OFF_M, normal: -ajar.way };
    OpenDrawer { handle, out_m: ajar.way_m, half_m: side.half_m }
}

/// What is to be closed.
struct Task<'a> {
    nav: &'a NavConfig,
    settings: &'a GraspSettings,
    bounds: OrientedBox,
    part: Part,
}

impl Task<'_> {
    /// Drives before one side after the other, and from one end of it to the other, until one shows how the part stands. In
    /// the world frame. From `most` places of a side at most.
    fn look_around(&self, agent: &mut Agent, most: usize) -> Result<Tried<(Stand, Side)>, Halt> {
        let (map, nav, bounds) = (agent.map().clone(), self.nav.clone(), self.bounds);
        let start = Pose2::from_pose(&agent.world_from_base()?).position;
        let places = agent.plan(move || {
            let costmap = Costmap::from_free_space(&map.free_space, &nav.costmap);
            let field = Field::from_start(&costmap, &start);
            let sides = places_to_look(&map, &bounds, &costmap, &field);
            sides
                .into_iter()
                .map(|(side, place)| (side, places_before(&side, place, &costmap, &field)))
                .collect::<Vec<_>>()
        })?;
        if places.is_empty() {
            return Ok(Err((Stage::Planning, "no place before it can be reached".into())));
        }
        for (side, places) in places {
            let mut closed = None;
            for place in places.into_iter().take(most) {
                agent.gaze = Gaze::AHEAD;
                if Drive::to_pose(self.nav, place).run(agent)? != DriveOutcome::Arrived {
                    continue;
                }
                match self.look(agent, &side)? {
                    Stand::Open(ajar) => return Ok(Ok((Stand::Open(ajar), side))),
                    Stand::Closed => closed = Some((Stand::Closed, side)),
                    Stand::Unseen => {}
                }
                // A drawer is seen from before; a door that leans out may hide behind its own edge.
                if closed.is_some() && self.part.kind == Some(PartKind::Drawer) {
                    break;
                }
            }
            if let Some(closed) = closed {
                return Ok(Ok(closed));
            }
        }
        Ok(Err((Stage::Mapping, "nothing that stands open is seen".into())))
    }

    /// How the part stands as the head sees it from here, in the world frame.
    fn look(&self, agent: &mut Agent, side: &Side) -> Result<Stand, Halt> {
        const FRAMES: usize = 5;
        let top_m = self.bounds.top_m().min(HIGHEST_M);
        let mut points = Vec::new();
        for share in [0.75, 0.35] {
            agent.gaze = Gaze::Point(Point3::new(side.middle.x, side.middle.y, share * top_m));
            agent.rest(Span::from_s(0.8))?;
            points.extend(gather(agent, "head", FRAMES)?);
        }
        let world_from_base = agent.world_from_base()?;
        let points: Vec<Point3<f64>> = points.iter().map(|p| world_from_base * p).collect();
        let stand = read_stand(&points, side, top_m, self.part);
        agent.note(match stand {
            Stand::Open(ajar) => format!("a {:?} stands out by {:.2} m", ajar.kind, ajar.way_m),
            Stand::Closed => "what is seen is closed".into(),
            Stand::Unseen => "no front is seen".into(),
        });
        Ok(stand)
    }

    /// Comes before what stands open, pushes it to, and backs off; how far it went, metres.
    fn push_to(&self, agent: &mut Agent, ajar: &Ajar, side: &Side, load: &[ObjectId]) -> Result<Tried<f64>, Halt> {
        let (ajar, side) = (*ajar, *side);
        let planned = plan_on_ground(agent, self.nav, None, move |ground| plan_push(ground, &ajar, &side))?;
        let (reach, approach) = match planned {
            Ok(planned) => planned,
            Err(reason) => return Ok(Err((Stage::Planning, reason))),
        };
        let obstacles = |agent: &mut Agent| {
            let world_from_base = agent.world_from_base()?;
            Ok(find_obstacles(agent.map(), Some(&agent.live), &world_from_base, None))
        };
        let step_m_per_s = self.settings.step_speed_m_per_s;
        if let Err(failure) = come_to(agent, self.nav, &approach, "open part", &ajar.at, step_m_per_s, obstacles)? {
            return Ok(Err(failure));
        }
        if let Err(failure) = self.line_up(agent, &ajar, &reach)? {
            return Ok(Err(failure));
        }
        let fingers = finger_links(agent.model());
        let expected_m = ajar.way_m + BEFORE_M;
        let task = Push { before_m: BEFORE_M, expected_m, most_m: expected_m + FARTHER_M, load };
        let pushed = push(agent, &task, &fingers)?;
        agent.note(format!("{pushed:?}"));
        creep(agent, -BACK_OUT_M, 0.1)?;
        Ok(Ok((pushed.way_m() - BEFORE_M).max(0.0)))
    }

    /// Turns along the push, holds the closed hand ahead and drives on until it is right before what it pushes.
    fn line_up(&self, agent: &mut Agent, ajar: &Ajar, reach: &Reach) -> Result<Tried<()>, Halt> {
        agent.grip(0.0, 10.0);
        let at = ajar.moved(&agent.world_from_base()?.inverse());
        turn(agent, at.way.y.atan2(at.way.x))?;
        let world_from_base = agent.world_from_base()?;
        let at = ajar.moved(&world_from_base.inverse()).at;
        let tip_m = agent.model().settings.gripper.tip_beyond_tool_m;
        let mut grip = reach.base_from_grip;
        let left_m = at.x - tip_m - grip.translation.x;
        (grip.translation.y, grip.translation.z) = (at.y, at.z);
        let obstacles = find_obstacles(agent.map(), Some(&agent.live), &world_from_base, None);
        // As far back as the base has room before what stands open.
        let back_m = (WRIST_LOOK_M - left_m).clamp(0.0, WRIST_LOOK_M);
        let before = Translation3::new(-back_m, 0.0, 0.0) * grip;
        if let Err(failure) = pose_before(agent, self.settings, before, reach, &obstacles, "it")? {
            return Ok(Err(failure));
        }
        let model = agent.model().clone();
        let tool = model.kinematics.root_from_link(&agent.configuration()?, model.tool);
        let at = ajar.moved(&agent.world_from_base()?.inverse()).at;
        let gap_m = at.x - tip_m - tool.translation.x - BEFORE_M;
        let seen_m = find_gap(agent, &tool, tip_m)?.map_or(f64::INFINITY, |seen_m| seen_m - BEFORE_M);
        agent.log(format!("{gap_m:.3} m to go by what was seen from afar, {seen_m:.3} by what the wrist sees"));
        if seen_m < gap_m - SURPRISE_M {
            return Ok(Err((Stage::Mapping, format!("something is {:.2} m nearer than what is open", gap_m - seen_m))));
        }
        creep(agent, gap_m.min(seen_m), 0.08)?;
        Ok(Ok(()))
    }
}

/// How far before the closed hand (`tip_m` beyond the tool, in the frame of the base) the wrist camera sees something, metres.
fn find_gap(agent: &mut Agent, base_from_tool: &Pose, tip_m: f64) -> Result<Option<f64>, Halt> {
    const FRAMES: usize = 3;
    /// Half the width of what meets the hand, and what of the hand itself is in the picture, metres.
    const HALF_M: f64 = 0.03;
    const HAND_M: f64 = 0.02;
    let tool_from_base = base_from_tool.inverse();
    let points = gather(agent, "wrist", FRAMES)?;
    let ahead = points.iter().map(|point| tool_from_base * point);
    let mut ahead: Vec<f64> = ahead.filter(|p| p.xy().coords.norm() < HALF_M).map(|p| p.z - tip_m).collect();
    ahead.retain(|gap_m| *gap_m > HAND_M);
    ahead.sort_by(f64::total_cmp);
    // A few stray pixels are no thing.
    Ok(ahead.get(ahead.len() / 50).copied())
}

/// Places to look at a side from: the given one, and others from one end of it to the other.
fn places_before(side: &Side, first: Pose2, costmap: &Costmap, field: &Field) -> Vec<Pose2> {
    let across = Vector3::z().cross(&side.normal).xy();
    let is_place = |p: &Point2<f64>| costmap.is_traversable_at(p) && field.find_length_to_m(p).is_some();
    let others = ASIDE_M.iter().filter_map(|aside_m| {
        let places = LOOK_M.iter().map(|off_m| side.middle + side.normal.xy() * *off_m + across * *aside_m);
        places.into_iter().find(is_place).map(|place| Pose2::facing(place, &side.middle))
    });
    std::iter::once(first).chain(others).collect()
}

/// Where to stand and how to reach to push, and the way there.
fn plan_push(ground: &Ground<'_>, ajar: &Ajar, side: &Side) -> Result<(Reach, Approach), String> {
    let &Ground { map, model, costmap, field, folded, .. } = ground;
    let (way, yaw_rad) = (ajar.way.xy(), ajar.way.y.atan2(ajar.way.x));
    let tip_m = model.settings.gripper.tip_beyond_tool_m;
    let is_place = |p: &Point2<f64>| costmap.is_traversable_at(p) && field.find_length_to_m(p).is_some();
    let (mut reached, mut blocked) = (0, 0);
    for from_m in PUSH_FROM_M {
        let stand = ajar.at.xy() - way * from_m;
        let unfolds = UNFOLD_BACK_M.iter().map(|back_m| Pose2 { position: stand - way * *back_m, yaw_rad });
        let unfolds: Vec<Pose2> = unfolds.filter(|place| is_place(&place.position)).collect();
        let is_free = is_way_free(map, model.settings.base.footprint_radius_m, &stand, ajar, side);
        tracing::debug!("to push from {stand:.2}: {} places to unfold, way free: {is_free}", unfolds.len());
        if unfolds.is_empty() || !is_free {
            blocked += 1;
            continue;
        }
        let base_from_world = Pose2 { position: stand, yaw_rad }.to_pose().inverse();
        let at = base_from_world * ajar.at - Vector3::x() * tip_m;
        let found = hands_ahead().into_iter().find_map(|rotation| {
            let grip = Pose::from_parts(at.coords.into(), rotation);
            reaches(model, folded, &grip).map(|(_, before)| (grip, before))
        });
        let Some((base_from_grip, joints)) = found else { continue };
        reached += 1;
        let approach = unfolds.iter().find_map(|unfold_at| {
            let stands = [*unfold_at];
            let swept = find_approaches(ground, &stands, 0.0, 1).into_iter().next();
            swept.or_else(|| find_approach_around(ground, &stands, 0.0))
        });
        if let Some(approach) = approach {
            return Ok((Reach { swing_rad: 0.0, base_from_grip, joints }, approach));
        }
    }
    Err(format!("no way to any of {reached} places that reach what stands open; {blocked} others are blocked"))
}

/// Hands that look straight ahead, level (+z of the tool), turned about that by quarters.
pub(super) fn hands_ahead() -> [UnitQuaternion<f64>; 4] {
    let ahead = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
    [0.0, 1.0, 2.0, 3.0].map(|quarters| {
        ahead * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), quarters * std::f64::consts::FRAC_PI_2)
    })
}

/// Whether nothing but what is pushed stands where the base goes while it pushes.
fn is_way_free(map: &Map, radius_m: f64, stand: &Point2<f64>, ajar: &Ajar, side: &Side) -> bool {
    const STEP_M: f64 = 0.05;
    /// The furniture and what stands open of it reach so far beside and before the side, metres.
    const ASIDE_M: f64 = 0.1;
    const BEFORE_M: f64 = 0.7;
    let right = Vector3::z().cross(&side.normal).xy();
    let is_furniture = |p: &Point2<f64>| {
        let off = p - side.middle;
        off.dot(&right).abs() < side.half_m + ASIDE_M && off.dot(&side.normal.xy()) < BEFORE_M
    };
    let steps = (ajar.way_m / STEP_M).ceil() as i32;
    let bases = (0..=steps).map(|step| stand + ajar.way.xy() * (f64::from(step) * STEP_M));
    let reach = (radius_m / STEP_M).ceil() as i32;
    bases.into_iter().all(|base| {
        let cells = (-reach..=reach).flat_map(|i| (-reach..=reach).map(move |k| [i, k].map(|n| f64::from(n) * STEP_M)));
        let around = cells.filter(|[x, y]| x.hypot(*y) <= radius_m).map(|[x, y]| Point2::new(base.x + x, base.y + y));
        let mut taken = around.filter(|p| !is_furniture(p) && map.free_space.state_at(p) == CellState::Occupied);
        taken.next().inspect(|at| tracing::debug!("{at:.2} is in the way of {base:.2}; {side:?}")).is_none()
    })
}
