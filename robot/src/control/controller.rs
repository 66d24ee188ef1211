//! The loop of the controller: one tick turns a tool pose into velocities of the joints and of the base.

use super::camera_task::{Watch, add_camera_task, watch_error};
use super::config::ControllerConfig;
use super::descent::Chain;
use super::effort_task::add_effort_task;
use super::facing_task::add_facing_task;
use super::joint_move::velocities_along;
use super::manipulability::manipulability;
use super::pose_task::{ToolGoal, add_pose_task, pose_error, wanted_twist};
use super::posture_task::add_posture_task;
use super::recovery::{Advice, Progress, Recovery};
use super::safety::{Safety, Situation};
use super::{BrakeReason, ControlOutput, ControlStatus};
use crate::drivers::{JointState, Twist};
use crate::joints::JointPositions;
use crate::model::settings::BaseSettings;
use crate::model::{CollisionModel, Group, JointLimits, Kinematics, LinkId, Obstacle, RobotModel};
use nalgebra::{DMatrix, DVector, Point3, Vector6};
use std::sync::Arc;

/// A radian of turning counts like so many metres where the two errors are one number.
const METRES_PER_RAD: f64 = 0.2;
/// Distance that a posture found by itself keeps from obstacles, and from own links, m.
const POSTURE_MARGINS_M: (f64, f64) = (0.02, 0.01);

/// Distance that it keeps from joint limits beyond the controller's, rad or m.
const POSTURE_LIMIT_MARGIN: f64 = 0.002;

/// Follows tool poses with the arm group, and with the base where it takes part, within limits and away from itself and
/// from obstacles.
pub struct Controller {
    safety: Safety,
    tool: LinkId,
    posture: DVector<f64>,
    /// Whether the caller chose it.
    posture_chosen: bool,
    rank: Vec<usize>,
    watch: Option<Watch>,
    recovery: Option<Recovery>,
    held_back: bool,
}

impl Controller {
    /// A controller for the model's arm group and tool frame; the base stands. The preferred posture is the middle of
    /// the joint limits.
    pub fn new(model: &RobotModel, config: ControllerConfig) -> Self {
        Self::for_group(&model.kinematics, &model.collision, &model.arm, model.tool, config)
    }

    /// A controller for the model's arm group together with its base: see [`Self::tick_with_base`].
    pub fn with_base(model: &RobotModel, config: ControllerConfig) -> Self {
        let parts = (&model.kinematics, &model.collision, &model.arm);
        Self::for_parts(parts, Some(&model.settings.base), model.tool, config)
    }

    /// A controller for any group and any link that it moves; the base stands.
    pub fn for_group(
        kinematics: &Kinematics,
        collision: &Arc<CollisionModel>,
        group: &Group,
        tool: LinkId,
        config: ControllerConfig,
    ) -> Self {
        Self::for_parts((kinematics, collision, group), None, tool, config)
    }

    fn for_parts(
        (kinematics, collision, group): (&Kinematics, &Arc<CollisionModel>, &Group),
        base: Option<&BaseSettings>,
        tool: LinkId,
        config: ControllerConfig,
    ) -> Self {
        let margin = config.limit_margin;
        // A base that drives comes near by itself.
        let recovers = config.recovery && base.is_none();
        let safety = Safety::new(kinematics, collision, group, base, config, margin);
        let middle = |limits: &JointLimits| match limits.lower.is_finite() && limits.upper.is_finite() {
            true => 0.5 * (limits.lower + limits.upper),
            false => 0.0,
        };
        let chain = kinematics.joints_to(tool);
        let place = |name: &str| chain.iter().position(|joint| kinematics.joints[*joint].name == name);
        let mut controller = Self {
            tool,
            posture: DVector::from_iterator(group.len(), group.limits.iter().map(middle)),
            rank: group.joints.iter().map(|name| place(name).unwrap_or(chain.len())).collect(),
            posture_chosen: false,
            watch: None,
            recovery: None,
            held_back: false,
            safety,
        };
        if recovers {
            controller.recovery = controller.new_recovery();
        }
        controller
    }

    fn new_recovery(&self) -> Option<Recovery> {
        let safety = &self.safety;
        let margin = safety.config.limit_margin + POSTURE_LIMIT_MARGIN;
        let chain = Chain::new(&safety.kinematics, &safety.group, self.tool, &safety.rest, margin);
        chain.is_searchable().then(|| Recovery::new(chain))
    }

    /// Joints to prefer where the pose leaves them free; joints not named keep their preference.
    pub fn set_posture(&mut self, preferred: &JointPositions) {
        for (k, name) in self.safety.group.joints.iter().enumerate() {
            if let Some(value) = preferred.find(name) {
                self.posture[k] = value;
                self.posture_chosen = true;
            }
        }
    }

    /// Where the joints outside the arm are (head, fingers), for self-collision.
    pub fn set_other_joints(&mut self, positions: &JointPositions) {
        let before = self.safety.rest.clone();
        self.safety.set_other_joints(positions);
        // Joints outside the group may carry the tool.
        if self.recovery.is_some() && before != self.safety.rest {
            let (kinematics, rest) = (&self.safety.kinematics, &self.safety.rest);
            let moved = kinematics.root_from_link(&before, self.tool) != kinematics.root_from_link(rest, self.tool);
            if moved {
                self.recovery = self.new_recovery();
            }
        }
    }

    /// Links that may touch obstacles, as fingers do when they close; replaces the list before.
    pub fn set_touching(&mut self, links: &[LinkId]) {
        self.safety.set_touching(links);
    }

    /// What a camera shall keep in its picture while the tool moves; `None` for nothing.
    pub fn set_watch(&mut self, watch: Option<Watch>) {
        self.watch = watch;
    }

    /// Forgets the last command, for instance after an emergency stop.
    pub fn reset(&mut self) {
        self.safety.reset();
        if let Some(recovery) = &mut self.recovery {
            recovery.reset();
        }
    }

    /// Velocities for the next `dt_s` seconds with a base that stands. Obstacles are in the base frame.
    pub fn tick(&mut self, state: &JointState, goal: &ToolGoal, obstacles: &[Obstacle], dt_s: f64) -> ControlOutput {
        self.tick_with_base(state, Twist::default(), goal, obstacles, dt_s)
    }

    /// Velocities of arm and base for the next `dt_s` seconds. `base` is how the base moves now; goal and obstacles are
    /// in the base frame of this moment, their velocities against the floor.
    pub fn tick_with_base(
        &mut self,
        state: &JointState,
        base: Twist,
        goal: &ToolGoal,
        obstacles: &[Obstacle],
        dt_s: f64,
    ) -> ControlOutput {
        let watched = self.watch.iter().flat_map(|watch| watch.point_in_base.iter());
        let velocities = goal.linear_m_per_s.iter().chain(&goal.angular_rad_per_s).chain(watched);
        let pose = goal.base_from_tool.to_homogeneous();
        if !pose.iter().chain(velocities).all(|v| v.is_finite()) || !obstacles.iter().all(Obstacle::is_finite) {
            return self.safety.brake(state, base, BrakeReason::NotFinite, dt_s);
        }
        let now = match self.safety.situation(state, base, dt_s) {
            Ok(now) => now,
            Err(reason) => return self.safety.brake(state, base, reason, dt_s),
        };
        let error = pose_error(now.poses.get(self.tool), &goal.base_from_tool);
        let (error_m, error_rad) = (error.fixed_rows::<3>(0).norm(), error.fixed_rows::<3>(3).norm());
        let reached = error_m <= self.safety.config.reached_m && error_rad <= self.safety.config.reached_rad;
        let advice = self.advise(&now, goal, error_m + METRES_PER_RAD * error_rad, reached, obstacles, dt_s);
        let cost = match &advice {
            Advice::Follow => self.cost(&now, goal, &error),
            Advice::MoveTo(target) => {
                let left = DVector::from_column_slice(target) - &now.positions;
                let n = left.len();
                (DMatrix::identity(n, n), -velocities_along(&self.safety, &now, &left, dt_s))
            }
        };
        let rows = self.safety.rows(&now, obstacles, dt_s);
        let mut output = self.safety.finish(state, now, cost, rows, dt_s);
        self.held_back = output.active_rows > 0;
        (output.error_m, output.error_rad) = (error_m, error_rad);
        if output.status == ControlStatus::Tracking {
            output.status = match advice {
                Advice::MoveTo(_) => ControlStatus::Reconfiguring,
                Advice::Follow if reached => ControlStatus::Reached,
                Advice::Follow => ControlStatus::Tracking,
            };
        }
        output
    }

    /// Whether to leave the present posture. Only for goals that stand: a moving one is followed as well as it goes.
    fn advise(
        &mut self,
        now: &Situation,
        goal: &ToolGoal,
        error: f64,
        reached: bool,
        obstacles: &[Obstacle],
        dt_s: f64,
    ) -> Advice {
        let Some(recovery) = &mut self.recovery else { return Advice::Follow };
        if goal.linear_m_per_s.norm_squared() + goal.angular_rad_per_s.norm_squared() > 0.0 {
            recovery.reset();
            return Advice::Follow;
        }
        let safety = &self.safety;
        let speeds: Vec<f64> = safety.envelopes.iter().map(|envelope| envelope.velocity).collect();
        let progress = Progress {
            goal: &goal.base_from_tool,
            positions: now.positions.as_slice(),
            speeds: &speeds,
            error,
            reached,
            rates: (safety.config.gain_per_s, safety.config.max_tool_speed_m_per_s),
            held_back: self.held_back,
            dt_s,
        };
        recovery.advise(&progress, |posture| {
            let mut configuration = safety.rest.clone();
            configuration.apply_group(&safety.group, posture);
            let poses = safety.kinematics.root_from_links(&configuration);
            let moved = safety.kinematics.links_moved_by(&safety.group);
            let (margin_m, self_margin_m) = POSTURE_MARGINS_M;
            !safety.collision.collides(&poses, obstacles, &moved, margin_m, self_margin_m)
        })
    }

    /// Hessian and gradient of all tasks.
    fn cost(&self, now: &Situation, goal: &ToolGoal, error: &Vector6<f64>) -> (DMatrix<f64>, DVector<f64>) {
        let safety = &self.safety;
        let (config, columns) = (&safety.config, &safety.columns);
        let tree = (&safety.kinematics, &now.poses);
        // Secondary tasks fade with the error (NEO's 1/e on the slack), so that they never hold the tool off its goal.
        let fade = error.norm().clamp(1e-3, 1.0);
        let error_m = error.fixed_rows::<3>(0).norm();
        let tool_point = Point3::from(now.poses.get(self.tool).translation.vector);
        let jacobian = columns.jacobian(tree.0, tree.1, self.tool, &tool_point);
        let n = columns.len();
        let (mut hessian, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
        add_effort_task(config, columns, (fade, error_m), &mut hessian);
        add_pose_task(config, &jacobian, &wanted_twist(config, error, goal), &mut hessian, &mut gradient);
        let hint = self.recovery.as_ref().and_then(|recovery| recovery.find_hint(self.posture_chosen));
        let posture = hint.map_or_else(|| self.posture.clone(), DVector::from_column_slice);
        let from_posture = &now.positions - posture;
        let weight = config.posture_weight * fade;
        add_posture_task(weight, config.posture_gain_per_s, &from_posture, &mut hessian, &mut gradient);
        let joints = now.positions.len();
        let of_arm = jacobian.columns(0, joints).into_owned();
        let uphill = manipulability(&of_arm, &self.rank).1 * (config.manipulability * fade);
        gradient.rows_mut(0, joints).zip_apply(&uphill, |g, up| *g -= up);
        let facing = (config.facing_weight * fade, config.facing_gain_per_s);
        let target = Point3::from(goal.base_from_tool.translation.vector);
        add_facing_task(columns, facing, &target, &mut hessian, &mut gradient);
        if let Some(watch) = &self.watch {
            let weight = (config.camera_weight * fade, config.camera_gain_per_s);
            add_camera_task(weight, &watch_error(columns, tree, watch), &mut hessian, &mut gradient);
        }
        (hessian, gradient)
    }
}
