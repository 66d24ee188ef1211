//! The 500 Panda targets of the evaluation data, and the protocol that comes with them.

use dsm::Pose;
use dsm::time::Stamp;
use dsm_robot::control::{ControlOutput, Controller, ControllerConfig, ToolGoal};
use dsm_robot::drivers::JointState;
use dsm_robot::joints::{JointPositions, JointVelocities};
use dsm_robot::model::{CollisionModel, Group, Kinematics, LinkId};
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

/// Accelerations of the Panda's data sheet, rad/s^2; the targets' file has none.
const ACCELERATIONS: [f64; 7] = [15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0];

/// The targets with the arm that shall reach them.
pub(crate) struct Panda {
    pub(crate) kinematics: Kinematics,
    pub(crate) collision: Arc<CollisionModel>,
    pub(crate) arm: Group,
    pub(crate) tool: LinkId,
    pub(crate) home: Vec<f64>,
    pub(crate) targets: Vec<Pose>,
    pub(crate) dt_s: f64,
    pub(crate) max_steps: usize,
}

/// How a run towards one target ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PandaRun {
    pub(crate) reached: bool,
    /// Joints and steps beyond a limit of position, velocity or acceleration.
    pub(crate) violations: usize,
    pub(crate) steps: usize,
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|v| v.as_f64().expect("a number")).collect()
}

fn words(value: &Value) -> String {
    numbers(value).iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

impl Panda {
    /// The targets of a file.
    pub(crate) fn load(targets: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(targets).map_err(|error| format!("{}: {error}", targets.display()))?;
        let data: Value = serde_json::from_str(&text).map_err(|error| format!("{}: {error}", targets.display()))?;
        let chain = data["chain"].as_array().expect("a chain");
        let mut urdf = String::from("<robot name=\"panda\">");
        let text = |value: &Value| value.as_str().expect("a word").to_owned();
        let mut links = vec![text(&chain[0]["parent"])];
        for joint in chain {
            links.push(text(&joint["child"]));
            let (name, kind) = (text(&joint["joint"]), text(&joint["type"]));
            write!(urdf, "<joint name=\"{name}\" type=\"{kind}\">").expect("text");
            let (parent, child) = (text(&joint["parent"]), text(&joint["child"]));
            let (xyz, rpy) = (words(&joint["xyz"]), words(&joint["rpy"]));
            write!(urdf, "<parent link=\"{parent}\"/><child link=\"{child}\"/><origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>")
                .expect("text");
            if kind != "fixed" {
                let (axis, velocity) = (words(&joint["axis"]), &joint["velocity"]);
                let (lower, upper) = (&joint["lower"], &joint["upper"]);
                write!(urdf, "<axis xyz=\"{axis}\"/><limit lower=\"{lower}\" upper=\"{upper}\" velocity=\"{velocity}\" effort=\"87\"/>").expect("text");
            }
            urdf.push_str("</joint>");
        }
        for link in links {
            write!(urdf, "<link name=\"{link}\"/>").expect("text");
        }
        urdf.push_str("</robot>");
        let folder = std::env::temp_dir().join(format!("dsm-panda-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("temporary folder");
        let file = folder.join("panda.urdf");
        std::fs::write(&file, urdf).expect("temporary file");
        let kinematics = Kinematics::load_urdf(&file).expect("the chain is a URDF");
        std::fs::remove_dir_all(&folder).expect("temporary folder");
        let limits: Vec<_> = kinematics
            .variables
            .iter()
            .map(|name| kinematics.find_joint(name).expect("a variable is a joint").limits)
            .collect();
        let arm = Group {
            name: "arm".to_owned(),
            joints: kinematics.variables.clone(),
            variables: (0..limits.len()).collect(),
            limits,
            max_accelerations: ACCELERATIONS.to_vec(),
        };
        let pose = |target: &Value| {
            let (p, q) = (numbers(&target["pos"]), numbers(&target["quat_wxyz"]));
            let rotation = UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]));
            Pose::from_parts(Translation3::new(p[0], p[1], p[2]), rotation)
        };
        let tip = text(&data["tip_frame"]);
        Ok(Self {
            collision: Arc::new(CollisionModel::new(&kinematics, &[])),
            tool: kinematics.find_link(&tip).expect("the tip is a link"),
            arm,
            kinematics,
            home: numbers(&data["home"]["q"]),
            targets: data["targets"].as_array().expect("targets").iter().map(pose).collect(),
            dt_s: data["protocol"]["dt"].as_f64().expect("a number"),
            max_steps: data["protocol"]["max_steps"].as_u64().expect("a number") as usize,
        })
    }

    /// A controller for the arm.
    pub(crate) fn controller(&self, config: ControllerConfig) -> Controller {
        Controller::for_group(&self.kinematics, &self.collision, &self.arm, self.tool, config)
    }

    /// Drives from home towards a target as the protocol says. `tick` is the controller's; it is handed in so that a
    /// caller can watch or time it. Within 5 mm and 0.05 rad counts as reached; no limit may be broken on the way.
    pub(crate) fn run(
        &self,
        target: &Pose,
        mut tick: impl FnMut(&JointState, &ToolGoal, f64) -> ControlOutput,
    ) -> PandaRun {
        let mut state = JointState {
            stamp: Stamp(0),
            positions: JointPositions::from_values(&self.arm.joints, self.home.clone()).expect("lengths"),
            velocities: JointVelocities::zeros(&self.arm.joints),
        };
        let goal = ToolGoal::from(*target);
        let mut configuration = self.kinematics.zero();
        let mut run = PandaRun { reached: false, violations: 0, steps: 0 };
        for step in 1..=self.max_steps {
            let output = tick(&state, &goal, self.dt_s);
            run.steps = step;
            for (k, velocity) in output.velocities.values().iter().enumerate() {
                let limits = &self.arm.limits[k];
                let gained = velocity - state.velocities.values()[k];
                state.positions.values_mut()[k] += velocity * self.dt_s;
                let position = state.positions.values()[k];
                let broken = velocity.abs() > limits.velocity + 2e-3
                    || position < limits.lower - 1e-4
                    || position > limits.upper + 1e-4
                    || gained.abs() > self.arm.max_accelerations[k] * self.dt_s + 1e-6;
                run.violations += usize::from(broken);
            }
            state.velocities = output.velocities;
            state.stamp = Stamp::from_s(step as f64 * self.dt_s);
            configuration.apply_group(&self.arm, state.positions.values());
            let reached = self.kinematics.root_from_link(&configuration, self.tool);
            let error_m = (reached.translation.vector - target.translation.vector).norm();
            if error_m < 0.005 && reached.rotation.angle_to(&target.rotation) < 0.05 {
                run.reached = true;
                break;
            }
        }
        run
    }

    /// The parameters for this arm: it is faster than a household robot.
    pub(crate) fn config() -> ControllerConfig {
        ControllerConfig {
            gain_per_s: 5.0,
            max_tool_speed_m_per_s: 2.0,
            max_tool_turn_rad_per_s: 6.0,
            velocity_share: 1.0,
            limit_margin: 0.0,
            ..ControllerConfig::default()
        }
    }
}
