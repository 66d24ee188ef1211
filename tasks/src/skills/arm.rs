//! Moving the arm: to joint values, along a named path of postures, and to tool poses by the QP controller.

use crate::agent::{Agent, Halt};
use crate::journal::ControlSample;
use dsm::Pose;
use dsm::time::Span;
use dsm_robot::control::{
    ControlOutput, ControlStatus, Controller, ControllerConfig, IkRequest, JointMove, PathRequest, ToolGoal, find_ik,
    find_joint_path,
};
use dsm_robot::drivers::Twist;
use dsm_robot::joints::{JointPositions, JointVelocities};
use dsm_robot::model::LinkId;
use dsm_robot::model::collision::Obstacle;

/// A motion that has not come nearer to its goal for this long is stuck.
pub const STUCK_AFTER: Span = Span(800_000_000);
/// Greatest joint error at the end of a path that still counts as its end, radians or metres.
pub(super) const NEAR_ENOUGH_RAD: f64 = 0.4;
/// Greatest joint error with which a posture on the way counts as passed, radians or metres.
const PASSED_RAD: f64 = 0.12;
/// Distances from obstacles of a planned way, the best first, metres.
const MARGINS_M: [f64; 2] = [0.03, 0.017];
/// Share of the joints' speed on a planned way: it sweeps wide, and what the map does not hold is met slowly.
const AROUND_SHARE: f64 = 0.3;
/// Share of the joints' speed with something in the hand: friction alone holds it against what the arm does to it.
const LOADED_SHARE: f64 = 0.5;
/// A gentle motion whose tool lags by more than this has met something, metres. Free ones lag by 0.3 mm at most, and fingers that
/// stand on a shelf or against a wall press by 25 to 100 N for each millimetre.
const GENTLE_LAG_M: f64 = 0.0005;
/// Share of what is left that a gentle motion goes in a second: 1 cm before its end by 18 mm/s. A hand that meets a wall at
/// 30 mm/s is stopped with 65 N before anything is felt.
const GENTLE_GAIN_PER_S: f64 = 1.8;
/// Improvement that counts for a joint motion, radians or metres.
const JOINT_PROGRESS: f64 = 0.03;
/// Improvement that counts for a motion of the tool, metres.
const TOOL_PROGRESS_M: f64 = 0.003;

/// How a motion of the arm ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ArmOutcome {
    /// At the goal.
    Reached,
    /// It came no nearer: what is left.
    Stuck {
        /// Distance of the tool (or the greatest joint error), metres or radians.
        error_m: f64,
        /// Angle of the tool, radians.
        error_rad: f64,
    },
}

/// Watches a motion come nearer.
struct Watch {
    best: f64,
    since_s: f64,
    progress: f64,
    patience_s: f64,
}

impl Watch {
    fn new(now_s: f64, progress: f64, patience: Span) -> Self {
        Self { best: f64::INFINITY, since_s: now_s, progress, patience_s: patience.as_s() }
    }

    /// Whether the motion is stuck.
    fn note(&mut self, error: f64, now_s: f64) -> bool {
        if error < self.best - self.progress {
            *self = Self { best: error, since_s: now_s, ..*self };
        }
        now_s - self.since_s > self.patience_s
    }
}

/// Moves the arm group to joint values; joints not named stay.
pub fn move_joints(agent: &mut Agent, goal: &JointPositions, obstacles: &[Obstacle]) -> Result<ArmOutcome, Halt> {
    let config = agent.model().settings.control.clone();
    move_joints_by(agent, goal, obstacles, config)
}

fn move_joints_by(
    agent: &mut Agent,
    goal: &JointPositions,
    obstacles: &[Obstacle],
    mut config: ControllerConfig,
) -> Result<ArmOutcome, Halt> {
    let model = agent.model().clone();
    if agent.held().is_some() {
        config.velocity_share *= LOADED_SHARE;
    }
    agent.take_touch();
    let mut motion = JointMove::new(&model, &model.arm, goal, config);
    let mut watch = Watch::new(agent.now().as_s(), JOINT_PROGRESS, STUCK_AFTER);
    loop {
        let state = agent.arm_state()?;
        motion.set_other_joints(agent.configuration()?.positions());
        let output = motion.tick(&state, obstacles, agent.period().as_s());
        agent.journal.control = Some(margins(&output));
        agent.tick(Twist::default(), &output.velocities)?;
        if agent.take_touch() {
            return yield_to_touch(agent, &output);
        }
        if let Some(outcome) = judge(&output, &mut watch, agent.now().as_s()) {
            log_stuck(agent, "joints", outcome, &output);
            return Ok(outcome);
        }
    }
}

fn log_stuck(agent: &mut Agent, what: &str, outcome: ArmOutcome, output: &ControlOutput) {
    if outcome != ArmOutcome::Reached {
        agent.log(format!(
            "{what} stuck: {:?}, {} rows, {} active, nearest {:?} m",
            output.status, output.rows, output.active_rows, output.min_distance_m
        ));
    }
}

/// Something that the map does not show holds the arm up: goes back a little the way it came, so that it does not press.
fn yield_to_touch(agent: &mut Agent, output: &ControlOutput) -> Result<ArmOutcome, Halt> {
    const SHARE: f64 = 0.5;
    const DURATION: Span = Span(300_000_000);
    let mut back: JointVelocities = output.velocities.clone();
    back.values_mut().iter_mut().for_each(|velocity| *velocity *= -SHARE);
    agent.note("the arm touches something");
    let end = agent.now() + DURATION;
    while agent.now() < end {
        agent.tick(Twist::default(), &back)?;
    }
    agent.rest(Span(100_000_000))?;
    agent.take_touch();
    Ok(ArmOutcome::Stuck { error_m: output.error_m, error_rad: output.error_rad })
}

/// Moves through postures in order.
pub fn move_through(
    agent: &mut Agent,
    postures: &[JointPositions],
    obstacles: &[Obstacle],
) -> Result<ArmOutcome, Halt> {
    for (i, goal) in postures.iter().enumerate() {
        match move_joints(agent, goal, obstacles)? {
            ArmOutcome::Reached => {}
            // Near the last posture is as good as at it: it is only where the next motion begins. So is just before one
            // on the way, where the robot or its load keeps a little more distance than the posture.
            ArmOutcome::Stuck { error_m, .. } if i + 1 == postures.len() && error_m < NEAR_ENOUGH_RAD => {}
            ArmOutcome::Stuck { error_m, .. } if error_m < PASSED_RAD => {}
            stuck => return Ok(stuck),
        }
    }
    Ok(ArmOutcome::Reached)
}

/// Folds the arm from wherever it is: backwards through the named path, without its last posture.
pub fn fold(agent: &mut Agent, path: &str, obstacles: &[Obstacle]) -> Result<ArmOutcome, Halt> {
    let model = agent.model().clone();
    let names = model.settings.paths.get(path).cloned().unwrap_or_default();
    let postures: Vec<JointPositions> =
        names.iter().rev().skip(1).filter_map(|name| model.find_posture(name)).collect();
    move_through(agent, &postures, obstacles)
}

/// A motion of the tool.
pub struct ToolMove<'a> {
    /// Where the tool shall be, base frame.
    pub goal: Pose,
    /// Obstacles, base frame.
    pub obstacles: &'a [Obstacle],
    /// Links that may touch them.
    pub touching: &'a [LinkId],
    /// Greatest speed of the tool, metres per second.
    pub speed_m_per_s: f64,
    /// Joints to prefer where the pose leaves them free.
    pub posture: Option<&'a JointPositions>,
    /// Without progress for this long the motion is stuck.
    pub give_up_after: Span,
    /// Whether what holds the tool up ends the motion before the motors press: for fingers that go in or set down.
    pub gentle: bool,
    /// Distance kept from obstacles, metres; `None` for that of free motions. Going in to grasp, it is what the planner of
    /// grasps asked for: with more the hand stops two centimetres before what stands close to others.
    pub clearance_m: Option<f64>,
}

/// Moves the tool to a pose in the base frame.
pub fn move_tool(agent: &mut Agent, motion: &ToolMove<'_>) -> Result<ArmOutcome, Halt> {
    let model = agent.model().clone();
    let mut config =
        ControllerConfig { max_tool_speed_m_per_s: motion.speed_m_per_s, ..model.settings.control.clone() };
    if let Some(clearance_m) = motion.clearance_m {
        config.obstacle_stop_m = config.obstacle_stop_m.min(clearance_m);
    }
    if motion.gentle {
        config.gain_per_s = config.gain_per_s.min(GENTLE_GAIN_PER_S);
    }
    let mut controller = Controller::new(&model, config);
    if let Some(posture) = motion.posture {
        controller.set_posture(posture);
    }
    controller.set_touching(motion.touching);
    let goal = ToolGoal::from(motion.goal);
    let mut watch = Watch::new(agent.now().as_s(), TOOL_PROGRESS_M, motion.give_up_after);
    agent.take_touch();
    loop {
        let state = agent.arm_state()?;
        controller.set_other_joints(agent.configuration()?.positions());
        let output = controller.tick(&state, &goal, motion.obstacles, agent.period().as_s());
        agent.journal.control = Some(margins(&output));
        agent.tick(Twist::default(), &output.velocities)?;
        let touched = match motion.gentle {
            true => find_tool_lag_m(agent)? > GENTLE_LAG_M,
            // What fingers hold, or come out of, may hold them up for a while.
            false => motion.touching.is_empty() && agent.take_touch(),
        };
        if touched {
            return yield_to_touch(agent, &output);
        }
        if let Some(outcome) = judge(&output, &mut watch, agent.now().as_s()) {
            log_stuck(agent, "the tool is", outcome, &output);
            return Ok(outcome);
        }
    }
}

/// How far the tool lags behind what was sent to the arm, metres.
fn find_tool_lag_m(agent: &mut Agent) -> Result<f64, Halt> {
    let (model, configuration) = (agent.model().clone(), agent.configuration()?);
    let mut positions = agent.arm_state()?.positions;
    for (at, lag) in positions.values_mut().iter_mut().zip(agent.joint_lags()) {
        *at += lag;
    }
    let mut ahead = configuration.clone();
    ahead.apply(&positions);
    let at = |configuration| model.kinematics.root_from_link(configuration, model.tool).translation.vector;
    Ok((at(&ahead) - at(&configuration)).norm())
}

/// Moves the tool to a pose; where the controller is held up on the way, by a planned path around what holds it up.
pub fn move_tool_around(agent: &mut Agent, motion: &ToolMove<'_>, good_enough: (f64, f64)) -> Result<ArmOutcome, Halt> {
    let outcome = move_tool(agent, motion)?;
    match outcome {
        ArmOutcome::Stuck { error_m, error_rad } if error_m > good_enough.0 || error_rad > good_enough.1 => {}
        _ => return Ok(outcome),
    }
    let Some(path) = plan_around(agent, motion)? else { return Ok(outcome) };
    follow_slowly(agent, &path, motion.obstacles)?;
    move_tool(agent, motion)
}

/// Moves the arm group to joint values by a planned path around obstacles.
pub fn move_joints_around(
    agent: &mut Agent,
    goal: &JointPositions,
    obstacles: &[Obstacle],
) -> Result<ArmOutcome, Halt> {
    let (model, configuration) = (agent.model().clone(), agent.configuration()?);
    let (target, around) = (goal.clone(), obstacles.to_vec());
    let path = agent.plan(move || {
        MARGINS_M.iter().find_map(|&margin_m| {
            let request = PathRequest { obstacles: &around, margin_m, ..PathRequest::new(&configuration) };
            find_joint_path(&model, &target, &request)
        })
    })?;
    if let Some(path) = path {
        follow_slowly(agent, &path, obstacles)?;
    }
    move_joints(agent, goal, obstacles)
}

fn follow_slowly(agent: &mut Agent, path: &[JointPositions], obstacles: &[Obstacle]) -> Result<(), Halt> {
    agent.log(format!("goes around by {} way points", path.len()));
    let config = agent.model().settings.control.clone();
    let config = ControllerConfig { velocity_share: AROUND_SHARE * config.velocity_share, ..config };
    for posture in path {
        if let ArmOutcome::Stuck { error_m, .. } = move_joints_by(agent, posture, obstacles, config.clone())?
            && error_m > PASSED_RAD
        {
            break;
        }
    }
    Ok(())
}

/// A path of postures to joints for the pose; wide of the obstacles if that can be had.
fn plan_around(agent: &mut Agent, motion: &ToolMove<'_>) -> Result<Option<Vec<JointPositions>>, Halt> {
    let (model, configuration) = (agent.model().clone(), agent.configuration()?);
    let (goal, obstacles) = (motion.goal, motion.obstacles.to_vec());
    let seeds: Vec<JointPositions> = motion.posture.into_iter().cloned().collect();
    agent.plan(move || {
        MARGINS_M.iter().find_map(|&margin_m| {
            let ik = IkRequest { seeds: &seeds, obstacles: &obstacles, margin_m, ..IkRequest::new(&configuration) };
            let joints = find_ik(&model, &goal, &ik)?;
            let request = PathRequest { obstacles: &obstacles, margin_m, ..PathRequest::new(&configuration) };
            find_joint_path(&model, &joints, &request)
        })
    })
}

fn margins(output: &ControlOutput) -> ControlSample {
    ControlSample { error: output.error_m, distance_m: output.min_distance_m, active_rows: output.active_rows }
}

fn judge(output: &ControlOutput, watch: &mut Watch, now_s: f64) -> Option<ArmOutcome> {
    if output.status == ControlStatus::Reached {
        return Some(ArmOutcome::Reached);
    }
    // A radian of turning counts like 0.2 m of way.
    let stuck = watch.note(output.error_m + 0.2 * output.error_rad, now_s);
    stuck.then_some(ArmOutcome::Stuck { error_m: output.error_m, error_rad: output.error_rad })
}
