//! Simulated cameras: the true image of the scene and the robot, and the sensor model that spoils it.
//!
//! ```text
//! SceneModel + RobotVisual ──once──▶ CameraRig ──poses──▶ TrueImage ──SensorModel──▶ SensedImage ──▶ RgbdFrame
//!                                                             └─labels (private to this crate)──▶ SimDetector
//! ```
//!
//! Looking never changes the world. An image is a function of the poses; a spoilt image also of (seed, stream, frame).

mod depth_noise;
mod light;
mod noise;
mod normal_table;
mod rig;
mod shapes;
mod visual;

pub use light::LightDraw;
pub use noise::{NoiseError, NoiseKey, NoiseParameters, SensedImage, SensorModel};
pub use rig::{CameraError, CameraRig, ROBOT_LABEL, TrueImage, VISIBLE_ALPHA, label_of_body};
pub use visual::{RobotVisual, robot_visuals};
