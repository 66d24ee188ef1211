//! Robots that speak ROS 2: one to act with, and the simulator shown as one.
//!
//! ```text
//! dsm run --drivers ros2:  executor ──▶ agent ──▶ limits ──▶ ROS 2 ⇄ any robot
//! dsm serve:               any task ⇄ ROS 2 ──▶ simulated robot ──truth──▶ judge
//! ```
//!
//! The judge stays where the world is: whoever acts tells its account at the end and never sees the truth.

mod act;
mod detector;
mod served;

pub use act::act;
pub use served::{Served, Service, Weather, serve};

use crate::assemble::{Present, Tell, find_robot, limited, sees_pixels_alone};
use crate::deferred::Waiting;
use crate::error::TaskError;
use crate::run::RunSpec;
use crate::summary::Summary;
use detector::WireDetector;
use dsm::map::Map;
use dsm::perceive::{Detector, PixelSegmenter};
use dsm::store::encode_map;
use dsm_robot::drivers::Robot;
use dsm_robot::model::RobotModel;
use dsm_robot::model::ros2::{ClockSource, Ros2Settings};
use dsm_robot::recorded::RecordSink;
use dsm_ros2::account::Teller;
use dsm_ros2::client::{Connection, connect};
use dsm_ros2::messages::Account;
use std::sync::Arc;

/// What a run needs of a robot that speaks ROS 2. It breaks where it stands: the faults of an episode are not added here.
pub(crate) fn reach(
    spec: &RunSpec,
    settings: &Ros2Settings,
    sink: Option<Box<dyn RecordSink>>,
) -> Result<Present, TaskError> {
    let model = Arc::new(RobotModel::load(&find_robot(&spec.robot)?)?);
    let teller = Teller::start(settings.domain)?;
    let Connection { robot, detections, log } = connect(model.clone(), settings.clone())?;
    let detector: Box<dyn Detector> = match detections {
        Some(detections) if !sees_pixels_alone(spec) => Box::new(WireDetector::new(&settings.detector, detections)),
        _ => Box::new(PixelSegmenter),
    };
    let robot = limited(Box::new(robot), &model, sink, spec.stop.clone());
    let waiting = match settings.clock {
        ClockSource::LockStep => Waiting::ForResults,
        ClockSource::Wall | ClockSource::Topic => Waiting::Never,
    };
    let tell = Some(tell(teller, settings.timeout_s));
    Ok(Present { robot, model, detector, words: log, judged: None, waiting, tell })
}

/// A robot that speaks ROS 2 without its envelope.
pub(crate) fn reach_bare(
    spec: &RunSpec,
    settings: &Ros2Settings,
) -> Result<(Box<dyn Robot>, Arc<RobotModel>), TaskError> {
    let model = Arc::new(RobotModel::load(&find_robot(&spec.robot)?)?);
    let Connection { robot, .. } = connect(model.clone(), settings.clone())?;
    Ok((Box::new(robot), model))
}

fn tell(teller: Teller, timeout_s: f64) -> Tell {
    Box::new(move |summary: &Summary, map: &Map| {
        let json = |value: serde_json::Result<String>| value.unwrap_or_else(|_| "null".into());
        let account = Account {
            episode: summary.episode.clone(),
            steps: json(serde_json::to_string(&summary.steps)),
            failure: json(serde_json::to_string(&summary.failure)),
            map: encode_map(map),
        };
        if !teller.tell(account, timeout_s) {
            tracing::info!("nobody judges this run: /dsm/account is not taken");
        }
    })
}
