//! What the hand holds, and carrying it: the fold around it, and the footprint to drive with.

use super::Outcome;
use super::arm::{ArmOutcome, move_joints_around, move_through};
use super::carry::find_carry;
use super::grasp::GraspSettings;
use super::obstacles::{find_obstacles, leave_out_held, leave_out_overlaps};
use super::place::stands_around;
use super::retreat::back_off;
use super::spots::Load;
use crate::agent::{Agent, Gaze, Halt};
use crate::summary::Stage;
use dsm::Pose;
use dsm::geometry::OrientedBox;
use dsm::map::{Map, ObjectId};
use dsm_robot::grasp::{ApproachFrom, GraspScene};
use dsm_robot::model::collision::Obstacle;
use dsm_robot::nav::{Costmap, Field, NavConfig, Pose2};
use nalgebra::{Point2, Point3, UnitQuaternion, Vector3};

/// Distance backed off from the place of the grasp, metres.
const BACK_M: f64 = 0.5;
/// Speed of the base while it backs off, metres per second: out of a shelf the arm may brush what no camera shows.
const BACK_SPEED_M_PER_S: f64 = 0.09;
/// Greatest joint error with which the arm counts as folded, radians.
const FOLDED_RAD: f64 = 0.2;
/// A load with sides in this ratio has room where a round one of its length has none.
const LONG: f64 = 1.3;

/// What the hand holds and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Held {
    /// The object, as the map knew it before the grasp.
    pub id: ObjectId,
    /// What it is called.
    pub name: String,
    /// Its middle before it was taken, world frame.
    pub stood_at: Point3<f64>,
    /// Its outline and height.
    pub load: Load,
    /// Height of the tool above the object's lowest point, metres.
    pub tool_above_bottom_m: f64,
    /// How the hand held it when it was grasped, base frame.
    pub base_from_tool: UnitQuaternion<f64>,
    /// How its first side lay then, base frame, radians.
    pub base_from_side_rad: f64,
    /// Width between the fingers, metres.
    pub width_m: f64,
    /// Its centre of mass, tool frame, metres.
    pub balance_in_tool: Point3<f64>,
}

/// An object as it stands before a grasp: what the hand will hide.
#[derive(Clone, Debug, PartialEq)]
pub struct Standing {
    id: ObjectId,
    name: String,
    bounds: OrientedBox,
    support_z_m: f64,
    /// Height of its centre of mass above the support, metres.
    balance_m: f64,
}

impl Standing {
    /// The object in the map; `None` when the map does not hold it.
    pub fn of(map: &Map, id: ObjectId) -> Option<Self> {
        let object = map.find_object(id)?;
        let (name, bounds) = (object.name().to_owned(), object.bounds);
        let scene = GraspScene::from_map(map, id, ApproachFrom::Anywhere)?;
        Some(Self { id, name, bounds, support_z_m: scene.support_z_m, balance_m: scene.balance_m() })
    }

    /// What the hand holds after the grasp skill has lifted the object; from here on the object belongs to the robot
    /// and is left out of the map.
    pub fn lifted(&self, agent: &mut Agent, settings: &GraspSettings) -> Result<Held, Halt> {
        let model = agent.model().clone();
        let configuration = agent.configuration()?;
        let base_from_tool = model.kinematics.root_from_link(&configuration, model.tool);
        let height_m = (self.bounds.top_m() - self.support_z_m).max(0.02);
        let above_m = base_from_tool.translation.z - settings.planner.lift_m - self.support_z_m;
        let tool_above_bottom_m = above_m.clamp(0.0, height_m + 0.05);
        // Held beside its middle it reaches farther out on one side; more than this is the way out of a shelf.
        const OFF_CENTRE_M: f64 = 0.06;
        let world_from_tool = agent.world_from_base()? * base_from_tool;
        let off_m = (world_from_tool.translation.vector.xy() - self.bounds.center.coords.xy()).norm();
        let off_m = if off_m > OFF_CENTRE_M { 0.0 } else { off_m };
        let radius_m = 0.55 * self.bounds.size.x.max(self.bounds.size.y);
        let width_m = agent.grip_state()?.width_m;
        let tool = base_from_tool.translation.vector;
        let middle = Point3::new(tool.x, tool.y, tool.z - tool_above_bottom_m + 0.5 * height_m);
        let balance = Point3::new(tool.x, tool.y, tool.z - tool_above_bottom_m + self.balance_m);
        let balance_in_tool = base_from_tool.inverse_transform_point(&balance);
        let base_from_world = agent.world_from_base()?.inverse();
        let (size, base_from_box) = upright(&self.bounds, height_m, &base_from_world);
        agent.hold(Some(OrientedBox {
            center: base_from_tool.inverse_transform_point(&middle),
            size,
            rotation: base_from_tool.rotation.inverse() * base_from_box,
        }));
        let half_m = [size.x, size.y].map(|side_m| 0.5 * side_m + off_m);
        let is_long = half_m[0].max(half_m[1]) > LONG * half_m[0].min(half_m[1]);
        let load = Load { radius_m: radius_m + off_m, height_m, half_m: is_long.then_some(half_m) };
        let base_from_side_rad = base_from_box.euler_angles().2;
        let base_from_tool = base_from_tool.rotation;
        Ok(Held {
            id: self.id,
            name: self.name.clone(),
            stood_at: self.bounds.center,
            load,
            tool_above_bottom_m,
            base_from_tool,
            base_from_side_rad,
            width_m,
            balance_in_tool,
        })
    }
}

/// Size and rotation of the upright box around an object in the base frame: its own sides, a little wider than they were
/// seen, when it stands upright, or a square around it.
fn upright(bounds: &OrientedBox, height_m: f64, base_from_world: &Pose) -> (Vector3<f64>, UnitQuaternion<f64>) {
    const WIDER: f64 = 1.1;
    const UPRIGHT_RAD: f64 = 0.05;
    let tilt_rad = (bounds.rotation * Vector3::z()).angle(&Vector3::z());
    if tilt_rad < UPRIGHT_RAD {
        let size = Vector3::new(WIDER * bounds.size.x, WIDER * bounds.size.y, height_m);
        return (size, base_from_world.rotation * bounds.rotation);
    }
    let side_m = WIDER * bounds.size.x.max(bounds.size.y);
    (Vector3::new(side_m, side_m, height_m), UnitQuaternion::identity())
}

/// Backs off from where the object was lifted and folds the arm around it, ready to drive anywhere.
pub fn carry(agent: &mut Agent, held: &Held, settings: &GraspSettings) -> Result<Outcome, Halt> {
    agent.gaze = Gaze::AHEAD;
    back_off(agent, BACK_M, BACK_SPEED_M_PER_S)?;
    let world_from_base = agent.world_from_base()?;
    let mut obstacles = obstacles_but_held(agent, &world_from_base, held)?;
    let (model, configuration) = (agent.model().clone(), agent.configuration()?);
    leave_out_overlaps(&model, &configuration, &mut obstacles);
    let balance_in_tool = held.balance_in_tool;
    let postures = agent.plan(move || find_carry(&model, &configuration, &balance_in_tool))?;
    let Some(postures) = postures else {
        return Ok(Outcome::Failed(Stage::Reach, "the arm has no way to carry this object".into()));
    };
    let mut folded = move_through(agent, &postures, &obstacles)?;
    if let (ArmOutcome::Stuck { error_m, .. }, Some(carried)) = (folded, postures.last())
        && error_m > FOLDED_RAD
    {
        folded = move_joints_around(agent, carried, &obstacles)?;
    }
    if agent.grip_state()?.width_m < settings.min_width_m {
        agent.hold(None);
        return Ok(Outcome::Failed(Stage::Hold, "the object slipped out of the fingers on the way".into()));
    }
    match folded {
        ArmOutcome::Stuck { error_m, .. } if error_m > FOLDED_RAD => {
            Ok(Outcome::Failed(Stage::Reach, format!("the arm cannot fold with the object; {error_m:.2} rad are left")))
        }
        _ => Ok(Outcome::Done("carries the object".into())),
    }
}

/// Navigation with the footprint of the robot as it is folded around its load, or as much of it as leaves half of the
/// places to stand around the `goals`, and a way there: a load that sticks out a little must neither close every door nor
/// leave one place from which the arm does not reach.
pub fn carrying(agent: &mut Agent, nav: &NavConfig, goals: &[Point2<f64>]) -> Result<NavConfig, Halt> {
    /// A footprint for which wide doors are wide enough.
    const WIDEST_M: f64 = 0.34;
    const STEP_M: f64 = 0.03;
    const LEFT_SHARE: f64 = 0.5;
    let configuration = agent.configuration()?;
    let own_m = nav.costmap.footprint_radius_m;
    let mut radius_m = own_m.max(agent.model().radius_m(&configuration).min(WIDEST_M));
    let (map, start) = (agent.map().clone(), Pose2::from_pose(&agent.world_from_base()?).position);
    let (nav, goals) = (nav.clone(), goals.to_vec());
    agent.plan(move || {
        let with_radius = |radius_m: f64| {
            let mut wide = nav.clone();
            wide.costmap.footprint_radius_m = radius_m;
            wide
        };
        let count_stands = |nav: &NavConfig| -> usize {
            let costmap = Costmap::from_free_space(&map.free_space, &nav.costmap);
            let field = Field::from_start(&costmap, &start);
            goals.iter().map(|goal| stands_around(&costmap, &field, goal).len()).sum()
        };
        if goals.is_empty() {
            return with_radius(radius_m);
        }
        let most = count_stands(&nav) as f64;
        loop {
            let wide = with_radius(radius_m);
            let stands = count_stands(&wide);
            if radius_m <= own_m || (stands > 0 && stands as f64 >= LEFT_SHARE * most) {
                return wide;
            }
            radius_m = (radius_m - STEP_M).max(own_m);
        }
    })
}

/// Obstacles near the base, without the held object, its old place and what the map took for it in the hand.
pub(super) fn obstacles_but_held(
    agent: &mut Agent,
    world_from_base: &Pose,
    held: &Held,
) -> Result<Vec<Obstacle>, Halt> {
    let model = agent.model().clone();
    let configuration = agent.configuration()?;
    let base_from_tool = model.kinematics.root_from_link(&configuration, model.tool);
    let mut obstacles = find_obstacles(agent.map(), Some(&agent.live), world_from_base, Some(held.id));
    leave_out_held(&mut obstacles, agent.held(), &base_from_tool);
    Ok(obstacles)
}

#[cfg(test)]
mod tests {
    //! Contract: a box in the hand is as thin as the box was: one taken for a square as wide as its longer side has no
    //! room in the fold.
    use super::*;
    use nalgebra::Translation3;

    #[test]
    fn a_cereal_box_stays_thin() {
        let yaw = |angle: f64| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
        let size = Vector3::new(0.19, 0.06, 0.28);
        let standing = OrientedBox { center: Point3::new(1.0, 2.0, 0.9), size, rotation: yaw(0.7) };
        let base_from_world = Pose::from_parts(Translation3::identity(), yaw(-0.2));
        let (held, base_from_box) = upright(&standing, 0.28, &base_from_world);
        assert!(held.x > 0.19 && held.x < 0.22 && held.y > 0.06 && held.y < 0.07 && held.z == 0.28, "{held}");
        assert!(base_from_box.angle_to(&yaw(0.5)) < 1e-9);
        let fallen = OrientedBox { rotation: UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.4), ..standing };
        let (held, base_from_box) = upright(&fallen, 0.28, &base_from_world);
        assert!(held.x == held.y && held.x > 0.19 && base_from_box.angle() < 1e-9);
    }
}
