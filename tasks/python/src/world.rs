//! A simulated world to be stepped: the robot within its limits, its cameras, and the judge's verdict.

use crate::builder::CELL_M;
use crate::error::{InputError, RunError, raised};
use crate::frame::Frame;
use crate::plain::to_python;
use crate::process::check_process;
use crate::senses::Senses;
use crate::spec::{Asked, spec_of};
use dsm::map::Map;
use dsm::time::{Span, Stamp};
use dsm_robot::control::{Controller, ToolGoal};
use dsm_robot::drivers::{DriverError, Robot, Twist};
use dsm_robot::joints::{JointNames, JointVelocities};
use dsm_robot::model::RobotModel;
use dsm_tasks::assemble::{Assembled, Judged, assemble};
use dsm_tasks::episode::Episode;
use dsm_tasks::error::TaskError;
use dsm_tasks::summary::ExpectationSummary;
use nalgebra::Vector3;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard};

/// Control period, as the agent's loop has it.
const PERIOD: Span = Span(10_000_000);
/// Longest step, simulated seconds.
const LONGEST_S: f64 = 600.0;

/// What is sent to the robot in each control period of a step.
#[derive(Clone, Copy)]
struct Commands {
    base: Twist,
    arm: ArmCommand,
    head: [f64; 2],
    gripper: Option<(f64, f64)>,
}

/// How the arm is commanded.
#[derive(Clone, Copy)]
enum ArmCommand {
    Still,
    /// Velocity of the tool, base frame: m/s, then rad/s.
    Tool([f64; 6]),
    /// Velocities of the joints stand beside the commands.
    Joints,
}

/// The robot and who judges it.
struct Bench {
    robot: Box<dyn Robot>,
    model: Arc<RobotModel>,
    controller: Controller,
    judged: Judged,
}

impl Bench {
    fn step(&mut self, commands: Commands, joints: &JointVelocities, duration: Span) -> Result<(), DriverError> {
        let end = self.robot.clock().now() + duration;
        let mut head = JointVelocities::zeros(&self.model.head.joints);
        head.values_mut().iter_mut().zip(commands.head).for_each(|(value, wanted)| *value = wanted);
        while self.robot.clock().now() < end {
            let next = Stamp((self.robot.clock().now() + PERIOD).0.min(end.0));
            self.robot.base().command(commands.base)?;
            match commands.arm {
                ArmCommand::Tool(twist) => {
                    let velocities = self.follow(twist)?;
                    self.robot.arm().command(&velocities)?;
                }
                ArmCommand::Joints | ArmCommand::Still => drop(self.robot.arm().command(joints)?),
            }
            self.robot.head().command(&head)?;
            if let Some((width_m, force_n)) = commands.gripper {
                self.robot.gripper().command(width_m, force_n)?;
            }
            self.robot.clock().wait_until(next)?;
        }
        self.judged.observe();
        Ok(())
    }

    /// Joint velocities that move the tool so, within limits and clear of the robot itself.
    fn follow(&mut self, [x, y, z, roll, pitch, yaw]: [f64; 6]) -> Result<JointVelocities, DriverError> {
        let state = self.robot.arm().state()?;
        let mut configuration = self.model.kinematics.zero();
        configuration.apply(&state.positions);
        configuration.apply(&self.robot.head().state()?.positions);
        let width_m = self.robot.gripper().state()?.width_m;
        let configuration = self.model.with_gripper_width(configuration, width_m);
        self.controller.set_other_joints(configuration.positions());
        let goal = ToolGoal {
            base_from_tool: self.model.kinematics.root_from_link(&configuration, self.model.tool),
            linear_m_per_s: Vector3::new(x, y, z),
            angular_rad_per_s: Vector3::new(roll, pitch, yaw),
        };
        Ok(self.controller.tick(&state, &goal, &[], PERIOD.as_s()).velocities)
    }
}

/// A scene with a robot in it that does what it is told, tick by tick. No map is built.
#[pyclass(frozen, module = "dsm")]
pub(crate) struct World {
    bench: Mutex<Bench>,
    arm: JointNames,
    head: JointNames,
    cameras: Vec<String>,
    commands: Vec<String>,
    seed: u64,
}

impl World {
    fn build(asked: Asked) -> Result<Self, TaskError> {
        let spec = spec_of(asked)?;
        let (seed, commands) = (spec.seed, commands_of(&spec.episode));
        let Assembled { mut robot, model, truth, judge, .. } = assemble(&spec)?;
        let (arm, head) = (model.arm.joints.clone(), model.head.joints.clone());
        let cameras = robot.cameras().names();
        let controller = Controller::new(&model, model.settings.control.clone());
        let bench = Bench { robot, model, controller, judged: Judged { truth, judge } };
        Ok(Self { bench: Mutex::new(bench), arm, head, cameras, commands, seed })
    }

    fn bench(&self) -> PyResult<MutexGuard<'_, Bench>> {
        self.bench.lock().map_err(|_| RunError::new_err("this world broke in an earlier call"))
    }

    /// Does something with the robot while other Python threads go on.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Bench) -> Result<T, DriverError> + Send,
    ) -> PyResult<T> {
        py.detach(|| Ok::<_, PyErr>(work(&mut *self.bench()?)))?.map_err(|error| raised(error.into()))
    }
}

#[pymethods]
impl World {
    /// Loads a scene (its folder or MJCF file) or the scene of an episode file, draws what the seed decides, and puts the
    /// robot in. An episode brings its start, its robot and what the judge expects.
    #[new]
    #[pyo3(signature = (path, *, seed=None, robot=None, physics=None, perception=None, start=None, expect=None))]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        seed: Option<u64>,
        robot: Option<String>,
        physics: Option<&str>,
        perception: Option<&str>,
        start: Option<(f64, f64, f64)>,
        expect: Option<Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        check_process()?;
        let asked = Asked::new(path, seed, robot, physics, perception, start, expect.as_ref())?;
        py.detach(|| Self::build(asked)).map_err(raised)
    }

    /// Commands base, arm, head and gripper for a while and lets time pass, ten milliseconds at a time. Commands are
    /// held to the robot's limits. Nothing moves that is not commanded.
    #[pyo3(signature = (*, base=(0.0, 0.0), arm=None, tool=None, head=(0.0, 0.0), gripper=None, duration_s=0.01))]
    fn step(
        &self,
        py: Python<'_>,
        base: (f64, f64),
        arm: Option<Vec<f64>>,
        tool: Option<[f64; 6]>,
        head: (f64, f64),
        gripper: Option<(f64, f64)>,
        duration_s: f64,
    ) -> PyResult<()> {
        let command = match (&arm, tool) {
            (Some(_), Some(_)) => return Err(InputError::new_err("arm and tool are given; expected one of them")),
            (Some(_), None) => ArmCommand::Joints,
            (None, Some(twist)) => ArmCommand::Tool(twist),
            (None, None) => ArmCommand::Still,
        };
        let (joints, duration) = (joints_of(&self.arm, arm)?, duration_of(duration_s)?);
        let base = Twist { forward_m_per_s: base.0, turn_rad_per_s: base.1 };
        let commands = Commands { base, arm: command, head: [head.0, head.1], gripper };
        self.with(py, |bench| bench.step(commands, &joints, duration))
    }

    /// The newest picture of a camera that was not read yet, rendered by this call; None when there is no new one.
    #[pyo3(signature = (camera="head"))]
    fn read(&self, py: Python<'_>, camera: &str) -> PyResult<Option<Frame>> {
        Ok(self.with(py, |bench| bench.robot.cameras().read(camera))?.map(Frame::new))
    }

    /// All that the robot feels: a dictionary of numbers and arrays.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.with(py, |bench| Senses::of_robot(bench.robot.as_mut(), &bench.model))?.to_python(py)
    }

    /// What the judge says of the expectations at this moment.
    fn judge<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let judged: Vec<ExpectationSummary> = self.with(py, |bench| {
            bench.judged.observe();
            // Nobody maps here: nothing can have been grounded.
            Ok(bench.judged.judge.judge(&[], &Map::new(CELL_M)))
        })?;
        to_python(py, &judged)
    }

    /// Stops the robot; it stays stopped.
    fn stop(&self, py: Python<'_>, reason: &str) -> PyResult<()> {
        self.with(py, |bench| bench.robot.emergency_stop().trigger(reason))
    }

    /// Simulated seconds since the world was built.
    #[getter]
    fn time_s(&self, py: Python<'_>) -> PyResult<f64> {
        self.with(py, |bench| Ok(bench.robot.clock().now().as_s()))
    }

    /// The seed of every draw.
    #[getter]
    fn seed(&self) -> u64 {
        self.seed
    }

    /// The commands of the episode file, in order; empty for a scene.
    #[getter]
    fn commands(&self) -> Vec<String> {
        self.commands.clone()
    }

    /// Greatest speeds of the base, greatest width and force of the gripper, by name with unit.
    #[getter]
    fn limits<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let model = self.bench()?.model.clone();
        let (base, gripper) = (&model.settings.base, &model.settings.gripper);
        let limits = PyDict::new(py);
        limits.set_item("base_forward_m_per_s", base.max_speed_m_per_s)?;
        limits.set_item("base_turn_rad_per_s", base.max_turn_rate_rad_per_s)?;
        limits.set_item("gripper_width_m", gripper.max_aperture_m)?;
        limits.set_item("gripper_force_n", gripper.max_force_n)?;
        Ok(limits)
    }

    /// Names of the arm's joints, the lift first.
    #[getter]
    fn arm_joints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        PyList::new(py, self.arm.iter().map(|name| &**name))
    }

    /// Names of the head's joints.
    #[getter]
    fn head_joints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        PyList::new(py, self.head.iter().map(|name| &**name))
    }

    /// Names of the cameras.
    #[getter]
    fn cameras(&self) -> Vec<String> {
        self.cameras.clone()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!("<World at {:.2} s, seed {}>", self.time_s(py)?, self.seed))
    }
}

/// The length of a step.
pub(crate) fn duration_of(duration_s: f64) -> PyResult<Span> {
    if duration_s > 0.0 && duration_s <= LONGEST_S {
        return Ok(Span::from_s(duration_s));
    }
    Err(InputError::new_err(format!("duration_s is {duration_s}; expected above 0, up to {LONGEST_S}")))
}

/// The commands of an episode's steps, in order.
pub(crate) fn commands_of(episode: &Episode) -> Vec<String> {
    episode.steps.iter().filter_map(|step| step.command.clone()).collect()
}

/// Velocities of joints in their order; zero when nothing is given.
pub(crate) fn joints_of(names: &JointNames, values: Option<Vec<f64>>) -> PyResult<JointVelocities> {
    let Some(values) = values else { return Ok(JointVelocities::zeros(names)) };
    let given = values.len();
    JointVelocities::from_values(names, values).ok_or_else(|| {
        InputError::new_err(format!("arm has {given} values; expected {}: {}", names.len(), names.join(", ")))
    })
}
