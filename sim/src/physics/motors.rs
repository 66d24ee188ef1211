//! What the motors are to do, whatever engine drives them: joint targets and the base's twist become set points.

use super::JointTarget;
use super::robot_spec::{BaseDrive, MovingJoint};
use dsm_robot::drivers::Twist;

/// Stiffness and damping of a joint's motor.
#[derive(Clone, Copy, Debug)]
struct Gains {
    stiffness: f64,
    damping: f64,
    /// How far the moving position target may run ahead of the joint, radians or metres: it bounds the effort that a
    /// blocked joint builds up.
    lead: f64,
}

/// Damping of a joint's motor over its stiffness, seconds.
const JOINT_DAMPING_S: f64 = 0.07;

/// Gains by the effort the motor can give: full effort at a position error of `full_effort_at`.
///
/// Measured in `examples/spike.rs`: 0.02 rad keeps the tool within 2 mm, and the damping leaves no oscillation with a
/// load of 1 kg.
fn gains(joint: &MovingJoint) -> Gains {
    let full_effort_at = if joint.prismatic { 0.005 } else { 0.02 };
    let stiffness = joint.max_effort / full_effort_at;
    Gains { stiffness, damping: JOINT_DAMPING_S * stiffness, lead: 2.0 * full_effort_at }
}

/// The wheels' velocity control integrates, so that a standing base does not creep under a steady push: full force at
/// this error along each axis, and the moving reference runs no further ahead.
const BASE_HOLD_M: f64 = 0.005;
const BASE_HOLD_RAD: f64 = 0.005;
/// Damping of the base's motors over their stiffness, seconds.
const BASE_DAMPING_S: f64 = 0.15;

/// Share of its effort that a joint's motor gives beyond what carries the arm, and for joints that slide that effort, newtons:
/// drives beside people and furniture limit their force, so that an arm that is held up presses with 40 to 60 N at its hand.
const SPARE_SHARE: f64 = 0.18;
const SPARE_N: f64 = 45.0;

/// What a motor does during the next step: effort = stiffness (position - measured) + damping (velocity - measured),
/// bounded by `max_effort`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setpoint {
    /// Radians or metres.
    pub position: f64,
    /// Radians or metres per second.
    pub velocity: f64,
    /// Newton metres per radian or newtons per metre.
    pub stiffness: f64,
    /// Newton metre seconds per radian or newton seconds per metre.
    pub damping: f64,
    /// Newton metres or newtons, not below 0.
    pub max_effort: f64,
    /// Greatest effort beyond what carries the arm, newton metres or newtons, not below 0.
    pub spare_effort: f64,
}

impl Setpoint {
    /// The effort at a measured position and velocity.
    pub fn effort(&self, position: f64, velocity: f64) -> f64 {
        let effort = self.stiffness * (self.position - position) + self.damping * (self.velocity - velocity);
        effort.clamp(-self.max_effort, self.max_effort)
    }
}

struct Motor {
    gains: Gains,
    target: JointTarget,
    /// The moving position target.
    reference: f64,
    /// Measured position and its change per second.
    position: f64,
    velocity: f64,
    effort: f64,
    /// Greatest effort whatever the target says.
    max_effort: f64,
    /// Greatest effort beyond what carries the arm.
    spare_effort: f64,
}

/// All motors of the robot.
pub struct Motors {
    joints: Vec<MovingJoint>,
    motors: Vec<Motor>,
    twist: Twist,
    /// Moving references of x, y and yaw.
    base_reference: [f64; 3],
    limits: BaseDrive,
}

impl Motors {
    /// Motors that hold the given positions, base at rest at x, y and yaw. `fingers` are the indices of the joints whose
    /// effort is also bounded by `finger_max_force_n`.
    pub fn new(
        joints: &[MovingJoint],
        (fingers, finger_max_force_n): ([usize; 2], f64),
        limits: BaseDrive,
        base: [f64; 3],
        positions: &[f64],
    ) -> Self {
        let motors = joints.iter().zip(positions).enumerate().map(|(index, (joint, position))| {
            let is_finger = fingers.contains(&index);
            let bound = if is_finger { finger_max_force_n } else { f64::INFINITY };
            let spare_effort = match joint.prismatic {
                _ if is_finger => f64::INFINITY,
                true => SPARE_N,
                false => SPARE_SHARE * joint.max_effort,
            };
            Motor {
                gains: gains(joint),
                target: JointTarget::Velocity(0.0),
                reference: *position,
                position: *position,
                velocity: 0.0,
                effort: 0.0,
                max_effort: joint.max_effort.min(bound),
                spare_effort,
            }
        });
        let motors = motors.collect();
        Self { joints: joints.to_vec(), motors, twist: Twist::default(), base_reference: base, limits }
    }

    /// Sets the velocity that the wheels drive at.
    pub fn command_base(&mut self, twist: Twist) {
        let clamp = |value: f64, limit: f64| if value.is_finite() { value.clamp(-limit, limit) } else { 0.0 };
        self.twist = Twist {
            forward_m_per_s: clamp(twist.forward_m_per_s, self.limits.max_speed_m_per_s),
            turn_rad_per_s: clamp(twist.turn_rad_per_s, self.limits.max_turn_rad_per_s),
        };
    }

    /// Sets what a joint's motor does.
    pub fn command_joint(&mut self, joint: usize, target: JointTarget) {
        self.motors[joint].target = target;
    }

    /// Set points of x, y and yaw for a step of `dt_s` from the measured ones.
    pub fn plan_base(&mut self, position: [f64; 3], dt_s: f64) -> [Setpoint; 3] {
        let (sin, cos) = position[2].sin_cos();
        let forward = self.twist.forward_m_per_s;
        let limits = &self.limits;
        let axes = [
            (forward * cos, BASE_HOLD_M, limits.max_force_n),
            (forward * sin, BASE_HOLD_M, limits.max_force_n),
            (self.twist.turn_rad_per_s, BASE_HOLD_RAD, limits.max_torque_nm),
        ];
        let mut reference = self.base_reference;
        let setpoints = std::array::from_fn(|axis| {
            let (velocity, hold, max_effort) = axes[axis];
            let position = position[axis];
            reference[axis] = (reference[axis] + velocity * dt_s).clamp(position - hold, position + hold);
            let stiffness = max_effort / hold;
            let damping = BASE_DAMPING_S * stiffness;
            Setpoint { position: reference[axis], velocity, stiffness, damping, max_effort, spare_effort: max_effort }
        });
        self.base_reference = reference;
        setpoints
    }

    /// Set point of a joint for a step of `dt_s`.
    pub fn plan_joint(&mut self, index: usize, dt_s: f64) -> Setpoint {
        let (motor, joint) = (&mut self.motors[index], &self.joints[index]);
        let Gains { stiffness, damping, lead } = motor.gains;
        let (velocity, max_effort) = match motor.target {
            JointTarget::Velocity(velocity) => {
                let velocity = if velocity.is_finite() { velocity } else { 0.0 };
                let velocity = velocity.clamp(-joint.max_speed, joint.max_speed);
                let wanted = (motor.reference + velocity * dt_s).clamp(joint.lower, joint.upper);
                motor.reference = wanted.clamp(motor.position - lead, motor.position + lead);
                // No feed-forward into a limit.
                let blocked = wanted <= joint.lower && velocity < 0.0 || wanted >= joint.upper && velocity > 0.0;
                (if blocked { 0.0 } else { velocity }, joint.max_effort)
            }
            JointTarget::Position { position: goal, speed, max_effort } => {
                let goal = goal.clamp(joint.lower, joint.upper);
                let stride = speed.abs().min(joint.max_speed) * dt_s;
                let max_effort = max_effort.min(joint.max_effort);
                // Not much further ahead than the effort needs, or a joint that comes free shoots after its target.
                let lead = 1.25 * max_effort.max(0.0) / stiffness;
                let before = motor.reference;
                motor.reference = (before + (goal - before).clamp(-stride, stride))
                    .clamp(motor.position - lead, motor.position + lead);
                ((motor.reference - before).clamp(-stride, stride) / dt_s, max_effort)
            }
        };
        let max_effort = max_effort.min(motor.max_effort).max(0.0);
        Setpoint {
            position: motor.reference,
            velocity,
            stiffness,
            damping,
            max_effort,
            spare_effort: motor.spare_effort,
        }
    }

    /// Tells what a joint's motor did during a step.
    pub fn measure(&mut self, joint: usize, position: f64, velocity: f64, effort: f64) {
        let motor = &mut self.motors[joint];
        (motor.position, motor.velocity, motor.effort) = (position, velocity, effort);
    }

    /// Measured effort of a joint's motor, newton metres or newtons.
    pub fn effort(&self, joint: usize) -> f64 {
        self.motors[joint].effort
    }

    /// Measured position of a joint, radians or metres.
    pub fn position(&self, joint: usize) -> f64 {
        self.motors[joint].position
    }

    /// Measured positions, radians or metres.
    pub fn positions(&self) -> impl Iterator<Item = f64> {
        self.motors.iter().map(|motor| motor.position)
    }

    /// Measured velocities, radians or metres per second.
    pub fn velocities(&self) -> impl Iterator<Item = f64> {
        self.motors.iter().map(|motor| motor.velocity)
    }
}
