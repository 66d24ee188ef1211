//! The simulated robot on any engine, held to the contract of drivers.

use dsm_robot::conformance::{Scope, check};
use dsm_robot::drivers::Robot;
use dsm_robot::model::RobotModel;
use dsm_sim::physics::Physics;
use dsm_sim::robot::{CaptureRequest, Imager, LocalisationConfig, LocalisationNoise, SensorImage, SimRobot};

/// Images of nothing.
struct Blind;

impl Imager for Blind {
    fn take_image(&mut self, request: &CaptureRequest<'_>) -> SensorImage {
        let pixels = request.model.pixel_count();
        SensorImage { color: vec![[0; 3]; pixels], depth_m: vec![0.0; pixels] }
    }
}

/// A robot with the usual noise that sees nothing.
pub(crate) fn robot_on(physics: Box<dyn Physics>, model: &RobotModel) -> SimRobot {
    let localisation = LocalisationConfig { seed: 1, noise: LocalisationNoise::Noisy };
    SimRobot::new(physics, model, Box::new(Blind), localisation).expect("model and physics fit")
}

/// Every behaviour of the list.
#[track_caller]
pub(crate) fn trials(robot: &mut dyn Robot, model: &RobotModel) {
    let report = check(robot, model, Scope::Moving);
    let failed: Vec<_> = report.findings.iter().filter(|finding| !finding.passed).collect();
    assert!(failed.is_empty() && report.findings.len() == 18, "{failed:#?}");
}
