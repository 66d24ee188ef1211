//! Robots whose drivers are written in Python.

use crate::frame::{Frame, pose_of};
use crate::interrupt::Interrupt;
use dsm::frame::RgbdFrame;
use dsm::perceive::PixelSegmenter;
use dsm::time::Stamp;
use dsm_robot::drivers::{
    Base, Cameras, Clock, DriverError, EmergencyStop, Gripper, GripperState, JointGroup, JointState, Localisation,
    Robot, StampedPose, Twist,
};
use dsm_robot::joints::{JointNames, JointPositions, JointVelocities};
use dsm_robot::model::RobotModel;
use dsm_tasks::assemble::find_robot;
use dsm_tasks::deferred::Waiting;
use dsm_tasks::error::TaskError;
use dsm_tasks::run::RunSpec;
use dsm_tasks::session::OwnRobot;
use numpy::{PyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use std::sync::Arc;

/// The Python object, as one part of the robot calls it. What it raises ends the run and is raised again there.
#[derive(Clone)]
struct Wire {
    object: Arc<Py<PyAny>>,
    interrupt: Interrupt,
    part: &'static str,
}

impl Wire {
    /// Calls a method and reads its answer.
    fn call<T>(
        &self,
        method: &str,
        arguments: impl for<'py> FnOnce(Python<'py>) -> PyResult<Bound<'py, pyo3::types::PyTuple>>,
        read: impl for<'py> FnOnce(Bound<'py, PyAny>) -> PyResult<T>,
    ) -> Result<T, DriverError> {
        let answer = Python::attach(|py| read(self.object.bind(py).call_method1(method, arguments(py)?)?));
        answer.map_err(|error| {
            let lost = DriverError::Lost { part: self.part.to_owned(), reason: error.to_string() };
            self.interrupt.raise(error);
            lost
        })
    }

    fn now(&self) -> Result<Stamp, DriverError> {
        self.call("now_s", nothing, |time_s| Ok(Stamp::from_s(time_s.extract()?)))
    }

    fn pose(&self, method: &str) -> Result<StampedPose, DriverError> {
        let stamp = self.now()?;
        let pose = self.call(method, nothing, |pose| {
            let pose: PyReadonlyArray2<'_, f64> = pose.extract()?;
            pose_of(method, &pose)
        })?;
        Ok(StampedPose { stamp, pose })
    }
}

fn nothing(py: Python<'_>) -> PyResult<Bound<'_, pyo3::types::PyTuple>> {
    Ok(pyo3::types::PyTuple::empty(py))
}

struct PythonBase(Wire);

impl Base for PythonBase {
    fn command(&mut self, twist: Twist) -> Result<Twist, DriverError> {
        let Twist { forward_m_per_s, turn_rad_per_s } = twist;
        let sent: Option<(f64, f64)> = self.0.call(
            "command_base",
            |py| (forward_m_per_s, turn_rad_per_s).into_pyobject(py),
            |sent| sent.extract(),
        )?;
        let (forward_m_per_s, turn_rad_per_s) = sent.unwrap_or((forward_m_per_s, turn_rad_per_s));
        Ok(Twist { forward_m_per_s, turn_rad_per_s })
    }

    fn velocity(&mut self) -> Result<Twist, DriverError> {
        let (forward_m_per_s, turn_rad_per_s) = self.0.call("base_velocity", nothing, |value| value.extract())?;
        Ok(Twist { forward_m_per_s, turn_rad_per_s })
    }
}

/// Arm or head.
struct PythonJoints {
    wire: Wire,
    joints: JointNames,
}

impl PythonJoints {
    fn wrong(&self, got: usize) -> DriverError {
        let expected = self.joints.iter().map(|name| name.to_string()).collect();
        DriverError::WrongJoints { expected, got: vec![format!("{got} values")] }
    }
}

impl JointGroup for PythonJoints {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        let group = self.wire.part;
        let sent: Option<Vec<f64>> = self.wire.call(
            "command_joints",
            |py| (group, PyArray1::from_slice(py, velocities.values())).into_pyobject(py),
            |sent| sent.extract(),
        )?;
        let Some(sent) = sent else { return Ok(velocities.clone()) };
        let given = sent.len();
        JointVelocities::from_values(&self.joints, sent).ok_or_else(|| self.wrong(given))
    }

    fn state(&mut self) -> Result<JointState, DriverError> {
        let group = self.wire.part;
        let stamp = self.wire.now()?;
        let (positions, velocities): (Vec<f64>, Vec<f64>) =
            self.wire.call("joint_state", |py| (group,).into_pyobject(py), |state| state.extract())?;
        let given = positions.len().min(velocities.len());
        let positions = JointPositions::from_values(&self.joints, positions).ok_or_else(|| self.wrong(given))?;
        let velocities = JointVelocities::from_values(&self.joints, velocities).ok_or_else(|| self.wrong(given))?;
        Ok(JointState { stamp, positions, velocities })
    }
}

struct PythonGripper(Wire);

impl Gripper for PythonGripper {
    fn command(&mut self, width_m: f64, max_force_n: f64) -> Result<(f64, f64), DriverError> {
        let sent: Option<(f64, f64)> =
            self.0.call("command_gripper", |py| (width_m, max_force_n).into_pyobject(py), |sent| sent.extract())?;
        Ok(sent.unwrap_or((width_m, max_force_n)))
    }

    fn state(&mut self) -> Result<GripperState, DriverError> {
        let stamp = self.0.now()?;
        let (width_m, force_n, moving) = self.0.call("gripper_state", nothing, |state| state.extract())?;
        Ok(GripperState { stamp, width_m, force_n, moving })
    }
}

struct PythonCameras {
    wire: Wire,
    names: Vec<String>,
}

impl Cameras for PythonCameras {
    fn names(&self) -> Vec<String> {
        self.names.clone()
    }

    fn read(&mut self, camera: &str) -> Result<Option<RgbdFrame>, DriverError> {
        if !self.names.iter().any(|name| name == camera) {
            return Err(DriverError::NoCamera { name: camera.to_owned(), known: self.names.clone() });
        }
        self.wire.call(
            "read_camera",
            |py| (camera,).into_pyobject(py),
            |frame| {
                let frame: Option<Bound<'_, Frame>> = frame.extract()?;
                Ok(frame.map(|frame| (*frame.get().frame).clone()))
            },
        )
    }
}

struct PythonPlace(Wire);

impl Localisation for PythonPlace {
    fn world_from_base(&mut self) -> Result<StampedPose, DriverError> {
        self.0.pose("world_from_base")
    }

    fn odom_from_base(&mut self) -> Result<StampedPose, DriverError> {
        self.0.pose("odom_from_base")
    }
}

struct PythonClock {
    wire: Wire,
    /// The last moment that it told of: asking cannot fail.
    last: Stamp,
}

impl Clock for PythonClock {
    fn now(&self) -> Stamp {
        self.wire.now().unwrap_or(self.last)
    }

    fn wait_until(&mut self, stamp: Stamp) -> Result<(), DriverError> {
        self.wire.call("wait_until", |py| (stamp.as_s(),).into_pyobject(py), |_| Ok(()))?;
        self.last = self.wire.now()?;
        if self.last < stamp {
            let reason = format!("wait_until({:.3}) came back at {:.3} s", stamp.as_s(), self.last.as_s());
            return Err(DriverError::Lost { part: self.wire.part.to_owned(), reason });
        }
        Ok(())
    }
}

struct PythonStop {
    wire: Wire,
    reason: Option<String>,
}

impl EmergencyStop for PythonStop {
    fn trigger(&mut self, reason: &str) -> Result<(), DriverError> {
        self.reason.get_or_insert_with(|| reason.to_owned());
        self.wire.call("stop", |py| (reason,).into_pyobject(py), |_| Ok(()))
    }

    fn find_reason(&self) -> Option<String> {
        self.reason.clone()
    }

    fn reset(&mut self) -> Result<(), DriverError> {
        self.wire.call("reset", nothing, |_| Ok(()))?;
        self.reason = None;
        Ok(())
    }
}

/// A robot behind a Python object.
struct PythonRobot {
    base: PythonBase,
    arm: PythonJoints,
    gripper: PythonGripper,
    head: PythonJoints,
    cameras: PythonCameras,
    place: PythonPlace,
    clock: PythonClock,
    stop: PythonStop,
}

impl Robot for PythonRobot {
    fn base(&mut self) -> &mut dyn Base {
        &mut self.base
    }
    fn arm(&mut self) -> &mut dyn JointGroup {
        &mut self.arm
    }
    fn gripper(&mut self) -> &mut dyn Gripper {
        &mut self.gripper
    }
    fn head(&mut self) -> &mut dyn JointGroup {
        &mut self.head
    }
    fn cameras(&mut self) -> &mut dyn Cameras {
        &mut self.cameras
    }
    fn localisation(&mut self) -> &mut dyn Localisation {
        &mut self.place
    }
    fn clock(&mut self) -> &mut dyn Clock {
        &mut self.clock
    }
    fn emergency_stop(&mut self) -> &mut dyn EmergencyStop {
        &mut self.stop
    }
}

/// The robot of a Python driver, of the model that the run names. Time waits for slow work where the driver says so by a
/// true attribute `waits_for_work`, as a world that steps does; a robot on the floor goes on.
pub(crate) fn own_robot(driver: Py<PyAny>, spec: &RunSpec, interrupt: &Interrupt) -> Result<OwnRobot, TaskError> {
    let model = Arc::new(RobotModel::load(&find_robot(&spec.robot)?)?);
    let object = Arc::new(driver);
    let wire = |part: &'static str| Wire { object: object.clone(), interrupt: interrupt.clone(), part };
    let waits = Python::attach(|py| {
        let driver = object.bind(py);
        Ok::<_, PyErr>(driver.hasattr("waits_for_work")? && driver.getattr("waits_for_work")?.is_truthy()?)
    });
    let waiting = match waits {
        Ok(true) => Waiting::ForResults,
        Ok(false) => Waiting::Never,
        Err(error) => return Err(TaskError::Usage(format!("waits_for_work: {error}"))),
    };
    let names = wire("cameras").call("cameras", nothing, |names| names.extract())?;
    let last = wire("clock").now()?;
    let robot = PythonRobot {
        base: PythonBase(wire("base")),
        arm: PythonJoints { wire: wire("arm"), joints: model.arm.joints.clone() },
        gripper: PythonGripper(wire("gripper")),
        head: PythonJoints { wire: wire("head"), joints: model.head.joints.clone() },
        cameras: PythonCameras { wire: wire("cameras"), names },
        place: PythonPlace(wire("localisation")),
        clock: PythonClock { wire: wire("clock"), last },
        stop: PythonStop { wire: wire("stop"), reason: None },
    };
    // Without a detector written in Python or a backend that sees, things are found in pixels alone.
    Ok(OwnRobot { robot: Box::new(robot), model, detector: Box::new(PixelSegmenter), waiting })
}
